// What operators ask of the server (planish.admin.v1.Admin), done.
#pragma once

#include <atomic>
#include <mutex>

#include "absl/time/clock.h"
#include "absl/time/time.h"
#include "server/jobs/job_manager.h"
#include "server/reload.h"
#include "server/rpc/admin_service.h"
#include "server/service_manager.h"

namespace planish {

// Thread-safe.
class Admin {
 public:
  // All must outlive this.
  Admin(JobManager* manager, const Reloader* reloader, const ServiceManager* service_manager)
      : manager_(*manager), reloader_(*reloader), service_manager_(*service_manager) {}

  // What a service of these does; this must outlive it.
  AdminActions Actions();

  // `change`: 1 for a worker that is ready for the first time, -1 for one that is gone.
  void CountWorkers(int change) { workers_ready_ += change; }

 private:
  absl::Status SetDraining(bool draining);
  admin::v1::Stats Stats() const;
  admin::v1::Config Config() const;

  JobManager& manager_;
  const Reloader& reloader_;
  const ServiceManager& service_manager_;
  const absl::Time start_ = absl::Now();
  std::atomic<int> workers_ready_ = 0;

  std::mutex mutex_;
  bool draining_ = false;  // guarded by mutex_
};

}  // namespace planish
