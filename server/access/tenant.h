// The limits of a tenant at a server.
#pragma once

#include <cstdint>
#include <functional>
#include <string>

namespace planish {

struct TenantLimits {
  // Share of the workers when several tenants want them, relative to the others' shares; > 0.
  double share = 1;
  // Waiting jobs; -1 (unset): the server's own limit.
  int queue = -1;
  // Concurrently running jobs; -1 (unset): as many as there are workers.
  int running = -1;
  // Memory that its running jobs may reserve together; -1 (unset): as much as the servers have.
  std::int64_t memory_bytes = -1;
  // Bytes of stored meshes and results; -1 (unset): as many as the store holds.
  std::int64_t store_bytes = -1;

  bool operator==(const TenantLimits&) const = default;
};

// Returns the limits of a tenant, the defaults if it is unknown. Thread-safe and quick. The answer may change, since
// access files are reloaded.
using TenantLimitsSource = std::function<TenantLimits(const std::string& tenant)>;

}  // namespace planish
