#pragma once

#include <condition_variable>
#include <deque>
#include <functional>
#include <mutex>
#include <thread>
#include <vector>

namespace planish {

// Threads for what handlers must not do on gRPC's own, few threads: whatever may wait for a disk, a digest or a lock
// that somebody else holds meanwhile. Thread-safe.
class TaskThreads {
 public:
  explicit TaskThreads(int count);

  // Runs the tasks that are left, then ends.
  ~TaskThreads();

  TaskThreads(const TaskThreads&) = delete;
  TaskThreads& operator=(const TaskThreads&) = delete;

  // Runs `task` soon, in the order of the calls as far as threads are free. Never waits.
  void Post(std::function<void()> task);

 private:
  void Run();

  std::mutex mutex_;
  std::condition_variable changed_;
  // Guarded by mutex_.
  std::deque<std::function<void()>> tasks_;
  bool ending_ = false;

  std::vector<std::thread> threads_;
};

}  // namespace planish
