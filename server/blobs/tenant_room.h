// How much of the store each tenant uses, and how much it may.
#pragma once

#include <cstdint>
#include <map>
#include <string>
#include <utility>

#include "absl/status/status.h"
#include "server/access/tenant.h"

namespace planish {

// Sizes in bytes. Not thread-safe, but for max_bytes().
class TenantRoom {
 public:
  // The limits are `max_bytes` for all tenants together, and TenantLimits::store_bytes for each (null: no such limit).
  TenantRoom(std::int64_t max_bytes, TenantLimitsSource limits) : max_bytes_(max_bytes), limits_(std::move(limits)) {}

  std::int64_t max_bytes() const { return max_bytes_; }
  std::int64_t bytes() const { return bytes_; }
  std::int64_t bytes(const std::string& tenant) const;

  // `bytes` may be negative.
  void Count(const std::string& tenant, std::int64_t bytes);

  // Whether the tenant may have so many more: RESOURCE_EXHAUSTED with STORAGE_FULL. The message tells nothing about
  // other tenants.
  absl::Status Check(const std::string& tenant, std::int64_t more) const;

  // The tenant whose bytes must go before `tenant` can have `more`. That is `tenant` itself, unless the store is full
  // and `tenant` would stay within an equal part of it; then it is the tenant with most bytes.
  std::string WhoGivesWay(const std::string& tenant, std::int64_t more) const;

 private:
  // -1: none.
  std::int64_t LimitOf(const std::string& tenant) const;

  const std::int64_t max_bytes_;
  const TenantLimitsSource limits_;
  std::int64_t bytes_ = 0;
  std::map<std::string, std::int64_t> tenant_bytes_;  // of tenants with any
};

}  // namespace planish
