#include "server/rpc/message_memory.h"

#include <algorithm>
#include <utility>

#include "absl/time/time.h"
#include "core/base/error.h"
#include "server/access/fair_part.h"
#include "server/link/rpc_status.h"

namespace planish {
namespace {

// gRPC's quota while no call is admitted: room for thousands of connections. If the quota is exceeded, gRPC ends calls
// at random, admitted ones too, so it must be more than ReadWatch lets callers without credentials take.
constexpr std::int64_t kQuotaBase = std::int64_t{256} << 20;

constexpr absl::Duration kMemoryRetryDelay = absl::Seconds(1);

}  // namespace

MessageMemory::MessageMemory(std::int64_t most) : most_(most) {
  const std::lock_guard lock(mutex_);
  ResizeQuota();
}

MessageMemory::Share& MessageMemory::Share::operator=(Share&& other) noexcept {
  std::swap(memory_, other.memory_);
  std::swap(tenant_, other.tenant_);
  std::swap(bytes_, other.bytes_);
  std::swap(is_incoming_, other.is_incoming_);
  return *this;
}

MessageMemory::Share::~Share() {
  if (memory_ != nullptr) memory_->GiveBack(*this);
}

MessageMemory::Share MessageMemory::Expect(std::int64_t bytes) {
  Share share;
  share.memory_ = this;
  share.bytes_ = bytes;
  share.is_incoming_ = true;
  const std::lock_guard lock(mutex_);
  expected_ += bytes;
  ResizeQuota();
  return share;
}

absl::StatusOr<MessageMemory::Share> MessageMemory::Take(const std::string& tenant, std::int64_t bytes) {
  const std::lock_guard lock(mutex_);
  const auto found = taken_by_.find(tenant);
  const std::int64_t own = found == taken_by_.end() ? 0 : found->second;
  const std::int64_t tenants = static_cast<std::int64_t>(taken_by_.size()) + (own == 0 ? 1 : 0);
  if (most_ > 0 && !HasFairPart(own, taken_, bytes, most_, tenants)) {
    return WithRetryDelay(MakeError(absl::StatusCode::kResourceExhausted, "QUEUE_FULL",
                                    "requests that are being handled take all memory for requests"),
                          kMemoryRetryDelay);
  }
  Share share;
  share.memory_ = this;
  share.tenant_ = tenant;
  share.bytes_ = bytes;
  taken_ += bytes;
  if (bytes > 0) taken_by_[tenant] += bytes;
  return share;
}

void MessageMemory::GiveBack(const Share& share) {
  const std::lock_guard lock(mutex_);
  if (share.is_incoming_) {
    expected_ -= share.bytes_;
    ResizeQuota();
    return;
  }
  taken_ -= share.bytes_;
  const auto found = taken_by_.find(share.tenant_);
  if (found != taken_by_.end() && (found->second -= share.bytes_) == 0) taken_by_.erase(found);
}

void MessageMemory::ResizeQuota() {
  if (most_ > 0) quota_.Resize(static_cast<std::size_t>(std::min(most_, kQuotaBase + expected_)));
}

}  // namespace planish
