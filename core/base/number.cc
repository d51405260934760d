#include "core/base/number.h"

#include <cmath>
#include <limits>

#include "absl/strings/charconv.h"

namespace planish {
namespace {

// std::from_chars does not accept a leading '+'. "+-1" stays an error.
std::string_view WithoutPlus(std::string_view token) {
  if (token.size() > 1 && token[0] == '+' && token[1] != '-') token.remove_prefix(1);
  return token;
}

}  // namespace

bool ParseDouble(std::string_view token, double* value) {
  token = WithoutPlus(token);
  const char* const end = token.data() + token.size();
  double parsed = 0;
  const auto [stop, error] = std::from_chars(token.data(), end, parsed);
  if (stop != end || token.empty()) return false;
  if (error == std::errc::result_out_of_range) {
    // std::from_chars does not say whether the number was too large or too small; absl::from_chars does.
    absl::from_chars(token.data(), end, parsed);
    if (std::abs(parsed) > 1) parsed = std::copysign(std::numeric_limits<double>::infinity(), parsed);
  } else if (error != std::errc()) {
    return false;
  }
  *value = parsed;
  return true;
}

bool ParseInt(std::string_view token, std::int64_t* value) {
  token = WithoutPlus(token);
  const char* const end = token.data() + token.size();
  std::int64_t parsed = 0;
  const auto [stop, error] = std::from_chars(token.data(), end, parsed);
  if (stop != end || error != std::errc()) return false;
  *value = parsed;
  return true;
}

}  // namespace planish
