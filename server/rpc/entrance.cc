#include "server/rpc/entrance.h"

#include <utility>

#include "absl/strings/match.h"
#include "core/base/status_macros.h"
#include "grpcpp/impl/rpc_service_method.h"
#include "grpcpp/support/server_callback.h"
#include "server/rpc/grpc_status.h"
#include "server/rpc/trace_header.h"

namespace planish {
namespace {

using grpc::ByteBuffer;

// Prefix of the calls that are counted. Health checks and reflection are not.
constexpr char kOwnPackages[] = "/planish.";

class RefusedCall : public grpc::ServerGenericBidiReactor {
 public:
  explicit RefusedCall(grpc::Status status) { Finish(std::move(status)); }
  void OnDone() override { delete this; }
};

class ByteService : public grpc::Service {
 public:
  using Enter = std::function<grpc::ServerGenericBidiReactor*(const Endpoint&, grpc::CallbackServerContext*)>;

  ByteService(const std::vector<Endpoint>& endpoints, const Enter& enter) {
    paths_.reserve(endpoints.size());
    for (const Endpoint& endpoint : endpoints) {
      paths_.push_back(endpoint.method->path());
      AddMethod(new grpc::internal::RpcServiceMethod(paths_.back().c_str(), grpc::internal::RpcMethod::BIDI_STREAMING,
                                                     nullptr));
      MarkMethodCallback(
          static_cast<int>(paths_.size()) - 1,
          new grpc::internal::CallbackBidiHandler<ByteBuffer, ByteBuffer>(
              [enter, &endpoint](grpc::CallbackServerContext* context) { return enter(endpoint, context); }));
    }
  }

 private:
  std::vector<std::string> paths_;  // gRPC keeps pointers to them
};

}  // namespace

std::unique_ptr<grpc::Service> Entrance::Open(const RpcService& service) const {
  return std::make_unique<ByteService>(
      service.endpoints(),
      [this](const Endpoint& endpoint, grpc::CallbackServerContext* context) { return Enter(endpoint, context); });
}

grpc::ServerGenericBidiReactor* Entrance::CreateReactor(grpc::GenericCallbackServerContext* context) {
  if (absl::StartsWith(context->method(), kOwnPackages)) {
    TellCallEnd(surroundings_, nullptr, absl::UnimplementedError(""), absl::ZeroDuration());
  }
  return new RefusedCall(grpc::Status(grpc::StatusCode::UNIMPLEMENTED, ""));
}

grpc::ServerGenericBidiReactor* Entrance::Enter(const Endpoint& endpoint, grpc::CallbackServerContext* context) const {
  absl::StatusOr<Caller> caller = Admit(*endpoint.method, *context);
  if (!caller.ok()) {
    TellCallEnd(surroundings_, endpoint.method, caller.status(), absl::ZeroDuration());
    return new RefusedCall(ToGrpcStatus(caller.status()));
  }
  return Call::Begin(endpoint.make({endpoint.method, context, *std::move(caller), &surroundings_}));
}

absl::StatusOr<Caller> Entrance::Admit(const Method& method, const grpc::CallbackServerContext& context) const {
  if (method.need == Need::kNobody) return Caller();
  PLANISH_ASSIGN_OR_RETURN(Caller caller, callers_->Identify(context));
  PLANISH_RETURN_IF_ERROR(caller.CheckRight(method.need));
  caller.traceparent = TraceparentOf(context);
  return caller;
}

}  // namespace planish
