// Tells how each call to this server's own services ended, wherever in the server that was decided.
#pragma once

#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "absl/status/status.h"
#include "absl/time/time.h"
#include "grpcpp/support/server_interceptor.h"

namespace planish {

struct EndedCall {
  std::string call;  // the method's name, e.g. "CreateJob"
  absl::StatusCode code = absl::StatusCode::kOk;
  std::string reason;  // in the ErrorInfo of its error; empty: none
  absl::Duration duration;
};

// Called on gRPC's threads and those of handlers: must be quick and thread-safe.
using CallListener = std::function<void(const EndedCall&)>;

// For ServerBuilder::experimental().SetInterceptorCreators().
std::vector<std::unique_ptr<grpc::experimental::ServerInterceptorFactoryInterface>> ListenToCalls(
    CallListener listener);

}  // namespace planish
