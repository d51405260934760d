#include "client/src/target_address.h"

#include <arpa/inet.h>

#include <algorithm>
#include <cctype>

namespace planish {
inline namespace abi0 {

bool IsUnixTarget(const std::string& target) {
  return target.rfind("unix:", 0) == 0 || target.rfind("unix-abstract:", 0) == 0;
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
  const bool is_number = !parts.port.empty() && std::all_of(parts.port.begin(), parts.port.end(),
                                                            [](unsigned char c) { return std::isdigit(c) != 0; });
  return is_number ? std::optional(parts) : std::nullopt;
}

bool IsWithinThisMachine(const std::string& target) {
  if (IsUnixTarget(target)) return true;
  const std::optional<HostPort> parts = ParseHostPort(target);
  if (!parts) return false;
  in_addr ipv4 = {};
  if (inet_pton(AF_INET, parts->host.c_str(), &ipv4) == 1) return ntohl(ipv4.s_addr) >> 24 == 127;
  return parts->host == "localhost" || parts->host == "::1";
}

}  // namespace abi0
}  // namespace planish
