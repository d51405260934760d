// A child process, started and ended with care.
#pragma once

#include <sys/types.h>

#include <string>
#include <vector>

namespace planish {

// A file descriptor that is closed with its owner. Movable.
class OwnedFd {
 public:
  explicit OwnedFd(int fd = -1) : fd_(fd) {}
  ~OwnedFd() { Reset(); }
  OwnedFd(OwnedFd&& other) noexcept : fd_(other.Release()) {}
  OwnedFd& operator=(OwnedFd&& other) noexcept;

  int get() const { return fd_; }
  int Release();
  void Reset();

 private:
  int fd_;
};

// Starts `arguments[0]`, a path, in a process group of its own (so that Ctrl-C reaches only us), with an empty
// signal mask, default signal actions, no input, no output, stderr to `stderr_fd`, `inherited_fd` as descriptor
// `inherited_as`, and the environment without what is for a service (PLANISHD_QUEUE, ...). Throws std::system_error.
pid_t Spawn(const std::vector<std::string>& arguments, int stderr_fd, int inherited_fd, int inherited_as);

// Waits for the end of a child and reaps it; false if it still runs after so many seconds.
bool ReapWithin(pid_t pid, double seconds, int* wait_status = nullptr);

// Everything in a memory file or regular file, from its beginning.
std::string ReadAll(int fd);

// Whether `path` is a file that we may run.
bool IsExecutable(const std::string& path);

}  // namespace planish
