#include "server/rpc/call_observer.h"

#include <utility>

#include "absl/strings/match.h"
#include "absl/time/clock.h"
#include "google/rpc/status.pb.h"
#include "server/link/rpc_status.h"

namespace planish {
namespace {

using grpc::experimental::InterceptionHookPoints;
using grpc::experimental::Interceptor;
using grpc::experimental::InterceptorBatchMethods;
using grpc::experimental::ServerRpcInfo;

// Health checks and reflection are not this server's work.
constexpr char kOwnPackages[] = "/planish.";

class CallWatcher : public Interceptor {
 public:
  CallWatcher(const ServerRpcInfo& info, const CallListener* listener) : listener_(*listener) {
    const std::string method = info.method();
    if (absl::StartsWith(method, kOwnPackages)) call_ = method.substr(method.rfind('/') + 1);
  }

  void Intercept(InterceptorBatchMethods* methods) override {
    if (!call_.empty() && methods->QueryInterceptionHookPoint(InterceptionHookPoints::PRE_SEND_STATUS)) {
      Tell(methods->GetSendStatus());
    }
    methods->Proceed();
  }

 private:
  void Tell(const grpc::Status& status) const {
    EndedCall ended;
    ended.call = call_;
    ended.code = static_cast<absl::StatusCode>(status.error_code());
    ended.duration = absl::Now() - start_;
    google::rpc::Status details;
    if (!status.ok() && details.ParseFromString(status.error_details())) ended.reason = ReasonOf(details);
    listener_(ended);
  }

  const CallListener& listener_;
  std::string call_;  // empty: of no interest
  const absl::Time start_ = absl::Now();
};

class CallWatcherFactory : public grpc::experimental::ServerInterceptorFactoryInterface {
 public:
  explicit CallWatcherFactory(CallListener listener) : listener_(std::move(listener)) {}
  Interceptor* CreateServerInterceptor(ServerRpcInfo* info) override { return new CallWatcher(*info, &listener_); }

 private:
  const CallListener listener_;
};

}  // namespace

std::vector<std::unique_ptr<grpc::experimental::ServerInterceptorFactoryInterface>> ListenToCalls(
    CallListener listener) {
  std::vector<std::unique_ptr<grpc::experimental::ServerInterceptorFactoryInterface>> factories;
  factories.push_back(std::make_unique<CallWatcherFactory>(std::move(listener)));
  return factories;
}

}  // namespace planish
