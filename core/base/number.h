// Numbers in text, independent of the locale.
#pragma once

#include <charconv>
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

// Reads all of `token` as a decimal integer that fits 64 bits, with an optional sign. False, and `value` untouched, if
// it is anything else.
bool ParseInt(std::string_view token, std::int64_t* value);

// Appends the fewest digits that read back to the same number of this type.
template <typename Number>
void AppendShortest(Number value, std::string* text) {
  char buffer[32];
  text->append(buffer, std::to_chars(buffer, buffer + sizeof(buffer), value).ptr);
}

}  // namespace planish
