// The stream of WriteUpload.
#pragma once

#include <cstdint>

#include "absl/status/statusor.h"
#include "grpcpp/support/server_callback.h"
#include "planish/v1/planish.pb.h"
#include "server/access/caller.h"
#include "server/jobs/upload_store.h"
#include "server/rpc/stream_counter.h"
#include "server/rpc/task_threads.h"

namespace planish {

// Takes message after message in on one of the `tasks` threads, and asks gRPC for the next one only then: a sender is
// never faster than the disk. Answers with the error of `caller` if there is one, else with the upload as it is at the
// end, or with UNAVAILABLE after InterruptSenders(). The reactor belongs to gRPC; the rest outlives it.
grpc::ServerReadReactor<v1::WriteUploadRequest>* ReceiveUpload(const absl::StatusOr<Caller>& caller,
                                                               UploadStore* uploads, std::int64_t max_chunk_bytes,
                                                               TaskThreads* tasks, StreamCounter* streams,
                                                               v1::Upload* response);

}  // namespace planish
