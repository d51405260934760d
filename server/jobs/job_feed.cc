#include "server/jobs/job_feed.h"

#include <functional>
#include <map>
#include <optional>
#include <utility>

#include "core/base/error.h"
#include "core/base/status_macros.h"
#include "server/link/rpc_status.h"
#include "server/store/lifecycle.h"

namespace planish {
namespace {

// Poll interval for watched jobs that other processes may change.
constexpr absl::Duration kLookInterval = absl::Seconds(2);
// Most jobs polled per second, however many are watched.
constexpr std::size_t kLookedAtPerSecond = 2000;

}  // namespace

JobFeed::JobFeed(JobContext* context) : context_(*context) {
  subscription_ = context_.store.Subscribe([this](const StoreNews& news) {
    if (news.local) return;  // whoever made the change calls Tell()
    const std::lock_guard lock(mutex_);
    if (news.everything) next_look_ = absl::InfinitePast();
    for (const std::string& name : news.jobs) {
      if (logs_.contains(name)) changed_.insert(name);
    }
  });
}

std::shared_ptr<JobEventLog> JobFeed::Register(const std::string& name, std::int64_t number) {
  const std::lock_guard lock(mutex_);
  std::shared_ptr<JobEventLog> log;
  if (const auto found = logs_.find(name); found != logs_.end()) log = found->second.log.lock();
  if (log != nullptr) return log;
  log = std::make_shared<JobEventLog>(context_.options.events_per_job);
  if (!interrupted_.ok()) {
    log->Interrupt(interrupted_);
    return log;
  }
  if (logs_.size() >= next_clearing_) {
    std::erase_if(logs_, [](const auto& each) { return each.second.log.expired(); });
    next_clearing_ = 64 + 2 * logs_.size();
  }
  logs_[name] = {log, number};
  return log;
}

std::shared_ptr<JobEventLog> JobFeed::Find(const std::string& name) {
  const std::lock_guard lock(mutex_);
  const auto found = logs_.find(name);
  return found == logs_.end() ? nullptr : found->second.log.lock();
}

absl::StatusOr<std::shared_ptr<const JobEventLog>> JobFeed::Open(const JobRecord& record) {
  // A job that has ended no longer changes.
  const bool has_ended = IsTerminal(record.job().state());
  const std::shared_ptr<JobEventLog> log = has_ended ? std::make_shared<JobEventLog>(context_.options.events_per_job)
                                                     : Register(record.job().name(), record.number());
  if (has_ended || log->last_sequence() < record.last_sequence()) {
    PLANISH_RETURN_IF_ERROR(Read(record.job().name(), record.number(), log.get()));
    log->Notify();
  }
  return log;
}

std::shared_ptr<JobEventLog> JobFeed::OpenNew(const std::string& name) {
  return Register(name, 0);
}

void JobFeed::NoteNumber(const std::string& name, std::int64_t number) {
  const std::lock_guard lock(mutex_);
  if (const auto found = logs_.find(name); found != logs_.end()) found->second.number = number;
}

absl::Status JobFeed::Read(const std::string& name, std::int64_t number, JobEventLog* log) {
  PLANISH_ASSIGN_OR_RETURN(std::vector<v1::JobEvent> events, context_.store.Events(number, log->last_sequence()));
  for (v1::JobEvent& event : events) {
    if (!event.has_job() || !IsTerminal(event.job().state())) {
      log->Restore(std::move(event));
      continue;
    }
    // The record has the report, and may say that the UV are gone.
    PLANISH_ASSIGN_OR_RETURN(const std::optional<JobRecord> record, context_.store.Find(name));
    if (record.has_value()) *event.mutable_job() = record->job();
    PLANISH_RETURN_IF_ERROR(Finish(std::move(event), log));
  }
  return absl::OkStatus();
}

absl::Status JobFeed::Finish(v1::JobEvent event, JobEventLog* log) {
  StoredBlobPtr uv;
  if (event.job().state() == v1::JOB_STATE_SUCCEEDED) {
    absl::StatusOr<StoredBlobPtr> found = context_.blobs.Find({event.job().tenant(), event.job().uv().uv_sha256()});
    if (found.ok()) {
      uv = *std::move(found);
    } else if (!IsLost(found.status())) {
      return WithRetryDelay(found.status(), context_.options.retry_delay);  // the UV exist, but cannot be opened now
    }
  }
  log->Restore(std::move(event), std::move(uv));
  return absl::OkStatus();
}

absl::Status JobFeed::EndBehind(const std::string& name, JobEventLog* log) {
  PLANISH_ASSIGN_OR_RETURN(const std::optional<JobRecord> record, context_.store.Find(name));
  if (!record.has_value()) {
    log->Interrupt(JobNotFound(name));
    return absl::OkStatus();
  }
  v1::JobEvent event;
  event.set_sequence(log->last_sequence() + 1);
  *event.mutable_time() = record->job().end_time();
  *event.mutable_job() = record->job();
  return Finish(std::move(event), log);
}

void JobFeed::Tell(const std::vector<JobChange>& changes, const StoredBlobPtr& uv) {
  for (const JobChange& change : changes) {
    for (const v1::JobEvent& event : change.events) {
      if (event.has_job() && context_.options.on_transition) context_.options.on_transition(event.job());
    }
    const std::string& name = change.record.job().name();
    const std::shared_ptr<JobEventLog> log = Find(name);
    if (log == nullptr || change.events.empty()) continue;
    const bool succeeded = change.record.job().state() == v1::JOB_STATE_SUCCEEDED;
    for (const v1::JobEvent& event : change.events) {
      if (log->Append(event, succeeded ? uv : nullptr)) continue;
      // An earlier event of another thread or process is missing. It may arrive later or never, so the store is read.
      if (const absl::Status status = Read(name, change.record.number(), log.get()); !status.ok()) {
        context_.TellError(status);
        const std::lock_guard lock(mutex_);
        changed_.insert(name);
      }
      break;
    }
    log->Notify();
  }
}

void JobFeed::LookAtAll(const std::map<std::string, Entry>& entries) {
  std::vector<std::int64_t> numbers;
  for (const auto& [name, entry] : entries) numbers.push_back(entry.number);
  const absl::StatusOr<std::vector<JobPosition>> found = context_.store.Positions(numbers);
  if (!found.ok()) {
    context_.TellError(found.status());
    return;
  }
  std::map<std::int64_t, JobPosition> positions;
  for (const JobPosition& position : *found) positions[position.number] = position;
  for (const auto& [name, entry] : entries) {
    const auto position = positions.find(entry.number);
    const bool there = position != positions.end();
    ReadNew(name, entry, [&, &name = name, &entry = entry](JobEventLog* log) {
      if (there && position->second.last_sequence > log->last_sequence()) return Read(name, entry.number, log);
      return !there || position->second.ended ? EndBehind(name, log) : absl::OkStatus();
    });
  }
}

void JobFeed::ReadNew(const std::string& name, const Entry& entry,
                      const std::function<absl::Status(JobEventLog*)>& read) {
  const std::shared_ptr<JobEventLog> log = entry.log.lock();
  if (log == nullptr || log->ended()) return;
  const std::int64_t before = log->last_sequence();
  if (const absl::Status status = read(log.get()); !status.ok()) {
    context_.TellError(status);
    const std::lock_guard lock(mutex_);
    changed_.insert(name);
  }
  if (log->last_sequence() != before || log->ended()) log->Notify();
}

void JobFeed::Refresh() {
  std::map<std::string, Entry> changed, all;
  {
    const std::lock_guard lock(mutex_);
    const absl::Time now = context_.options.steady_clock();
    std::set<std::string> later;
    for (const std::string& name : changed_) {
      const auto found = logs_.find(name);
      if (found == logs_.end()) continue;
      found->second.number == 0 ? void(later.insert(name)) : void(changed.insert(*found));
    }
    changed_.swap(later);
    if (now >= next_look_) {
      std::erase_if(logs_, [](const auto& each) { return each.second.log.expired(); });
      next_look_ = now + kLookInterval + absl::Seconds(1) * (logs_.size() / kLookedAtPerSecond);
      if (context_.store.is_shared()) {
        for (const auto& [name, entry] : logs_) {
          if (entry.number != 0) all.emplace(name, entry);
        }
      }
    }
  }
  for (const auto& [name, entry] : changed) {
    ReadNew(name, entry, [&, &name = name, &entry = entry](JobEventLog* log) { return Read(name, entry.number, log); });
  }
  LookAtAll(all);
}

void JobFeed::Interrupt(const absl::Status& status) {
  std::vector<std::shared_ptr<JobEventLog>> logs;
  {
    const std::lock_guard lock(mutex_);
    interrupted_ = status;
    for (const auto& [name, entry] : logs_) {
      if (std::shared_ptr<JobEventLog> log = entry.log.lock()) logs.push_back(std::move(log));
    }
  }
  for (const auto& log : logs) {
    log->Interrupt(status);
    log->Notify();
  }
}

}  // namespace planish
