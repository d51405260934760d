// A worker in a process of its own.
#pragma once

#include <string>
#include <string_view>

#include "core/base/program_path.h"
#include "server/link/worker_arguments.h"
#include "server/link/worker_link.h"

namespace planish {

struct WorkerProcessOptions {
  std::string program = SelfToExecute();  // calls RunIfWorker() first of all (server/worker_main.h)
  SandboxMode sandbox = SandboxMode::kAuto;
  bool failpoints = false;
  // What a worker that is ready writes to; stays the caller's. -1: the stderr of this process. What a worker writes
  // before it is ready becomes part of WorkerLink::HowEnded(), its last words, and is passed on then.
  int stderr_fd = -1;
};

// Starts a worker process. Messages pass as frames over a socket pair (frame_socket.h), blobs as descriptors; nothing
// the worker sends is trusted. The process dies at once with its link, with this process, and with the thread that
// started it: that thread must outlive the link. It inherits no other descriptor, no signal of a terminal, and of the
// environment only what libraries need (IsForWorkers()): variables like PLANISHD_* may hold secrets.
//
// A message or blob that is not what it should be closes the link; HowEnded() says so. RESOURCE_EXHAUSTED with
// OUT_OF_MEMORY if there are no descriptors, processes or memory left, INTERNAL if `program` cannot be started.
absl::StatusOr<std::shared_ptr<WorkerLink>> StartProcessWorker(const WorkerProcessOptions& options);

// Whether a worker gets the variable `name` of its server's environment.
bool IsForWorkers(std::string_view name);

}  // namespace planish
