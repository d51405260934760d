#include "server/rpc/stream_counter.h"

#include <utility>

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

void StreamCounter::AddSender(const std::shared_ptr<Interruptible>& call) {
  {
    const std::lock_guard lock(mutex_);
    if (!interrupted_) {
      std::erase_if(senders_, [](const auto& other) { return other.expired(); });
      senders_.push_back(call);
      return;
    }
  }
  call->Interrupt();
}

// The calls are interrupted without the lock, since gRPC may end a call on this very thread.
void StreamCounter::InterruptSenders() {
  std::vector<std::weak_ptr<Interruptible>> senders;
  {
    const std::lock_guard lock(mutex_);
    interrupted_ = true;
    senders.swap(senders_);
  }
  for (const auto& sender : senders) {
    if (const auto call = sender.lock()) call->Interrupt();
  }
}

}  // namespace planish
