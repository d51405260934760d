// Converts absl::Status to the error of a call. No other code does.
#pragma once

#include "absl/status/status.h"
#include "google/rpc/status.pb.h"
#include "grpcpp/support/status.h"

namespace planish {

// The google.rpc.Status that a call answers with (server/link/rpc_status.h). An INVALID_ARGUMENT that names a field
// (metadata "field") also gets a google.rpc.BadRequest. The status is cut to fit the 8 KiB that gRPC peers accept as
// metadata: a message longer than 1 KiB ends in "...", and too large an ErrorInfo.metadata is left out. Absolute paths
// are left out too, unless the error is INVALID_ARGUMENT, whose message may quote the request.
google::rpc::Status ToCallStatus(const absl::Status& status);

// Whether ToCallStatus() leaves paths out.
bool HidesPaths(const absl::Status& status);

// The gRPC status, with ToCallStatus() as error details.
grpc::Status ToGrpcStatus(const absl::Status& status);

}  // namespace planish
