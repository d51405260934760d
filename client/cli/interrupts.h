// Ctrl-C, SIGTERM and SIGHUP: the first asks to cancel, the second leaves at once.
#pragma once

#include <atomic>
#include <functional>
#include <mutex>
#include <thread>

#include "client/src/process.h"

namespace planish::cli {

// One per process, made in main() before any other thread, because threads inherit its signal mask. Signals are read
// from a descriptor by a thread, so that what they set off may do anything a thread may.
class Interrupts {
 public:
  Interrupts();
  ~Interrupts();

  // What the first signal sets off, on the thread of this class; must return soon. Without it the first signal
  // leaves at once.
  void SetCancel(std::function<void()> cancel);
  // Done before leaving at once: what destructors would have done.
  void SetLastWords(std::function<void()> last_words);

  bool interrupted() const { return interrupted_; }
  // For what must not be left half done: SetCancel([] {}) before it, this behind it.
  void LeaveIfInterrupted();

 private:
  void Watch();
  [[noreturn]] void LeaveAtOnce();

  OwnedFd signals_;
  OwnedFd stop_;
  std::mutex mutex_;  // guards the two functions
  std::function<void()> cancel_;
  std::function<void()> last_words_;
  std::atomic<bool> interrupted_ = false;
  std::thread watcher_;
};

}  // namespace planish::cli
