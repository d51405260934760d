// Of the private server: what its tests and the command use as well.
#pragma once

#include <string>
#include <utility>

namespace planish {

// A file descriptor that is closed with its owner. Movable.
class OwnedFd {
 public:
  explicit OwnedFd(int fd = -1) : fd_(fd) {}
  ~OwnedFd() { Reset(); }
  OwnedFd(OwnedFd&& other) noexcept : fd_(std::exchange(other.fd_, -1)) {}
  OwnedFd& operator=(OwnedFd&& other) noexcept {
    std::swap(fd_, other.fd_);
    return *this;
  }

  int get() const { return fd_; }
  void Reset();

 private:
  int fd_;
};

// Whether `path` is a file that we may run.
bool IsExecutable(const std::string& path);

// planishd in `directory` (unless empty), else in its ../bin, else $PLANISHD, else in PATH; empty if there is none.
std::string FindPlanishd(const std::string& directory);

}  // namespace planish
