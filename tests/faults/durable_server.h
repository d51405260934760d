// planishd with a data directory, that dies and comes back on the same address.
#pragma once

#include <sys/types.h>

#include <cstdint>
#include <string>
#include <utility>
#include <vector>

#include "client/src/process.h"

namespace planish {

class DurableServer {
 public:
  // `directory` is empty or was left by another one. Starts it, and waits until it serves; throws std::runtime_error if
  // it does not.
  DurableServer(std::string directory, std::vector<std::string> flags);
  // Kills it if it runs.
  ~DurableServer();
  DurableServer(const DurableServer&) = delete;
  DurableServer& operator=(const DurableServer&) = delete;

  const std::string& target() const { return target_; }  // "unix:..."

  // Of its next life.
  void SetFlags(std::vector<std::string> flags) { flags_ = std::move(flags); }
  void Start();
  // kill -9, and waits for the end.
  void Kill();
  // SIGTERM; the exit code, or minus a signal.
  int Terminate();
  bool IsRunning();

  // Processes that it started and that live.
  std::vector<pid_t> Workers() const;
  // Processes that it started and that are dead but not waited for.
  int Zombies() const;
  int Descriptors() const;
  std::int64_t ResidentBytes() const;
  // Files with meshes and results, and bytes of them.
  int BlobFiles() const;

  // What all its lives said to stderr.
  std::string Log() const;

 private:
  int Reap();

  const std::string directory_;
  std::vector<std::string> flags_;
  const std::string target_;
  pid_t pid_ = -1;
  OwnedFd supervisor_;  // it ends when this closes
};

}  // namespace planish
