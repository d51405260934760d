// A worker: what runs at the far end of a link.
#pragma once

#include <functional>

#include "planish/worker/v1/worker.pb.h"
#include "server/link/worker_link.h"

namespace planish {

struct WorkerSettings {
  // The process does nothing but this: it holds to WorkRequest.memory_bytes and tells how much memory it has.
  bool owns_process = false;
  bool failpoints = false;             // WorkRequest.failpoint is obeyed
  std::function<void()> send_garbage;  // for the failpoint of that name
  worker::v1::WorkerIdle idle;         // what it says when it is idle, beside its memory
};

// Serves jobs over `server`, one after the other, until the link closes: says that it is idle, waits for a WorkRequest,
// sends events and the result, hands back the memory. A CancelRequest or a closed link interrupts the work under way.
void ServeJobs(ServerLink& server, const WorkerSettings& settings);

// The same on a thread of a process that does other things too.
void RunWorker(ServerLink& server);

}  // namespace planish
