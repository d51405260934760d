#pragma once

#include <mutex>
#include <set>
#include <string>

namespace planish {

// Keeps a label from taking any number of values: some of them come from worker processes, which are not trusted.
// Thread-safe.
class LabelGuard {
 public:
  explicit LabelGuard(std::size_t most) : most_(most) {}

  // `reason` if it looks like one (A-Z, 0-9, _; at most 64) and is one of the first `most` that came; "NONE" if it is
  // empty; "OTHER" otherwise.
  std::string Reason(const std::string& reason);

 private:
  const std::size_t most_;
  std::mutex mutex_;
  std::set<std::string> known_;  // guarded by mutex_
};

}  // namespace planish
