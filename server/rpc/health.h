// grpc.health.v1.Health, for anybody. gRPC's own reads a request of any length before it looks at it.
#pragma once

#include <map>
#include <memory>
#include <mutex>
#include <set>
#include <string>
#include <vector>

#include "server/rpc/call.h"

namespace planish {

// Thread-safe.
class HealthService : public RpcService {
 public:
  // As grpc.health.v1.HealthCheckResponse.ServingStatus.
  enum class Status { kServing = 1, kNotServing = 2, kServiceUnknown = 3 };

  // The service "", which means the process, is serving from the start.
  HealthService();

  void Set(const std::string& service, bool is_serving);

  const std::vector<Endpoint>& endpoints() const override { return endpoints_; }

 private:
  class Check;
  class Watch;

  Status Find(const std::string& service);
  void Add(const std::string& service, const std::shared_ptr<Watch>& watch);
  void Remove(const std::string& service, const std::shared_ptr<Watch>& watch);

  std::vector<Endpoint> endpoints_;

  std::mutex mutex_;
  // Guarded by mutex_; they are told under it, so that each hears of the changes in their order.
  std::map<std::string, Status> statuses_;
  std::map<std::string, std::set<std::shared_ptr<Watch>>> watches_;
};

}  // namespace planish
