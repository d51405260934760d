// One-way cancel flag, after the SolveInterrupter of OR-Tools MathOpt.
#pragma once

#include <atomic>

namespace planish {

// Thread-safe: any thread may interrupt; solvers only read.
class Interrupter {
 public:
  // Sets the flag for good.
  void Interrupt() { interrupted_.store(true, std::memory_order_relaxed); }
  bool IsInterrupted() const { return interrupted_.load(std::memory_order_relaxed); }

 private:
  std::atomic<bool> interrupted_ = false;
};

// Whether `interrupter` is interrupted; false if it is null.
inline bool IsInterrupted(const Interrupter* interrupter) {
  return interrupter != nullptr && interrupter->IsInterrupted();
}

}  // namespace planish
