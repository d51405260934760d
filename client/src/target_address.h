// What a target says: "host:port" or "unix:/path".
#pragma once

#include <optional>
#include <string>

namespace planish {
inline namespace abi0 {

struct HostPort {
  std::string host;  // without brackets
  std::string port;
};

bool IsUnixTarget(const std::string& target);

// Nothing if it is no "host:port" or "[ipv6]:port"; gRPC knows more kinds of targets.
std::optional<HostPort> ParseHostPort(const std::string& target);

// Whether what is sent there stays on this machine: a Unix socket, or a loopback address.
bool IsWithinThisMachine(const std::string& target);

}  // namespace abi0
}  // namespace planish
