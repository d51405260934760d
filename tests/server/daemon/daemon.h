// planishd as a child process.
#pragma once

#include <sys/types.h>

#include <string>
#include <vector>

namespace planish {

class Daemon {
 public:
  // Runs planishd with `flags`; supervised by this object if `supervised`.
  Daemon(std::vector<std::string> flags, bool supervised);
  // Kills it if it still runs.
  ~Daemon();
  Daemon(const Daemon&) = delete;
  Daemon& operator=(const Daemon&) = delete;

  // Waits for "ready\n"; false if it ended instead. Needs `supervised`.
  bool WaitReady();
  void Signal(int signal) const;
  void CloseSupervisor();
  // Waits for its end; the exit code, or minus the signal that killed it.
  int Wait();
  // Waits until it wrote `text`, or ended; all that it wrote so far.
  std::string ReadUntil(const std::string& text);
  // What it wrote to stderr and stdout; complete after Wait().
  std::string Output();

 private:
  pid_t pid_ = -1;
  int supervisor_ = -1;
  int output_ = -1;
  std::string text_;
};

}  // namespace planish
