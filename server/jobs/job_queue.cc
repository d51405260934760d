#include "server/jobs/job_queue.h"

#include <algorithm>
#include <utility>

#include "server/access/fair_part.h"

namespace planish {
namespace {

// What a job costs its tenant at least: where nothing is known of what jobs take, each counts as much as any other.
constexpr double kLeastSeconds = 0.01;

// A job that runs longer than expected will do so for a while: this part of what was expected.
constexpr double kLastPart = 0.1;

}  // namespace

// ---- limits and room

TenantLimits JobQueue::LimitsOf(const std::string& tenant) const {
  return options_.limits == nullptr ? TenantLimits() : options_.limits(tenant);
}

double JobQueue::ShareOf(const std::string& tenant) const {
  const double share = LimitsOf(tenant).share;
  return share > 0 ? share : 1;
}

int JobQueue::Capacity(const std::string& tenant) const {
  const int queue = LimitsOf(tenant).queue;
  return queue >= 0 ? queue : options_.capacity;
}

Room JobQueue::RoomFor(const std::string& tenant, std::int64_t bytes) const {
  const Tenant* known = Find(tenant);
  const std::int64_t own = known == nullptr ? 0 : static_cast<std::int64_t>(known->entries.size());
  const std::int64_t idle = std::max(options_.workers - running(), 0);
  // What others have waiting takes idle workers first.
  if (own >= Capacity(tenant) + std::max<std::int64_t>(idle - (size_ - own), 0)) return Room::kTenantFull;
  std::int64_t among = own == 0 ? 1 : 0;
  for (const auto& [name, other] : tenants_) among += other.entries.empty() ? 0 : 1;
  const std::int64_t total = std::max<std::int64_t>(options_.total, among) + idle;
  if (!HasFairPart(own, size_, 1, total, among)) return Room::kServerFull;
  if (own > 0 && !HasFairPart(known->bytes, bytes_, bytes, options_.max_bytes, among)) return Room::kServerFull;
  return Room::kYes;
}

// ---- what was received

double JobQueue::Expected(double seconds) const {
  return factor_ * seconds;
}

double JobQueue::Charge(double seconds) const {
  return std::max(Expected(seconds), kLeastSeconds);
}

double JobQueue::Received(const Tenant& tenant, absl::Time now) const {
  double received = tenant.received;
  for (const std::string& name : tenant.running) {
    const Running& job = running_.at(name);
    received += std::max(absl::ToDoubleSeconds(now - job.start), 0.0) / job.share;
  }
  return received;
}

double JobQueue::StartOf(const Tenant& tenant, absl::Time now) const {
  double start = tenant.received;
  for (const std::string& name : tenant.running) {
    const Running& job = running_.at(name);
    start += std::max(absl::ToDoubleSeconds(now - job.start), Charge(job.seconds)) / job.share;
  }
  return start;
}

const JobQueue::Tenant* JobQueue::Find(const std::string& tenant) const {
  const auto found = tenants_.find(tenant);
  return found == tenants_.end() ? nullptr : &found->second;
}

void JobQueue::Lift(Tenant* tenant, absl::Time now) const {
  tenant->received += std::max(virtual_time_ - StartOf(*tenant, now), 0.0);
}

// ---- coming and going

void JobQueue::Push(QueueEntry entry, absl::Time now) {
  Tenant& tenant = tenants_[entry.tenant];
  if (const auto place = places_.find(entry.name); place != places_.end()) {
    tenant.entries.erase(place->second);
    tenant.bytes -= place->second.bytes;
    bytes_ -= place->second.bytes;
    --size_;
  } else if (tenant.entries.empty()) {
    Lift(&tenant, now);
  }
  tenant.bytes += entry.bytes;
  bytes_ += entry.bytes;
  ++size_;
  const std::string name = entry.name;
  places_[name] = *tenant.entries.insert(Entry{std::move(entry)}).first;
}

bool JobQueue::MayRun(const std::string& name, const Tenant& tenant) const {
  const int limit = LimitsOf(name).running;
  return limit < 0 || static_cast<int>(tenant.running.size()) < limit;
}

std::optional<std::string> JobQueue::Front(absl::Time now) const {
  const Entry* first = nullptr;
  Turn least;
  for (const auto& [name, tenant] : tenants_) {
    if (tenant.entries.empty() || !MayRun(name, tenant)) continue;
    const Entry& head = *tenant.entries.begin();
    const Turn turn = {StartOf(tenant, now), head.time, head.number};
    if (first != nullptr && !(turn < least)) continue;
    first = &head;
    least = turn;
  }
  if (first == nullptr) return std::nullopt;
  return first->name;
}

void JobQueue::Start(const std::string& name, absl::Time now) {
  const Entry entry = places_.at(name);
  virtual_time_ = std::max(virtual_time_, Received(tenants_.at(entry.tenant), now));
  running_[name] = {entry.tenant, now, ShareOf(entry.tenant), entry.seconds};
  tenants_.at(entry.tenant).running.insert(name);
  Remove(name);
  std::erase_if(tenants_, [&](const auto& each) {
    return each.second.entries.empty() && each.second.running.empty() && each.second.received <= virtual_time_;
  });
}

void JobQueue::End(const std::string& name, absl::Time now) {
  const auto found = running_.find(name);
  if (found == running_.end()) return;
  const Running job = found->second;
  Tenant& tenant = tenants_.at(job.tenant);
  const bool was_held_back = !MayRun(job.tenant, tenant);
  running_.erase(found);
  tenant.running.erase(name);
  tenant.received += std::max(absl::ToDoubleSeconds(now - job.start), kLeastSeconds) / job.share;
  // What its own limit kept it from is no credit either.
  if (was_held_back) Lift(&tenant, now);
  ForgetIfIdle();
}

void JobQueue::Remove(const std::string& name) {
  const auto place = places_.find(name);
  if (place == places_.end()) return;
  const Entry& entry = place->second;
  Tenant& tenant = tenants_.at(entry.tenant);
  tenant.entries.erase(entry);
  tenant.bytes -= entry.bytes;
  bytes_ -= entry.bytes;
  --size_;
  places_.erase(place);
  ForgetIfIdle();
}

void JobQueue::ForgetIfIdle() {
  if (!running_.empty() || size_ > 0) return;
  tenants_.clear();
  virtual_time_ = 0;
}

int JobQueue::size(const std::string& tenant) const {
  const Tenant* found = Find(tenant);
  return found == nullptr ? 0 : static_cast<int>(found->entries.size());
}

int JobQueue::running(const std::string& tenant) const {
  const Tenant* found = Find(tenant);
  return found == nullptr ? 0 : static_cast<int>(found->running.size());
}

// ---- what is to come

JobQueue::Ahead JobQueue::AheadOf(const Turn& turn, const std::string& except, absl::Time now) const {
  Ahead ahead;
  for (const auto& [name, tenant] : tenants_) {
    if (name == except || tenant.entries.empty()) continue;
    const double share = ShareOf(name);
    Turn next = {StartOf(tenant, now), {}, 0};
    for (const Entry& entry : tenant.entries) {
      next.time = entry.time;
      next.number = entry.number;
      if (!(next < turn)) break;
      ++ahead.count;
      ahead.seconds += Expected(entry.seconds);
      next.start += Charge(entry.seconds) / share;
    }
  }
  return ahead;
}

int JobQueue::Position(const std::string& name, absl::Time now) const {
  const auto place = places_.find(name);
  if (place == places_.end()) return 0;
  const Entry& entry = place->second;
  const Tenant& tenant = tenants_.at(entry.tenant);
  const double share = ShareOf(entry.tenant);
  Turn turn = {StartOf(tenant, now), entry.time, entry.number};
  int own = 0;
  for (auto before = tenant.entries.begin(); before->name != name; ++before) {
    ++own;
    turn.start += Charge(before->seconds) / share;
  }
  return own + AheadOf(turn, entry.tenant, now).count;
}

double JobQueue::Remaining(const Running& running, absl::Time now) const {
  const double expected = Expected(running.seconds);
  return std::max(expected - absl::ToDoubleSeconds(now - running.start), kLastPart * expected);
}

std::optional<double> JobQueue::UntilNextEnd(const Tenant* tenant, absl::Time now) const {
  std::optional<double> least;
  for (const auto& [name, job] : running_) {
    if (job.seconds <= 0 || (tenant != nullptr && !tenant->running.contains(name))) continue;
    least = std::min(least.value_or(Remaining(job, now)), Remaining(job, now));
  }
  return least;
}

double JobQueue::SecondsUntilTurn(const std::string& tenant, absl::Time now) const {
  const Tenant nobody;
  const Tenant* known = Find(tenant);
  const Tenant& own = known == nullptr ? nobody : *known;
  const bool held_back = !MayRun(tenant, own);
  const double share = ShareOf(tenant);
  double start = StartOf(own, now);
  if (own.entries.empty()) start = std::max(start, virtual_time_);
  double own_seconds = 0;
  for (const Entry& entry : own.entries) {
    own_seconds += Expected(entry.seconds);
    start += Charge(entry.seconds) / share;
  }
  const Ahead others = AheadOf({start, absl::InfiniteFuture(), 0}, tenant, now);
  const bool is_next = others.count == 0 && own.entries.empty();
  if (is_next && held_back) return UntilNextEnd(&own, now).value_or(0);
  if (is_next) return running() < options_.workers ? 0 : UntilNextEnd(nullptr, now).value_or(0);
  double running_seconds = 0, own_running_seconds = 0;
  for (const auto& [name, job] : running_) {
    running_seconds += Remaining(job, now);
    if (job.tenant == tenant) own_running_seconds += Remaining(job, now);
  }
  const double seconds = (running_seconds + own_seconds + others.seconds) / options_.workers;
  const int limit = LimitsOf(tenant).running;
  return limit > 0 ? std::max(seconds, (own_running_seconds + own_seconds) / limit) : seconds;
}

std::optional<double> JobQueue::SecondsUntilRoom(const std::string& tenant, Room why, absl::Time now) const {
  const Tenant* own = Find(tenant);
  if (why == Room::kServerFull || own == nullptr || own->entries.empty()) return UntilNextEnd(nullptr, now);
  // A place gets free when the first of its own starts.
  if (!MayRun(tenant, *own)) return UntilNextEnd(own, now);
  const Entry& head = *own->entries.begin();
  const Ahead others = AheadOf({StartOf(*own, now), head.time, head.number}, tenant, now);
  std::optional<double> seconds = UntilNextEnd(nullptr, now);
  if (seconds.has_value()) *seconds += others.seconds / options_.workers;
  return seconds;
}

}  // namespace planish
