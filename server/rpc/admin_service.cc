#include "server/rpc/admin_service.h"

#include <utility>

#include "core/base/status_macros.h"
#include "planish/admin/v1/admin.grpc.pb.h"
#include "server/rpc/grpc_status.h"
#include "server/rpc/task_threads.h"

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

class AdminService : public admin::v1::Admin::CallbackService {
 public:
  AdminService(AdminActions actions, const CallerSource* callers) : actions_(std::move(actions)), callers_(callers) {}

  grpc::ServerUnaryReactor* Drain(grpc::CallbackServerContext* context, const DrainRequest*, DrainResponse*) override {
    return Answer(context, actions_.drain);
  }

  grpc::ServerUnaryReactor* Undrain(grpc::CallbackServerContext* context, const UndrainRequest*,
                                    UndrainResponse*) override {
    return Answer(context, actions_.undrain);
  }

  grpc::ServerUnaryReactor* GetStats(grpc::CallbackServerContext* context, const GetStatsRequest*,
                                     Stats* response) override {
    return Answer(context, [this, response] {
      *response = actions_.stats();
      return absl::OkStatus();
    });
  }

  grpc::ServerUnaryReactor* GetConfig(grpc::CallbackServerContext* context, const GetConfigRequest*,
                                      Config* response) override {
    return Answer(context, [this, response] {
      *response = actions_.config();
      return absl::OkStatus();
    });
  }

 private:
  absl::Status Admit(const grpc::CallbackServerContext& context) const {
    PLANISH_ASSIGN_OR_RETURN(const Caller caller, callers_->Identify(context));
    return caller.CheckRight(Need::kAdmin);
  }

  grpc::ServerUnaryReactor* Answer(grpc::CallbackServerContext* context, std::function<absl::Status()> act) {
    grpc::ServerUnaryReactor* reactor = context->DefaultReactor();
    thread_.Post("", [this, context, reactor, act = std::move(act)] {
      const absl::Status admitted = Admit(*context);
      reactor->Finish(ToGrpcStatus(admitted.ok() ? act() : admitted));
    });
    return reactor;
  }

  const AdminActions actions_;
  const CallerSource* const callers_;
  TaskThreads thread_{1};
};

}  // namespace

std::unique_ptr<grpc::Service> NewAdminService(AdminActions actions, const CallerSource* callers) {
  return std::make_unique<AdminService>(std::move(actions), callers);
}

}  // namespace planish
