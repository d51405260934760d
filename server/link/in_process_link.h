// A worker on a thread of this process.
#pragma once

#include <functional>
#include <memory>

#include "server/link/worker_link.h"

namespace planish {

// Runs `worker` on a new thread. When it returns or throws, the link closes. A thread cannot be killed: Close() only
// closes the link, and the worker should notice. Destroying the link closes it and waits for `worker` to return, so
// `worker` must return when the link is closed.
absl::StatusOr<std::shared_ptr<WorkerLink>> StartInProcessWorker(std::function<void(ServerLink&)> worker);

}  // namespace planish
