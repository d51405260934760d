// The server a command talks to: the one it was given, or a private one.
#pragma once

#include <optional>
#include <string>

#include "client/cli/interrupts.h"
#include "planish/client.h"

namespace planish::cli {

class ServerChoice {
 public:
  // An empty address starts a private server whose jobs may use `threads` threads (0: all cores); throws planish::Error
  // if that fails.
  ServerChoice(const std::string& address, Interrupts& interrupts, int threads = 0);
  ~ServerChoice();

  Client& client() { return *client_; }
  // Null if the server is somebody else's.
  const PrivateServer* private_server() const { return private_server_ ? &*private_server_ : nullptr; }

 private:
  Interrupts& interrupts_;
  std::optional<PrivateServer> private_server_;
  std::optional<Client> client_;
};

}  // namespace planish::cli
