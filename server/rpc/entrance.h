// The entrance of all calls: admits or refuses each one before any of its messages is read.
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "grpcpp/generic/async_generic_service.h"
#include "grpcpp/impl/service_type.h"
#include "server/rpc/call.h"
#include "server/rpc/caller_source.h"

namespace planish {

// gRPC sees every method as a stream of bytes in both directions, the only kind of method for which it reads no message
// by itself. On the wire all kinds are the same.
class Entrance : public grpc::CallbackGenericService {
 public:
  // `callers` may be null if no endpoint needs credentials. `callers` and `surroundings` must outlive the Entrance,
  // which must outlive the server.
  Entrance(const CallerSource* callers, const CallSurroundings* surroundings)
      : callers_(callers), surroundings_(*surroundings) {}

  // Makes the gRPC service for `service`; reflection lists it.
  std::unique_ptr<grpc::Service> Open(const RpcService& service) const;

  // Handles calls of methods that this server does not have.
  grpc::ServerGenericBidiReactor* CreateReactor(grpc::GenericCallbackServerContext* context) override;

 private:
  grpc::ServerGenericBidiReactor* Enter(const Endpoint& endpoint, grpc::CallbackServerContext* context) const;
  absl::StatusOr<Caller> Admit(const Method& method, const grpc::CallbackServerContext& context) const;

  const CallerSource* const callers_;
  const CallSurroundings& surroundings_;
};

}  // namespace planish
