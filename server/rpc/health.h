// grpc.health.v1.Health, without credentials. We do not use gRPC's implementation, since it reads requests of any
// length.
#pragma once

#include <map>
#include <memory>
#include <mutex>
#include <set>
#include <string>
#include <vector>

#include "server/rpc/call.h"

namespace planish {

// Tells callers the states that Set() has set. Thread-safe.
class HealthService : public RpcService {
 public:
  // As grpc.health.v1.HealthCheckResponse.ServingStatus.
  enum class Status { kServing = 1, kNotServing = 2, kServiceUnknown = 3 };

  // The service "" stands for the process, and is SERVING from the start.
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
  // Guarded by mutex_. Watchers are notified while it is held, so that each gets the changes in order.
  std::map<std::string, Status> statuses_;
  std::map<std::string, std::set<std::shared_ptr<Watch>>> watches_;
};

}  // namespace planish
