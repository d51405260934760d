#include <google/protobuf/util/time_util.h>

#include "client/src/rpc.h"
#include "planish/admin.h"

namespace planish {
inline namespace abi0 {
namespace {

using google::protobuf::util::TimeUtil;

std::chrono::system_clock::time_point ToTime(const google::protobuf::Timestamp& time) {
  const std::chrono::nanoseconds since(TimeUtil::TimestampToNanoseconds(time));
  return std::chrono::system_clock::time_point(std::chrono::duration_cast<std::chrono::system_clock::duration>(since));
}

ServerStats ToStats(const admin::v1::Stats& from) {
  ServerStats stats;
  stats.version = from.version();
  stats.start_time = ToTime(from.start_time());
  stats.draining = from.draining();
  stats.workers = from.workers();
  stats.workers_ready = from.workers_ready();
  stats.queued = from.queued();
  stats.running = from.running();
  stats.reserved_memory_bytes = from.reserved_memory_bytes();
  stats.memory_bytes = from.memory_bytes();
  stats.stored_bytes = from.stored_bytes();
  stats.store_bytes = from.store_bytes();
  stats.oldest_wait_seconds = 1e-9 * static_cast<double>(TimeUtil::DurationToNanoseconds(from.oldest_wait()));
  for (const admin::v1::TenantStats& tenant : from.tenants()) {
    stats.tenants.push_back({tenant.tenant(), tenant.queued(), tenant.running(), tenant.accepted(), tenant.refused()});
  }
  return stats;
}

}  // namespace

class AdminClient::Impl {
 public:
  Impl(const std::string& target, const ClientOptions& options) : rpc(target, options) {}

  Rpc rpc;
};

AdminClient::AdminClient(const std::string& target, const ClientOptions& options)
    : impl_(std::make_unique<Impl>(target, options)) {}
AdminClient::~AdminClient() = default;
AdminClient::AdminClient(AdminClient&&) noexcept = default;
AdminClient& AdminClient::operator=(AdminClient&&) noexcept = default;

void AdminClient::Drain() {
  impl_->rpc.Drain();
}

void AdminClient::Undrain() {
  impl_->rpc.Undrain();
}

ServerStats AdminClient::GetStats() {
  return ToStats(impl_->rpc.GetStats());
}

ServerConfig AdminClient::GetConfig() {
  const admin::v1::Config config = impl_->rpc.GetConfig();
  return {config.yaml(), ToTime(config.load_time())};
}

}  // namespace abi0
}  // namespace planish
