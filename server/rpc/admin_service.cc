#include "server/rpc/admin_service.h"

#include <utility>

#include "absl/strings/str_cat.h"
#include "core/base/status_macros.h"
#include "server/rpc/task_threads.h"
#include "server/rpc/unary_call.h"

namespace planish {
namespace {

using admin::v1::Config;
using admin::v1::DrainRequest;
using admin::v1::DrainResponse;
using admin::v1::GetConfigRequest;
using admin::v1::GetStatsRequest;
using admin::v1::Stats;
using admin::v1::UndrainRequest;
using admin::v1::UndrainResponse;

class AdminService : public RpcService {
 public:
  explicit AdminService(AdminActions actions) : actions_(std::move(actions)) {
    Add<DrainRequest, DrainResponse>("Drain", [this]() -> absl::StatusOr<DrainResponse> {
      PLANISH_RETURN_IF_ERROR(actions_.drain());
      return DrainResponse();
    });
    Add<UndrainRequest, UndrainResponse>("Undrain", [this]() -> absl::StatusOr<UndrainResponse> {
      PLANISH_RETURN_IF_ERROR(actions_.undrain());
      return UndrainResponse();
    });
    Add<GetStatsRequest, Stats>("GetStats", [this]() -> absl::StatusOr<Stats> { return actions_.stats(); });
    Add<GetConfigRequest, Config>("GetConfig", [this]() -> absl::StatusOr<Config> { return actions_.config(); });
  }

  const std::vector<Endpoint>& endpoints() const override { return endpoints_; }

 private:
  template <class Request, class Response>
  void Add(const std::string& name, std::function<absl::StatusOr<Response>()> act) {
    endpoints_.push_back(
        {&MethodAt(absl::StrCat("/planish.admin.v1.Admin/", name)),
         MakeUnaryCalls(&thread_, ParsedUnary<Request, Response>(
                                      [act = std::move(act)](const CallInfo&, Request*) { return act(); }))});
  }

  const AdminActions actions_;
  std::vector<Endpoint> endpoints_;
  TaskThreads thread_{1};
};

}  // namespace

std::unique_ptr<RpcService> NewAdminService(AdminActions actions) {
  return std::make_unique<AdminService>(std::move(actions));
}

}  // namespace planish
