// A worker in its own process.
#pragma once

#include <string>
#include <string_view>

#include "core/base/program_path.h"
#include "server/link/worker_arguments.h"
#include "server/link/worker_link.h"

namespace planish {

struct WorkerProcessOptions {
  std::string program = SelfToExecute();  // must begin with RunIfWorker() (server/worker_main.h)
  SandboxMode sandbox = SandboxMode::kAuto;
  bool failpoints = false;
  // The stderr of a worker once it is ready; the caller keeps ownership. -1: the stderr of this process. Output from
  // before the worker is ready becomes part of WorkerLink::HowEnded() if the start fails, and is then written there
  // too.
  int stderr_fd = -1;
};

// Starts a worker process. Messages pass as frames over a socket pair (frame_socket.h), blobs as descriptors; nothing
// the worker sends is trusted. The process is killed when its link is closed, when this process dies, and when the
// thread that started it ends, so that thread must outlive the link. The process inherits no other descriptors, gets no
// signals from the terminal, and sees only the environment variables that libraries need (IsForWorkers()), since
// variables like PLANISHD_* may hold secrets.
//
// A malformed message or blob closes the link; HowEnded() says so. RESOURCE_EXHAUSTED with OUT_OF_MEMORY if there are
// no descriptors, processes or memory left, INTERNAL if `program` cannot be started.
absl::StatusOr<std::shared_ptr<WorkerLink>> StartProcessWorker(const WorkerProcessOptions& options);

// Whether a worker gets the variable `name` of its server's environment.
bool IsForWorkers(std::string_view name);

}  // namespace planish
