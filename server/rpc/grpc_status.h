// The one place where an absl::Status becomes a grpc::Status.
#pragma once

#include "absl/status/status.h"
#include "grpcpp/support/status.h"

namespace planish {

// With google.rpc.Status (server/link/rpc_status.h) as error details. Cut to fit the 8 KiB that gRPC peers accept as
// metadata: a message longer than 1 KiB ends in "...", too large an ErrorInfo.metadata is left out.
grpc::Status ToGrpcStatus(const absl::Status& status);

}  // namespace planish
