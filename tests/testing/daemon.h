// The real planishd as a child process.
#pragma once

#include <sys/types.h>

#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "tests/testing/process.h"

namespace planish {

// One run of it.
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
  pid_t pid() const { return process_->pid(); }
  bool IsRunning() { return process_->IsRunning(); }
  void Signal(int signal) const { process_->Signal(signal); }
  void CloseSupervisor();
  // Waits for its end; the exit code, or minus the signal that killed it.
  int Wait() { return process_->Wait().exit_code; }
  // Waits until it wrote `text`, or ended; all that it wrote so far.
  std::string ReadUntil(const std::string& text);
  // What it wrote to stderr and stdout; complete after Wait().
  std::string Output() const { return process_->Err(); }

 private:
  int supervisor_ = -1;
  std::unique_ptr<Process> process_;
};

// planishd with a data directory, that dies and comes back on the same address.
class DurableServer {
 public:
  // `directory` is empty or was left by another one. Starts it, and waits until it serves; throws std::runtime_error if
  // it does not.
  DurableServer(std::string directory, std::vector<std::string> flags);

  const std::string& target() const { return target_; }  // "unix:..."

  // Of its next life.
  void SetFlags(std::vector<std::string> flags) { flags_ = std::move(flags); }
  void Start();
  // kill -9, and waits for the end.
  void Kill();
  // SIGTERM; the exit code, or minus a signal.
  int Terminate();
  bool IsRunning() { return daemon_->IsRunning(); }

  // Processes that it started and that live.
  std::vector<pid_t> Workers() const;
  // Processes that it started and that are dead but not waited for.
  int Zombies() const;
  int Descriptors() const;
  std::int64_t ResidentBytes() const;
  // Files with meshes and results, and bytes of them.
  int BlobFiles() const;

  // What all its lives said to stderr.
  std::string Log() const { return past_log_ + daemon_->Output(); }

 private:
  const std::string directory_;
  std::vector<std::string> flags_;
  const std::string target_;
  std::unique_ptr<Daemon> daemon_;
  std::string past_log_;  // of lives before this one
};

}  // namespace planish
