#pragma once

#include <condition_variable>
#include <functional>
#include <mutex>
#include <thread>

#include "absl/time/time.h"

namespace planish {

// Calls a function at an interval, on its own thread, until the object is destroyed.
class Upkeep {
 public:
  Upkeep(absl::Duration interval, std::function<void()> task);
  // Waits for a running call.
  ~Upkeep();
  Upkeep(const Upkeep&) = delete;
  Upkeep& operator=(const Upkeep&) = delete;

 private:
  std::mutex mutex_;
  std::condition_variable ended_changed_;
  bool ended_ = false;  // guarded by mutex_
  std::thread thread_;
};

}  // namespace planish
