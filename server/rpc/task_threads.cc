#include "server/rpc/task_threads.h"

#include <algorithm>
#include <tuple>
#include <utility>

namespace planish {

TaskThreads::TaskThreads(int count) : most_of_tenant_(std::max(count - 1, 1)) {
  for (int i = 0; i < count; ++i) threads_.emplace_back([this] { Run(); });
}

TaskThreads::~TaskThreads() {
  {
    const std::lock_guard lock(mutex_);
    ending_ = true;
  }
  changed_.notify_all();
  for (std::thread& thread : threads_) thread.join();
}

void TaskThreads::Post(const std::string& tenant, std::function<void()> task) {
  {
    const std::lock_guard lock(mutex_);
    tenants_[tenant].tasks.push_back(std::move(task));
  }
  changed_.notify_one();
}

TaskThreads::Tenant* TaskThreads::Next() {
  Tenant* next = nullptr;
  for (auto& [name, tenant] : tenants_) {
    if (tenant.tasks.empty() || tenant.running >= most_of_tenant_) continue;
    const bool is_first =
        next == nullptr || std::tie(tenant.running, tenant.last_begin) < std::tie(next->running, next->last_begin);
    if (is_first) next = &tenant;
  }
  return next;
}

void TaskThreads::Run() {
  std::unique_lock lock(mutex_);
  while (true) {
    Tenant* tenant = nullptr;
    // A tenant's task that may not start yet is left to the threads that run this tenant's other tasks, also at the
    // end.
    changed_.wait(lock, [&] { return (tenant = Next()) != nullptr || ending_; });
    if (tenant == nullptr) return;
    std::function<void()> task = std::move(tenant->tasks.front());
    tenant->tasks.pop_front();
    ++tenant->running;
    tenant->last_begin = ++begun_;
    lock.unlock();
    task();
    task = nullptr;
    lock.lock();
    --tenant->running;
    std::erase_if(tenants_, [](const auto& each) { return each.second.tasks.empty() && each.second.running == 0; });
  }
}

}  // namespace planish
