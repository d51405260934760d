#include "server/farm.h"

#include <algorithm>

#include "core/base/status_macros.h"

namespace planish {
namespace {

JobCapacity CapacityOf(const std::vector<ServerEntry>& servers) {
  JobCapacity capacity = {0, 0, 0, 0};
  for (const ServerEntry& server : servers) {
    capacity.workers += server.workers;
    if (server.workers == 0) continue;
    ++capacity.servers;
    capacity.memory_bytes = std::max(capacity.memory_bytes, server.memory_bytes);
    capacity.total_memory_bytes += server.memory_bytes;
  }
  // If no server has workers, jobs of any size are accepted, and wait for workers to start.
  if (capacity.workers == 0) capacity.memory_bytes = JobCapacity().memory_bytes;
  return capacity;
}

}  // namespace

absl::Status Farm::Tick() {
  absl::Status status = AnnounceAndAsk();
  const std::lock_guard lock(mutex_);
  last_tick_ = status;
  return status;
}

absl::Status Farm::LastTick() const {
  const std::lock_guard lock(mutex_);
  return last_tick_;
}

absl::Status Farm::AnnounceAndAsk() {
  // The announcement lasts long enough for a database to restart meanwhile.
  PLANISH_RETURN_IF_ERROR(registry_.Announce(self_, 6 * kInterval));
  PLANISH_ASSIGN_OR_RETURN(std::vector<ServerEntry> servers, registry_.List());
  PLANISH_RETURN_IF_ERROR(CompareClocks());
  const std::lock_guard lock(mutex_);
  capacity_ = CapacityOf(servers);
  servers_ = std::move(servers);
  return absl::OkStatus();
}

absl::Status Farm::CompareClocks() {
  PLANISH_ASSIGN_OR_RETURN(const ClockOffset offset, registry_.Compare(clock_));
  if (offset.error > kSkewLimit / 2) return absl::OkStatus();  // too inexact to tell
  bool was_wrong = false;
  {
    const std::lock_guard lock(mutex_);
    was_wrong = absl::AbsDuration(skew_) > kSkewLimit;
    skew_ = offset.ahead;
  }
  const bool is_wrong = absl::AbsDuration(offset.ahead) > kSkewLimit;
  if (on_skew_ != nullptr && is_wrong != was_wrong) on_skew_(is_wrong ? offset.ahead : absl::ZeroDuration());
  return absl::OkStatus();
}

absl::Duration Farm::ClockSkew() const {
  const std::lock_guard lock(mutex_);
  return skew_;
}

Farm::~Farm() {
  registry_.Withdraw(self_.name).IgnoreError();  // otherwise the row expires by itself
}

std::vector<ServerEntry> Farm::Servers() const {
  const std::lock_guard lock(mutex_);
  return servers_;
}

JobCapacity Farm::Capacity() const {
  const std::lock_guard lock(mutex_);
  return capacity_;
}

}  // namespace planish
