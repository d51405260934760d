// Where calls enter: each is admitted, or refused with nothing of it read.
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "grpcpp/generic/async_generic_service.h"
#include "grpcpp/impl/service_type.h"
#include "server/rpc/call.h"
#include "server/rpc/caller_source.h"

namespace planish {

// To gRPC every method is a stream of bytes in both directions: the only shape of which gRPC reads no message by
// itself. On the wire it is the same as any other shape.
class Entrance : public grpc::CallbackGenericService {
 public:
  // `callers` may be null if no endpoint needs credentials. All must outlive the Entrance, and it the server.
  Entrance(const CallerSource* callers, const CallSurroundings* surroundings)
      : callers_(callers), surroundings_(*surroundings) {}

  // gRPC's view of a service; reflection lists it.
  std::unique_ptr<grpc::Service> Open(const RpcService& service) const;

  // A method that this server does not have.
  grpc::ServerGenericBidiReactor* CreateReactor(grpc::GenericCallbackServerContext* context) override;

 private:
  grpc::ServerGenericBidiReactor* Enter(const Endpoint& endpoint, grpc::CallbackServerContext* context) const;
  absl::StatusOr<Caller> Admit(const Method& method, const grpc::CallbackServerContext& context) const;

  const CallerSource* const callers_;
  const CallSurroundings& surroundings_;
};

}  // namespace planish
