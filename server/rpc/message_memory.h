// Limits the memory of callers' messages, while they arrive and when they are parsed.
#pragma once

#include <cstdint>
#include <map>
#include <mutex>
#include <string>

#include "absl/status/statusor.h"
#include "grpcpp/resource_quota.h"

namespace planish {

// Messages that arrive are charged to gRPC's quota, which all connections share. The quota is small, and grows only by
// the messages that admitted callers may be sending, so callers who are not admitted find little room. A parsed message
// is charged to its tenant. Thread-safe.
class MessageMemory {
 public:
  // At most `most` bytes for the quota, and as many for parsed messages; 0: no limit.
  explicit MessageMemory(std::int64_t most);

  // A share of the memory. The destructor returns it. Must not outlive the MessageMemory.
  class Share {
   public:
    Share() = default;
    Share(Share&& other) noexcept { *this = std::move(other); }
    Share& operator=(Share&& other) noexcept;
    ~Share();

   private:
    friend class MessageMemory;
    MessageMemory* memory_ = nullptr;
    std::string tenant_;
    std::int64_t bytes_ = 0;
    bool is_incoming_ = false;
  };

  // Adds room for `bytes` to gRPC's quota as long as the share lives.
  Share Expect(std::int64_t bytes);

  // Memory for a parsed message. RESOURCE_EXHAUSTED with QUEUE_FULL and RetryInfo if there is too little left and
  // `tenant` has its fair part (server/access/fair_part.h).
  absl::StatusOr<Share> Take(const std::string& tenant, std::int64_t bytes);

  grpc::ResourceQuota& quota() { return quota_; }
  bool is_limited() const { return most_ > 0; }

 private:
  void GiveBack(const Share& share);
  // Adapts gRPC's quota to expected_. Requires mutex_.
  void ResizeQuota();

  const std::int64_t most_;
  grpc::ResourceQuota quota_{"planishd"};

  std::mutex mutex_;
  // Guarded by mutex_.
  std::int64_t expected_ = 0;
  std::int64_t taken_ = 0;
  std::map<std::string, std::int64_t> taken_by_;  // by tenant, without zeros
};

}  // namespace planish
