#include "server/blobs/tenant_room.h"

#include <algorithm>
#include <utility>

#include "absl/strings/str_cat.h"
#include "core/base/error.h"

namespace planish {
namespace {

absl::Status StorageFull(const std::string& message) {
  return MakeError(absl::StatusCode::kResourceExhausted, "STORAGE_FULL", message);
}

}  // namespace

std::int64_t TenantRoom::bytes(const std::string& tenant) const {
  const auto found = tenant_bytes_.find(tenant);
  return found == tenant_bytes_.end() ? 0 : found->second;
}

std::int64_t TenantRoom::LimitOf(const std::string& tenant) const {
  return limits_ == nullptr ? -1 : limits_(tenant).store_bytes;
}

absl::Status TenantRoom::Check(const std::string& tenant, std::int64_t more) const {
  const std::int64_t own = bytes(tenant);
  const std::int64_t limit = LimitOf(tenant);
  if (limit >= 0 && own + more > limit) {
    return StorageFull(absl::StrCat("the store of tenant ", tenant, " is full: it holds ", own, " of ", limit,
                                    " bytes, and ", more, " more are needed"));
  }
  if (bytes_ + more <= max_bytes_) return absl::OkStatus();
  return StorageFull(absl::StrCat("the server's store is full: it takes ", max_bytes_, " bytes, tenant ", tenant,
                                  " has ", own, " of them, and ", more, " more are needed"));
}

void TenantRoom::Count(const std::string& tenant, std::int64_t bytes) {
  bytes_ += bytes;
  if ((tenant_bytes_[tenant] += bytes) == 0) tenant_bytes_.erase(tenant);
}

std::string TenantRoom::WhoGivesWay(const std::string& tenant, std::int64_t more) const {
  const std::int64_t own = bytes(tenant) + more;
  const std::int64_t limit = LimitOf(tenant);
  const auto tenants = static_cast<std::int64_t>(tenant_bytes_.size()) + (tenant_bytes_.contains(tenant) ? 0 : 1);
  if ((limit >= 0 && own > limit) || own > max_bytes_ / tenants) return tenant;
  const auto most = std::max_element(tenant_bytes_.begin(), tenant_bytes_.end(),
                                     [](const auto& a, const auto& b) { return a.second < b.second; });
  return most == tenant_bytes_.end() ? tenant : most->first;
}

}  // namespace planish
