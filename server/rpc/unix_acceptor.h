// Unix sockets whose callers are known by their user.
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
  // A socket file at `path` with these permissions; nobody gets in before it has them. Nobody may be listening there:
  // see RemoveStaleSocket(). UNAVAILABLE with the system's reason.
  static absl::StatusOr<std::unique_ptr<UnixListener>> Open(const std::string& path, mode_t mode);
  ~UnixListener();
  UnixListener(const UnixListener&) = delete;
  UnixListener& operator=(const UnixListener&) = delete;

  int fd() const { return fd_; }

 private:
  explicit UnixListener(int fd) : fd_(fd) {}

  const int fd_;
};

// Takes connections on a thread of its own.
class UnixAcceptor {
 public:
  // `take` gets every connection, non-blocking, and owns it. Where it cannot be had (descriptors run out, say) the next
  // attempt comes a little later.
  UnixAcceptor(std::vector<std::unique_ptr<UnixListener>> listeners, std::function<void(int fd)> take);
  // Stops; no connection is taken any more.
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
