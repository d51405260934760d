// The worker's end of a process link.
#pragma once

#include <memory>

#include "server/link/blob.h"
#include "server/link/worker_link.h"

namespace planish {

// Makes the worker's end of a link over `socket`, whose other end belongs to StartProcessWorker(). A malformed message
// from the server closes the link.
absl::StatusOr<std::unique_ptr<ServerLink>> ConnectToServer(Descriptor socket);

// A message as the bytes of a whole frame: prepared in advance by a worker that may be unable to allocate memory when
// it has to send it.
std::string ToFrame(const worker::v1::FromWorker& message);

}  // namespace planish
