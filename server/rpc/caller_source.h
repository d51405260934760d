// Who makes a call over gRPC.
#pragma once

#include <memory>

#include "absl/status/statusor.h"
#include "grpcpp/server_context.h"
#include "server/access/caller.h"

namespace planish {

// Thread-safe.
class CallerSource {
 public:
  virtual ~CallerSource() = default;

  // UNAUTHENTICATED with CREDENTIALS_MISSING, CREDENTIALS_INVALID or CREDENTIALS_EXPIRED. Quick: it runs once a call.
  virtual absl::StatusOr<Caller> Identify(const grpc::CallbackServerContext& context) const = 0;
};

// Takes everybody for the default tenant, with all rights.
std::unique_ptr<CallerSource> NewOpenCallerSource();

}  // namespace planish
