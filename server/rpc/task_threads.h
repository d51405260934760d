#pragma once

#include <condition_variable>
#include <cstdint>
#include <deque>
#include <functional>
#include <map>
#include <mutex>
#include <string>
#include <thread>
#include <utility>
#include <vector>

namespace planish {

// Threads for what handlers must not do on gRPC's own, few threads: everything that may wait for a disk, a digest or a
// lock. Tenants share them: the next task is that of the tenant with the fewest tasks under way, and among equals of
// the one whose last task began longest ago. Where there are several threads, no tenant has all of them, so that a
// tenant that comes does not wait for another one's tasks. Thread-safe.
class TaskThreads {
 public:
  explicit TaskThreads(int count);

  // Runs the tasks that are left, then ends.
  ~TaskThreads();

  TaskThreads(const TaskThreads&) = delete;
  TaskThreads& operator=(const TaskThreads&) = delete;

  // Runs `task` soon; the tasks of one tenant begin in the order of the calls. Never waits.
  void Post(const std::string& tenant, std::function<void()> task);

 private:
  struct Tenant {
    std::deque<std::function<void()>> tasks;
    int running = 0;
    std::uint64_t last_begin = 0;  // of a task: counts all tasks
  };

  void Run();
  // Whose task is next; null: nobody's for now. Requires mutex_.
  Tenant* Next();

  const int most_of_tenant_;  // tasks under way

  std::mutex mutex_;
  std::condition_variable changed_;
  // Guarded by mutex_.
  std::map<std::string, Tenant> tenants_;  // that have tasks waiting or under way
  std::uint64_t begun_ = 0;                // tasks
  bool ending_ = false;

  std::vector<std::thread> threads_;
};

// One tenant's tasks on some threads, which outlive it.
struct TenantTasks {
  TaskThreads* threads = nullptr;
  std::string tenant;

  void Post(std::function<void()> task) const { threads->Post(tenant, std::move(task)); }
};

}  // namespace planish
