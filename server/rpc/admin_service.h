// The service planish.admin.v1.Admin.
#pragma once

#include <functional>
#include <memory>

#include "absl/status/status.h"
#include "grpcpp/impl/service_type.h"
#include "planish/admin/v1/admin.pb.h"
#include "server/rpc/caller_source.h"

namespace planish {

// What the calls do, once the caller's rights are known; contracts in proto/planish/admin/v1/admin.proto. One at a
// time.
struct AdminActions {
  std::function<absl::Status()> drain;
  std::function<absl::Status()> undrain;
  std::function<admin::v1::Stats()> stats;
  std::function<admin::v1::Config()> config;
};

// `callers` must outlive the service, and it must outlive the RpcServer's Shutdown().
std::unique_ptr<grpc::Service> NewAdminService(AdminActions actions, const CallerSource* callers);

}  // namespace planish
