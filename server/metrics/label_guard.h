#pragma once

#include <mutex>
#include <set>
#include <string>

namespace planish {

// Bounds the number of values of a label. Some values come from worker processes, which are not trusted. Thread-safe.
class LabelGuard {
 public:
  explicit LabelGuard(std::size_t most) : most_(most) {}

  // `reason` if it has the form of one (1 to 64 of A-Z, 0-9, _) and is among the first `most` different ones; "NONE" if
  // it is empty; "OTHER" otherwise.
  std::string Reason(const std::string& reason);

 private:
  const std::size_t most_;
  std::mutex mutex_;
  std::set<std::string> known_;  // guarded by mutex_
};

}  // namespace planish
