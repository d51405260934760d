// A bound on what a fuzzed function may allocate, so that no input can take the machine down.
#pragma once

#include <cstdint>

namespace planish::fuzz {

// While it lives, operator new of this program, in its libraries too, throws std::bad_alloc rather than hand out more
// than `bytes` beyond what was there before. Code that survives that goes on; what does not is a finding. malloc() is
// not counted. One at a time.
class MemoryBudget {
 public:
  explicit MemoryBudget(std::int64_t bytes);
  ~MemoryBudget();
  MemoryBudget(const MemoryBudget&) = delete;
  MemoryBudget& operator=(const MemoryBudget&) = delete;
};

}  // namespace planish::fuzz
