// Carries out the calls of operators (planish.admin.v1.Admin).
#pragma once

#include <mutex>

#include "absl/time/clock.h"
#include "absl/time/time.h"
#include "server/jobs/job_manager.h"
#include "server/monitoring.h"
#include "server/reload.h"
#include "server/rpc/admin_service.h"
#include "server/service_manager.h"

namespace planish {

// The actions behind planish.admin.v1.Admin. Thread-safe.
class Admin {
 public:
  // The arguments must outlive this object.
  Admin(JobManager* manager, const Monitoring* monitoring, const Reloader* reloader,
        const ServiceManager* service_manager)
      : manager_(*manager), monitoring_(*monitoring), reloader_(*reloader), service_manager_(*service_manager) {}

  // The actions for NewAdminService(). This object must outlive the service.
  AdminActions Actions();

 private:
  absl::Status SetDraining(bool draining);
  admin::v1::Stats Stats() const;
  admin::v1::Config Config() const;

  JobManager& manager_;
  const Monitoring& monitoring_;
  const Reloader& reloader_;
  const ServiceManager& service_manager_;
  const absl::Time start_ = absl::Now();
  std::mutex draining_;  // held while draining begins or ends
};

}  // namespace planish
