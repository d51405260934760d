// Addresses of servers, to listen on or to connect to: "HOST:PORT", "[IPV6]:PORT" or "unix:PATH".
#pragma once

#include <optional>
#include <string>

namespace planish {

struct HostPort {
  std::string host;  // without brackets
  std::string port;  // in [0, 65535]
};

bool IsUnixTarget(const std::string& target);

// The parts of "HOST:PORT" or "[IPV6]:PORT"; nullopt for any other text.
std::optional<HostPort> ParseHostPort(const std::string& target);

// Whether traffic to `target` stays on this machine: a Unix socket or a loopback address.
bool IsWithinThisMachine(const std::string& target);

}  // namespace planish
