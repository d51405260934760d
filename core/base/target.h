// Where a server is, for those who listen and those who connect: "HOST:PORT", "[IPV6]:PORT" or "unix:PATH".
#pragma once

#include <optional>
#include <string>

namespace planish {

struct HostPort {
  std::string host;  // without brackets
  std::string port;  // in [0, 65535]
};

bool IsUnixTarget(const std::string& target);

// Nothing if it is no "HOST:PORT" or "[IPV6]:PORT".
std::optional<HostPort> ParseHostPort(const std::string& target);

// Whether what is sent there stays on this machine: a Unix socket, or a loopback address.
bool IsWithinThisMachine(const std::string& target);

}  // namespace planish
