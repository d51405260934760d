// The hidden command line by which planishd starts itself as a worker.
#pragma once

#include <optional>
#include <string>
#include <vector>

namespace planish {

// Whether a worker closes its sandbox, which takes away files, the network and everything else that it does not need
// (server/worker/sandbox.h).
enum class SandboxMode {
  kAuto,     // closes it if the kernel supports that
  kRequire,  // does not start if the kernel does not support it
  kOff,
};

struct WorkerArguments {
  int fd = -1;  // the worker's end of the link
  // The worker's stderr once it is ready. Until then its stderr is a file that the server reads if the start fails. -1:
  // stderr does not change.
  int stderr_fd = -1;
  SandboxMode sandbox = SandboxMode::kAuto;
  bool failpoints = false;  // WorkRequest.failpoint is obeyed
};

// "--worker-fd=3" and so on.
std::vector<std::string> ToCommandLine(const WorkerArguments& arguments);

// Nullopt if this is not the command line of a worker, which begins with --worker-fd.
std::optional<WorkerArguments> ParseWorkerArguments(int argc, const char* const* argv);

// "auto", "require", "off".
const char* NameOf(SandboxMode mode);

}  // namespace planish
