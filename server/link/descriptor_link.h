// The worker's end of a process link.
#pragma once

#include <memory>

#include "server/link/blob.h"
#include "server/link/worker_link.h"

namespace planish {

// Over `socket`, whose other end belongs to StartProcessWorker(). A message from there that is not as it should be
// closes the link.
absl::StatusOr<std::unique_ptr<ServerLink>> ConnectToServer(Descriptor socket);

// A message as the bytes of a whole frame, for a worker that can no longer allocate any when it has to send it.
std::string ToFrame(const worker::v1::FromWorker& message);

}  // namespace planish
