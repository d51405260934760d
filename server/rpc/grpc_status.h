// The one place where an absl::Status becomes the answer to a call.
#pragma once

#include "absl/status/status.h"
#include "google/rpc/status.pb.h"
#include "grpcpp/support/status.h"

namespace planish {

// As a call answers with it: google.rpc.Status (server/link/rpc_status.h), to which an INVALID_ARGUMENT that names a
// field (metadata "field") adds a google.rpc.BadRequest. Cut to fit the 8 KiB that gRPC peers accept as metadata: a
// message longer than 1 KiB ends in "...", too large an ErrorInfo.metadata is left out. So are absolute paths, unless
// the error is about the request (INVALID_ARGUMENT), which its message may quote.
google::rpc::Status ToCallStatus(const absl::Status& status);

// Whether ToCallStatus() leaves paths out.
bool HidesPaths(const absl::Status& status);

// With ToCallStatus() as error details.
grpc::Status ToGrpcStatus(const absl::Status& status);

}  // namespace planish
