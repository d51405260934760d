// What a tenant may take of a server.
#pragma once

#include <cstdint>
#include <functional>
#include <string>

namespace planish {

struct TenantLimits {
  // Of the workers where several tenants want them, relative to the others' shares; > 0.
  double share = 1;
  // Jobs that may wait; unset (-1): as many as the server's own limit says.
  int queue = -1;
  // Jobs that may run at a time; unset (-1): as many as there are workers.
  int running = -1;
  // Memory that its running jobs may reserve together; unset (-1): as much as the servers have.
  std::int64_t memory_bytes = -1;
  // Bytes of meshes and results kept for it; unset (-1): as many as the store takes.
  std::int64_t store_bytes = -1;

  bool operator==(const TenantLimits&) const = default;
};

// Thread-safe, quick, and may answer otherwise later: access files are reloaded. Unknown tenants get the defaults.
using TenantLimitsSource = std::function<TenantLimits(const std::string& tenant)>;

}  // namespace planish
