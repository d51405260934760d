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

// Threads for work that handlers must not do on gRPC's few threads: everything that may wait for a disk, a digest or a
// lock. Tenants share the threads fairly: the next task is from the tenant with the fewest running tasks, and among
// equals from the one whose last task began longest ago. If there is more than one thread, no tenant gets all of them,
// so one tenant cannot block the others. Thread-safe.
class TaskThreads {
 public:
  explicit TaskThreads(int count);

  // Runs the remaining tasks, then ends.
  ~TaskThreads();

  TaskThreads(const TaskThreads&) = delete;
  TaskThreads& operator=(const TaskThreads&) = delete;

  // Queues `task`. The tasks of one tenant begin in the order of the calls. Never blocks.
  void Post(const std::string& tenant, std::function<void()> task);

 private:
  struct Tenant {
    std::deque<std::function<void()>> tasks;
    int running = 0;
    std::uint64_t last_begin = 0;  // value of begun_ when its last task began
  };

  void Run();
  // The tenant whose task is next; null if no task may start now. Requires mutex_.
  Tenant* Next();

  const int most_of_tenant_;  // most running tasks of a tenant

  std::mutex mutex_;
  std::condition_variable changed_;
  // Guarded by mutex_.
  std::map<std::string, Tenant> tenants_;  // tenants with waiting or running tasks
  std::uint64_t begun_ = 0;                // tasks begun so far
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
