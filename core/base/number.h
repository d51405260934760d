// Numbers in text, independent of the locale.
#pragma once

#include <cstdint>
#include <string>
#include <string_view>

namespace planish {

// What ends a token in text files: space, tab, line feed, vertical tab, form feed, carriage return.
inline bool IsBlank(char c) {
  return c == ' ' || (c >= '\t' && c <= '\r');
}

// Reads all of `token` as a decimal number; "inf" and "nan" in any case and a leading '+' are taken. Too large becomes
// infinite, too small zero. False, and `value` untouched, if `token` is anything else.
bool ParseDouble(std::string_view token, double* value);

// Reads all of `token` as a decimal integer that fits 64 bits, with an optional sign.
bool ParseInt(std::string_view token, std::int64_t* value);

// Appends the fewest digits that read back to the same float, or double.
void AppendShortest(float value, std::string* text);
void AppendShortest(double value, std::string* text);
void AppendInt(std::int64_t value, std::string* text);

}  // namespace planish
