#include "server/rpc/stream_counter.h"

namespace planish {

void StreamCounter::Add() {
  const std::lock_guard lock(mutex_);
  ++count_;
}

void StreamCounter::Remove() {
  const std::lock_guard lock(mutex_);
  if (--count_ == 0) none_.notify_all();
}

bool StreamCounter::WaitForNone(absl::Time deadline) {
  std::unique_lock lock(mutex_);
  return none_.wait_until(lock, absl::ToChronoTime(deadline), [this] { return count_ == 0; });
}

}  // namespace planish
