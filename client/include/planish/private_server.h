// Starts a private planishd, for programs that must work without a running server.
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "planish/error.h"

namespace planish::inline abi0 {

struct PrivateServerOptions {
  // Path of planishd. Empty: planishd beside the running executable, else in ../bin relative to it, else $PLANISHD,
  // else in PATH.
  std::string executable;
  int workers = 1;
  int threads = 0;  // per job; 0: the cores of this machine, divided by `workers`
  Seconds start_timeout{10};
  std::vector<std::string> extra_arguments;
};

// Runs planishd on a Unix socket that only this user can access. The server ends with this object, and also if this
// process ends in any way. Movable. Linux only; the rest of the library runs on any system.
class PrivateServer {
 public:
  // Returns once the server is ready. Throws planish::Error with PRIVATE_SERVER_FAILED if planishd is not found, or
  // exits or does not answer while it starts; the message ends with its stderr.
  explicit PrivateServer(const PrivateServerOptions& options = {});
  // The constructor without exceptions.
  static Result<PrivateServer> Make(const PrivateServerOptions& options = {});
  // The destructor stops the server (its jobs are cancelled), waits for it and removes the socket.
  PrivateServer(PrivateServer&&) = default;
  PrivateServer& operator=(PrivateServer&&) = default;

  // The address of the server, for planish::Client.
  const std::string& target() const;
  // Path and process id of the running planishd.
  const std::string& executable() const;
  int pid() const;
  // The directory of the socket. A program that ends by _exit must remove it itself.
  const std::string& directory() const;

  // What the server has written to stderr so far.
  std::string log() const;

 private:
  struct State;
  std::shared_ptr<State> state_;
};

// The path of the planishd that PrivateServer would start if the running executable were in `directory`; empty if none
// is found. If `directory` is empty, only $PLANISHD and PATH are searched.
std::string FindPlanishd(const std::string& directory);

}  // namespace planish::inline abi0
