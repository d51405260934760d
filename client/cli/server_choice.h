// The server a command talks to: the one it was given, or a private one.
#pragma once

#include <optional>
#include <string>

#include "client/cli/arguments.h"
#include "client/cli/interrupts.h"
#include "planish/client.h"

namespace planish::cli {

struct ServerNeeds {
  // Of a private server: jobs at a time, and threads that each may use (0: the cores, divided by `workers`).
  int workers = 1;
  int threads = 0;
  ClientOptions client;
};

class ServerChoice {
 public:
  // An empty address starts a private server, which needs none of `flags`; throws planish::Error if that fails, or as
  // Client::Client does.
  ServerChoice(const std::string& address, const ServerFlags& flags, Interrupts& interrupts,
               const ServerNeeds& needs = {});
  ~ServerChoice();

  Client& client() { return *client_; }
  // For --verbose: "Server farm:7741: planishd 0.1.0, 4 workers, 8 threads a job". Asks the server.
  std::string Description();
  // Null if the server is somebody else's.
  const PrivateServer* private_server() const { return private_server_ ? &*private_server_ : nullptr; }

 private:
  const std::string address_;
  Interrupts& interrupts_;
  std::optional<PrivateServer> private_server_;
  std::optional<Client> client_;
};

}  // namespace planish::cli
