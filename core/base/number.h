// Numbers in text, independent of the locale.
#pragma once

#include <charconv>
#include <cstdint>
#include <string>
#include <string_view>

namespace planish {

// Whether `c` separates tokens in text files: space, tab, line feed, vertical tab, form feed or carriage return.
inline bool IsBlank(char c) {
  return c == ' ' || (c >= '\t' && c <= '\r');
}

// Reads all of `token` as a decimal number. Accepts a leading '+', and "inf" and "nan" in any case. Numbers too large
// for a double become infinite, too small ones zero. Returns false and leaves `value` as it is if `token` is anything
// else.
bool ParseDouble(std::string_view token, double* value);

// Reads all of `token` as a decimal integer that fits 64 bits, with an optional sign. Returns false and leaves `value`
// as it is if `token` is anything else.
bool ParseInt(std::string_view token, std::int64_t* value);

// Appends the fewest digits that read back as the same number of this type.
template <typename Number>
void AppendShortest(Number value, std::string* text) {
  char buffer[32];
  text->append(buffer, std::to_chars(buffer, buffer + sizeof(buffer), value).ptr);
}

}  // namespace planish
