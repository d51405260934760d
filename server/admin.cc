#include "server/admin.h"

#include "core/base/status_macros.h"
#include "google/protobuf/util/time_util.h"
#include "server/config/setting.h"
#include "server/log/log.h"

namespace planish {
namespace {

using google::protobuf::util::TimeUtil;

google::protobuf::Timestamp Stamp(absl::Time time) {
  return TimeUtil::NanosecondsToTimestamp(absl::ToUnixNanos(time));
}

}  // namespace

AdminActions Admin::Actions() {
  AdminActions actions;
  actions.drain = [this] { return SetDraining(true); };
  actions.undrain = [this] { return SetDraining(false); };
  actions.stats = [this] { return Stats(); };
  actions.config = [this] { return Config(); };
  return actions;
}

absl::Status Admin::SetDraining(bool draining) {
  const std::lock_guard lock(draining_);
  const bool was_draining = manager_.IsDraining();
  if (draining) {
    manager_.Drain(nullptr);
  } else {
    PLANISH_RETURN_IF_ERROR(manager_.Undrain());
  }
  if (draining == was_draining) return absl::OkStatus();
  const char* const what = draining ? "drained by an operator: new jobs are refused" : "takes new jobs again";
  LogInfo(what);
  service_manager_.Status(what);
  return absl::OkStatus();
}

admin::v1::Stats Admin::Stats() const {
  const ManagerStats now = manager_.Stats();
  admin::v1::Stats stats;
  stats.set_version(PLANISH_VERSION);
  *stats.mutable_start_time() = Stamp(start_);
  stats.set_draining(now.draining);
  stats.set_workers(now.workers);
  // Of other servers, all workers that they announce count as ready.
  stats.set_workers_ready(now.workers - now.own_workers + monitoring_.workers_ready());
  stats.set_queued(now.queued);
  stats.set_running(now.running);
  stats.set_reserved_memory_bytes(now.all_reserved_bytes);
  stats.set_memory_bytes(now.all_memory_bytes);
  stats.set_stored_bytes(now.stored_bytes);
  stats.set_store_bytes(now.store_bytes);
  if (now.queued > 0) {
    *stats.mutable_oldest_wait() = TimeUtil::NanosecondsToDuration(absl::ToInt64Nanoseconds(now.oldest_wait));
  }
  for (const TenantStats& tenant : now.tenants) {
    admin::v1::TenantStats* added = stats.add_tenants();
    added->set_tenant(tenant.tenant);
    added->set_queued(tenant.queued);
    added->set_running(tenant.running);
    added->set_accepted(tenant.accepted);
    added->set_refused(tenant.refused);
  }
  return stats;
}

admin::v1::Config Admin::Config() const {
  const ConfigInForce in_force = reloader_.InForce();
  admin::v1::Config config;
  config.set_yaml(ToYaml(in_force.settings));
  *config.mutable_load_time() = Stamp(in_force.load_time);
  return config;
}

}  // namespace planish
