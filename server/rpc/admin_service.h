// The service planish.admin.v1.Admin.
#pragma once

#include <functional>
#include <memory>

#include "absl/status/status.h"
#include "planish/admin/v1/admin.pb.h"
#include "server/rpc/call.h"

namespace planish {

// What the calls do, once the caller's rights are known; contracts in proto/planish/admin/v1/admin.proto. One at a
// time.
struct AdminActions {
  std::function<absl::Status()> drain;
  std::function<absl::Status()> undrain;
  std::function<admin::v1::Stats()> stats;
  std::function<admin::v1::Config()> config;
};

std::unique_ptr<RpcService> NewAdminService(AdminActions actions);

}  // namespace planish
