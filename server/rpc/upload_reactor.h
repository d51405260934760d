// The stream of WriteUpload.
#pragma once

#include <cstdint>
#include <memory>

#include "server/jobs/upload_store.h"
#include "server/rpc/call.h"
#include "server/rpc/stream_counter.h"
#include "server/rpc/task_threads.h"

namespace planish {

// Adds each message to the upload on one of the threads of `tasks`, and reads the next message only after that, so that
// the sender cannot be faster than the disk. Answers with the state of the upload at the end, or with UNAVAILABLE after
// InterruptSenders(). The arguments outlive the call.
std::shared_ptr<Call> ReceiveUpload(CallInfo info, UploadStore* uploads, std::int64_t max_chunk_bytes,
                                    TaskThreads* tasks, StreamCounter* streams);

}  // namespace planish
