// grpc.reflection.v1alpha.ServerReflection, without credentials. We do not use gRPC's implementation, since it reads
// requests of any length.
#pragma once

#include <atomic>
#include <string>
#include <vector>

#include "server/rpc/call.h"

namespace planish {

// Describes the messages and services that are linked into this program.
class ReflectionService : public RpcService {
 public:
  // `services`: the names of the services that it lists, its own included.
  explicit ReflectionService(std::vector<std::string> services);

  const std::vector<Endpoint>& endpoints() const override { return endpoints_; }

 private:
  class Stream;

  const std::vector<std::string> services_;
  std::vector<Endpoint> endpoints_;
  std::atomic<int> streams_ = 0;
};

}  // namespace planish
