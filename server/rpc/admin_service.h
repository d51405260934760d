// The service planish.admin.v1.Admin.
#pragma once

#include <functional>
#include <memory>

#include "absl/status/status.h"
#include "planish/admin/v1/admin.pb.h"
#include "server/rpc/call.h"

namespace planish {

// The actions of the calls, after the caller's rights were checked; proto/planish/admin/v1/admin.proto has their
// contracts. Called one at a time.
struct AdminActions {
  std::function<absl::Status()> drain;
  std::function<absl::Status()> undrain;
  std::function<admin::v1::Stats()> stats;
  std::function<admin::v1::Config()> config;
};

std::unique_ptr<RpcService> NewAdminService(AdminActions actions);

}  // namespace planish
