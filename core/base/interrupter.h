// One-way cancel flag, after the SolveInterrupter of OR-Tools MathOpt.
#pragma once

#include <atomic>

namespace planish {

// Thread-safe: any thread may interrupt; solvers only read.
class Interrupter {
 public:
  // Cannot be undone.
  void Interrupt() { interrupted_.store(true, std::memory_order_relaxed); }
  bool IsInterrupted() const { return interrupted_.load(std::memory_order_relaxed); }

 private:
  std::atomic<bool> interrupted_ = false;
};

// False for null.
inline bool IsInterrupted(const Interrupter* interrupter) {
  return interrupter != nullptr && interrupter->IsInterrupted();
}

}  // namespace planish
