// grpc.reflection.v1alpha.ServerReflection, for anybody. gRPC's own reads a request of any length before it looks at
// it.
#pragma once

#include <atomic>
#include <string>
#include <vector>

#include "server/rpc/call.h"

namespace planish {

// Tells of the messages and services that this program was linked with.
class ReflectionService : public RpcService {
 public:
  // `services` are the names that it lists, its own included.
  explicit ReflectionService(std::vector<std::string> services);

  const std::vector<Endpoint>& endpoints() const override { return endpoints_; }

 private:
  class Stream;

  const std::vector<std::string> services_;
  std::vector<Endpoint> endpoints_;
  std::atomic<int> streams_ = 0;
};

}  // namespace planish
