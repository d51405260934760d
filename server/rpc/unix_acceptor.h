// Accepts connections to Unix sockets, so that the user of each can be found.
#pragma once

#include <sys/types.h>

#include <functional>
#include <memory>
#include <string>
#include <thread>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"

namespace planish {

// A listening Unix socket, closed with this object; SocketFile removes its file.
class UnixListener {
 public:
  // Listens on a socket file at `path`. The file has the mode `mode` before the first connection is accepted. No server
  // may be listening there: see RemoveStaleSocket(). UNAVAILABLE with the system's reason.
  static absl::StatusOr<std::unique_ptr<UnixListener>> Open(const std::string& path, mode_t mode);
  ~UnixListener();
  UnixListener(const UnixListener&) = delete;
  UnixListener& operator=(const UnixListener&) = delete;

  int fd() const { return fd_; }

 private:
  explicit UnixListener(int fd) : fd_(fd) {}

  const int fd_;
};

// Accepts connections on its own thread.
class UnixAcceptor {
 public:
  // `take` gets every connection as a non-blocking descriptor, which it then owns. If accepting fails (for want of
  // descriptors, say), it is tried again a little later.
  UnixAcceptor(std::vector<std::unique_ptr<UnixListener>> listeners, std::function<void(int fd)> take);
  // Stops accepting.
  ~UnixAcceptor();
  UnixAcceptor(const UnixAcceptor&) = delete;
  UnixAcceptor& operator=(const UnixAcceptor&) = delete;

 private:
  void Run();

  const std::vector<std::unique_ptr<UnixListener>> listeners_;
  const std::function<void(int fd)> take_;
  int stop_;  // an event that ends Run()
  std::thread thread_;
};

}  // namespace planish
