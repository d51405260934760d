#include "core/base/target.h"

#include <algorithm>
#include <vector>

#include "absl/strings/ascii.h"
#include "absl/strings/numbers.h"
#include "absl/strings/str_split.h"

namespace planish {
namespace {

bool IsNumber(const std::string& text, int most) {
  int number = 0;
  return absl::SimpleAtoi(text, &number) && absl::ascii_isdigit(text.front()) && number <= most;
}

}  // namespace

bool IsUnixTarget(const std::string& target) {
  return target.starts_with("unix:") || target.starts_with("unix-abstract:");
}

std::optional<HostPort> ParseHostPort(const std::string& target) {
  const std::size_t colon = target.rfind(':');
  if (colon == std::string::npos || colon == 0 || IsUnixTarget(target)) return std::nullopt;
  HostPort parts = {target.substr(0, colon), target.substr(colon + 1)};
  if (parts.host.size() > 2 && parts.host.front() == '[' && parts.host.back() == ']') {
    parts.host = parts.host.substr(1, parts.host.size() - 2);
  } else if (parts.host.find_first_of(":/") != std::string::npos) {
    return std::nullopt;  // a bare IPv6 address, or a scheme
  }
  return IsNumber(parts.port, 65535) ? std::optional(parts) : std::nullopt;
}

bool IsWithinThisMachine(const std::string& target) {
  if (IsUnixTarget(target)) return true;
  const std::optional<HostPort> parts = ParseHostPort(target);
  if (!parts) return false;
  if (parts->host == "localhost" || parts->host == "::1") return true;
  const std::vector<std::string> numbers = absl::StrSplit(parts->host, '.');
  return numbers.size() == 4 && numbers[0] == "127" &&
         std::all_of(numbers.begin(), numbers.end(), [](const std::string& n) { return IsNumber(n, 255); });
}

}  // namespace planish
