// A planishd of one's own, for programs that must work without a server somewhere.
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "planish/error.h"

namespace planish::inline abi0 {

struct PrivateServerOptions {
  // Empty: planishd beside the running executable, else in ../bin from there, else $PLANISHD, else in PATH.
  std::string executable;
  int workers = 1;
  int threads = 0;  // that a job may use; 0: the cores of this machine, divided by `workers`
  Seconds start_timeout{10};
  std::vector<std::string> extra_arguments;
};

// Runs planishd on a Unix socket that only this user can reach. It ends with this object, and with this process
// however that ends. Movable. Linux only; the rest of the library is not bound to a system.
class PrivateServer {
 public:
  // Returns when the server serves. Throws planish::Error with PRIVATE_SERVER_FAILED if planishd is not found, or
  // dies or stays silent while it starts; the message ends with what it wrote to stderr.
  explicit PrivateServer(const PrivateServerOptions& options = {});
  // The same without exceptions.
  static Result<PrivateServer> Make(const PrivateServerOptions& options = {});
  // The destructor stops the server (its jobs are cancelled), waits for it and removes the socket.
  PrivateServer(PrivateServer&&) = default;
  PrivateServer& operator=(PrivateServer&&) = default;

  // For planish::Client.
  const std::string& target() const;
  // Path of the planishd that runs, and its process id.
  const std::string& executable() const;
  int pid() const;
  // The directory of the socket: for those who leave by _exit and must clean up themselves.
  const std::string& directory() const;

  // What it wrote to stderr so far.
  std::string log() const;

 private:
  struct State;
  std::shared_ptr<State> state_;
};

// The planishd that PrivateServer would start if the running executable were in `directory` (empty: nowhere); empty if
// there is none.
std::string FindPlanishd(const std::string& directory);

}  // namespace planish::inline abi0
