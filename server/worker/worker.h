// A worker: the code at the worker's end of a link.
#pragma once

#include <functional>

#include "planish/worker/v1/worker.pb.h"
#include "server/link/worker_link.h"

namespace planish {

struct WorkerSettings {
  // The process only serves jobs, so the worker enforces WorkRequest.memory_bytes and reports the process's memory.
  bool owns_process = false;
  bool failpoints = false;             // WorkRequest.failpoint is obeyed
  std::function<void()> send_garbage;  // for the failpoint "garbage"
  worker::v1::WorkerIdle idle;         // the message that it sends when it is idle; ServeJobs() sets held_bytes
};

// Serves jobs over `server`, one after the other, until the link closes: says that it is idle, waits for a WorkRequest,
// sends events and the result, frees the memory. A CancelRequest or a closed link interrupts the running job.
void ServeJobs(ServerLink& server, const WorkerSettings& settings);

// ServeJobs() on a thread of a process that does other things too.
void RunWorker(ServerLink& server);

}  // namespace planish
