#include "server/jobs/queue_forecast.h"

#include <algorithm>
#include <limits>
#include <tuple>
#include <utility>

namespace planish {
namespace {

// Work that has run longer than expected is assumed to need this part of its expected time again.
constexpr double kLastPart = 0.1;

constexpr double kNanosecond = 1e-9;

bool IsBefore(const WorkRow* a, const WorkRow* b) {
  return std::tie(a->turn_time, a->number) < std::tie(b->turn_time, b->number);
}

}  // namespace

bool QueueForecast::Turn::operator<(const Turn& other) const {
  return std::tie(start, time, number) < std::tie(other.start, other.time, other.number);
}

QueueForecast::QueueForecast(QueueState state, const TenantLimitsSource& limits, int workers, double factor)
    : state_(std::move(state)), limits_(limits), workers_(std::max(workers, 1)), factor_(factor) {
  for (const WorkRow& work : state_.works) {
    Tenant& tenant = tenants_.try_emplace(work.tenant, NewTenant(work.tenant, limits)).first->second;
    (work.running ? tenant.running : tenant.waiting).push_back(&work);
    names_.insert(work.name);
    if (work.running) ++running_;
  }
  for (auto& [name, tenant] : tenants_) std::sort(tenant.waiting.begin(), tenant.waiting.end(), IsBefore);
}

void QueueForecast::Add(const WorkRow& work) {
  if (!names_.insert(work.name).second) return;
  Tenant& tenant = tenants_.try_emplace(work.tenant, NewTenant(work.tenant, limits_)).first->second;
  const WorkRow* const added = &added_.emplace_back(work);
  tenant.waiting.insert(std::upper_bound(tenant.waiting.begin(), tenant.waiting.end(), added, IsBefore), added);
}

QueueForecast::Tenant QueueForecast::NewTenant(const std::string& name, const TenantLimitsSource& limits) const {
  Tenant tenant;
  if (const auto found = state_.accounts.tenants.find(name); found != state_.accounts.tenants.end()) {
    tenant.account = found->second;
  }
  if (limits != nullptr) tenant.limits = limits(name);
  tenant.share = ShareOf(tenant.limits);
  std::int64_t start = StartOf(tenant.account, tenant.share, state_.now);
  if (tenant.account.waiting == 0) start = std::max(start, state_.accounts.virtual_time);
  tenant.start = static_cast<double>(start) * kNanosecond;
  return tenant;
}

double QueueForecast::Expected(const WorkRow& work) const {
  return factor_ * static_cast<double>(work.run_time) * kNanosecond;
}

double QueueForecast::Charge(const WorkRow& work, double share) const {
  return static_cast<double>(ChargeFor(absl::Nanoseconds(work.run_time) * factor_, share)) * kNanosecond;
}

double QueueForecast::Remaining(const WorkRow& work) const {
  const double expected = Expected(work);
  const double elapsed = absl::ToDoubleSeconds(state_.now - absl::FromUnixNanos(work.start_time));
  return std::max(expected - elapsed, kLastPart * expected);
}

QueueForecast::Ahead QueueForecast::AheadOf(const Turn& turn, const std::string& except) const {
  Ahead ahead;
  for (const auto& [name, tenant] : tenants_) {
    if (name == except) continue;
    Turn next = {tenant.start, 0, 0};
    for (const WorkRow* work : tenant.waiting) {
      next.time = work->turn_time;
      next.number = work->number;
      if (!(next < turn)) break;
      ++ahead.count;
      ahead.seconds += Expected(*work);
      next.start += Charge(*work, tenant.share);
    }
  }
  return ahead;
}

int QueueForecast::Position(const std::string& work) const {
  for (const auto& [name, tenant] : tenants_) {
    Turn turn = {tenant.start, 0, 0};
    for (std::size_t i = 0; i < tenant.waiting.size(); ++i) {
      const WorkRow& each = *tenant.waiting[i];
      turn.time = each.turn_time;
      turn.number = each.number;
      if (each.name == work) return static_cast<int>(i) + AheadOf(turn, name).count;
      turn.start += Charge(each, tenant.share);
    }
  }
  return 0;
}

std::optional<double> QueueForecast::UntilNextEnd(const Tenant* tenant) const {
  std::optional<double> least;
  for (const auto& [name, each] : tenants_) {
    if (tenant != nullptr && tenant != &each) continue;
    for (const WorkRow* work : each.running) {
      if (work->run_time > 0) least = std::min(least.value_or(Remaining(*work)), Remaining(*work));
    }
  }
  return least;
}

double QueueForecast::SecondsUntilTurn(const std::string& tenant) const {
  const auto found = tenants_.find(tenant);
  const Tenant own = found == tenants_.end() ? NewTenant(tenant, limits_) : found->second;
  const bool held_back = !MayRunMore(own.limits, static_cast<std::int64_t>(own.running.size()));
  double start = own.start;
  double own_seconds = 0;
  for (const WorkRow* work : own.waiting) {
    own_seconds += Expected(*work);
    start += Charge(*work, own.share);
  }
  const Ahead others = AheadOf({start, std::numeric_limits<std::int64_t>::max(), 0}, tenant);
  const bool is_next = others.count == 0 && own.waiting.empty();
  if (is_next && held_back) return UntilNextEnd(found == tenants_.end() ? &nobody_ : &found->second).value_or(0);
  if (is_next) return running_ < workers_ ? 0 : UntilNextEnd(nullptr).value_or(0);
  double running_seconds = 0, own_running_seconds = 0;
  for (const auto& [name, each] : tenants_) {
    for (const WorkRow* work : each.running) {
      running_seconds += Remaining(*work);
      if (name == tenant) own_running_seconds += Remaining(*work);
    }
  }
  const double seconds = (running_seconds + own_seconds + others.seconds) / workers_;
  return own.limits.running > 0 ? std::max(seconds, (own_running_seconds + own_seconds) / own.limits.running) : seconds;
}

std::optional<double> QueueForecast::SecondsUntilRoom(const std::string& tenant, Room why) const {
  const auto found = tenants_.find(tenant);
  if (why == Room::kServerFull || found == tenants_.end() || found->second.waiting.empty()) {
    return UntilNextEnd(nullptr);
  }
  // A place in the tenant's queue becomes free when its first waiting work is claimed.
  const Tenant& own = found->second;
  if (!MayRunMore(own.limits, static_cast<std::int64_t>(own.running.size()))) return UntilNextEnd(&own);
  const WorkRow& head = *own.waiting.front();
  const Ahead others = AheadOf({own.start, head.turn_time, head.number}, tenant);
  std::optional<double> seconds = UntilNextEnd(nullptr);
  if (seconds.has_value()) *seconds += others.seconds / workers_;
  return seconds;
}

}  // namespace planish
