// How much memory the messages of callers take: on their way in, and parsed.
#pragma once

#include <cstdint>
#include <map>
#include <mutex>
#include <string>

#include "absl/status/statusor.h"
#include "grpcpp/resource_quota.h"

namespace planish {

// A message on its way in is gRPC's, whose quota is one for the process and as large as the messages that admitted
// callers may be sending now: others find it small. A parsed message is charged to its tenant.
// Thread-safe.
class MessageMemory {
 public:
  // `most` bytes for each of the two; 0: no limit.
  explicit MessageMemory(std::int64_t most);

  // Something taken, given back by the destructor. Must not outlive the MessageMemory.
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

  // Room in gRPC's quota for `bytes` more.
  Share Expect(std::int64_t bytes);

  // RESOURCE_EXHAUSTED with QUEUE_FULL and RetryInfo if all is taken and `tenant` has its fair part
  // (server/access/fair_part.h).
  absl::StatusOr<Share> Take(const std::string& tenant, std::int64_t bytes);

  grpc::ResourceQuota& quota() { return quota_; }
  bool is_limited() const { return most_ > 0; }

 private:
  void GiveBack(const Share& share);
  // Requires mutex_.
  void ResizeQuota();

  const std::int64_t most_;
  grpc::ResourceQuota quota_{"planishd"};

  std::mutex mutex_;
  // Guarded by mutex_.
  std::int64_t expected_ = 0;
  std::int64_t taken_ = 0;
  std::map<std::string, std::int64_t> taken_by_;  // by tenant; none is 0
};

}  // namespace planish
