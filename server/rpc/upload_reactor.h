// The stream of WriteUpload.
#pragma once

#include <cstdint>
#include <memory>

#include "server/jobs/upload_store.h"
#include "server/rpc/call.h"
#include "server/rpc/stream_counter.h"
#include "server/rpc/task_threads.h"

namespace planish {

// Takes message after message in on one of the `tasks` threads, and asks gRPC for the next one only then: a sender is
// never faster than the disk. Answers with the upload as it is at the end, or with UNAVAILABLE after
// InterruptSenders(). All outlive the call.
std::shared_ptr<Call> ReceiveUpload(CallInfo info, UploadStore* uploads, std::int64_t max_chunk_bytes,
                                    TaskThreads* tasks, StreamCounter* streams);

}  // namespace planish
