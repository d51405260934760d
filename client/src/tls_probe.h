// Explains why TLS to a target fails: gRPC only says that a handshake failed, or that a connection was closed.
#pragma once

#include <string>

namespace planish {

// How a client would connect: as in ClientOptions, but with the PEM text in place of file names.
struct TlsProbe {
  bool uses_tls = false;
  std::string ca;
  std::string certificate;
  std::string key;
  std::string server_name;
};

// Connects to `target`, makes a handshake, and returns what is wrong: the server's certificate (unknown authority,
// other name, expired), the client's certificate (missing, refused), or that only one side uses TLS. Empty if nothing
// is wrong, if nobody listens, or if the probe takes more than a few seconds.
std::string FindTlsFault(const std::string& target, const TlsProbe& probe);

}  // namespace planish
