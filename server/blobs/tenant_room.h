// How much of the store each tenant uses and may use.
#pragma once

#include <cstdint>
#include <map>
#include <string>
#include <utility>

#include "absl/status/status.h"
#include "server/access/tenant.h"

namespace planish {

// Counts the bytes that each tenant stores, and applies the limits on them. Not thread-safe, except for max_bytes().
class TenantRoom {
 public:
  // `max_bytes` limits all tenants together, TenantLimits::store_bytes each one (null: no such limit).
  TenantRoom(std::int64_t max_bytes, TenantLimitsSource limits) : max_bytes_(max_bytes), limits_(std::move(limits)) {}

  std::int64_t max_bytes() const { return max_bytes_; }
  std::int64_t bytes() const { return bytes_; }
  std::int64_t bytes(const std::string& tenant) const;

  // Adds `bytes`, which may be negative, to those of the tenant.
  void Count(const std::string& tenant, std::int64_t bytes);

  // OK if the tenant may store `more` bytes; otherwise RESOURCE_EXHAUSTED with STORAGE_FULL. The message reveals
  // nothing about other tenants.
  absl::Status Check(const std::string& tenant, std::int64_t more) const;

  // The tenant whose bytes must be removed so that `tenant` can have `more`: `tenant` itself, unless the store is full
  // and `tenant` would stay within an equal part of it; then it is the tenant with the most bytes.
  std::string WhoGivesWay(const std::string& tenant, std::int64_t more) const;

 private:
  // The tenant's own limit; -1 if it has none.
  std::int64_t LimitOf(const std::string& tenant) const;

  const std::int64_t max_bytes_;
  const TenantLimitsSource limits_;
  std::int64_t bytes_ = 0;
  std::map<std::string, std::int64_t> tenant_bytes_;  // by tenant, without zeros
};

}  // namespace planish
