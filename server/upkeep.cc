#include "server/upkeep.h"

#include <utility>

namespace planish {

Upkeep::Upkeep(absl::Duration interval, std::function<void()> task) {
  thread_ = std::thread([this, interval = absl::ToChronoNanoseconds(interval), task = std::move(task)] {
    std::unique_lock lock(mutex_);
    while (!ended_changed_.wait_for(lock, interval, [this] { return ended_; })) {
      lock.unlock();
      task();
      lock.lock();
    }
  });
}

Upkeep::~Upkeep() {
  {
    const std::lock_guard lock(mutex_);
    ended_ = true;
  }
  ended_changed_.notify_one();
  thread_.join();
}

}  // namespace planish
