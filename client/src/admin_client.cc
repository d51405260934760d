#include "client/src/convert.h"
#include "client/src/errors.h"
#include "client/src/rpc.h"
#include "planish/admin.h"

namespace planish::inline abi0 {
namespace {

using AdminStub = admin::v1::Admin::Stub;

ServerStats ToStats(const admin::v1::Stats& from) {
  ServerStats stats;
  stats.version = from.version();
  stats.start_time = TimeFrom(from.start_time());
  stats.draining = from.draining();
  stats.workers = from.workers();
  stats.workers_ready = from.workers_ready();
  stats.queued = from.queued();
  stats.running = from.running();
  stats.reserved_memory_bytes = from.reserved_memory_bytes();
  stats.memory_bytes = from.memory_bytes();
  stats.stored_bytes = from.stored_bytes();
  stats.store_bytes = from.store_bytes();
  stats.oldest_wait = SecondsFrom(from.oldest_wait());
  for (const admin::v1::TenantStats& tenant : from.tenants()) {
    stats.tenants.push_back({tenant.tenant(), tenant.queued(), tenant.running(), tenant.accepted(), tenant.refused()});
  }
  return stats;
}

}  // namespace

struct AdminClient::Impl {
  Rpc rpc;
};

AdminClient::AdminClient(const std::string& target, const ClientOptions& options)
    : impl_(new Impl{{target, options}}) {}

Result<AdminClient> AdminClient::Make(const std::string& target, const ClientOptions& options) {
  return Caught([&] { return AdminClient(target, options); });
}

Result<void> AdminClient::Drain(std::nothrow_t) {
  return Caught([&] { impl_->rpc.Call(&AdminStub::Drain, admin::v1::DrainRequest()); });
}

Result<void> AdminClient::Undrain(std::nothrow_t) {
  return Caught([&] { impl_->rpc.Call(&AdminStub::Undrain, admin::v1::UndrainRequest()); });
}

Result<ServerStats> AdminClient::GetStats(std::nothrow_t) {
  return Caught([&] { return ToStats(impl_->rpc.Call(&AdminStub::GetStats, admin::v1::GetStatsRequest())); });
}

Result<ServerConfig> AdminClient::GetConfig(std::nothrow_t) {
  return Caught([&] {
    const admin::v1::Config config = impl_->rpc.Call(&AdminStub::GetConfig, admin::v1::GetConfigRequest());
    return ServerConfig{config.yaml(), TimeFrom(config.load_time())};
  });
}

}  // namespace planish::inline abi0
