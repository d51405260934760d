#include "server/jobs/job_runner.h"

#include <algorithm>
#include <chrono>
#include <functional>
#include <utility>

#include "absl/strings/str_cat.h"
#include "core/base/error.h"
#include "core/base/sha256.h"
#include "core/base/status_macros.h"
#include "server/link/rpc_status.h"
#include "server/store/lifecycle.h"

namespace planish {
namespace {

// Weight of a new measurement in the seconds factor. A measured ratio counts as at most kMostFactor, and at least 1 /
// kMostFactor.
constexpr double kLearningRate = 0.2;
constexpr double kMostFactor = 100;

// Work that ran out of its reserved memory is queued again with kEnlargement times as much, at most kMostEnlargements
// times.
constexpr int kEnlargement = 2;
constexpr int kMostEnlargements = 2;

// Poll intervals: for work, if the store sends notifications; and for work and desired states, if it sends none.
constexpr absl::Duration kWorkLookInterval = absl::Seconds(2);
constexpr absl::Duration kDeafLookInterval = absl::Seconds(1);
// Pending reports of progress that are written at once, before the interval has passed. If they cannot be written, this
// many of the newest are kept.
constexpr std::size_t kManyProgress = 1024;
constexpr std::size_t kMostProgress = 4096;
// Progress reports that all workers of a farm write per second. At this rate PostgreSQL still has most of its time for
// the jobs themselves (deploy/FARM.md, "How large").
constexpr double kReportsPerSecond = 200;

// Whether the worker was lost because memory ran out. This is not retried, since another attempt would need as much.
bool IsOutOfMemory(const WorkerLoss& loss) {
  return loss.reason == "OUT_OF_MEMORY";
}

bool IsSameLease(const Lease& one, const Lease& other) {
  return one.work == other.work && one.attempt == other.attempt && one.owner == other.owner;
}

// The record of one of the jobs that share the work.
const JobRecord& FirstOf(const ClaimedWork& work) {
  return work.jobs.front().record;
}

}  // namespace

JobRunner::JobRunner(JobContext* context, JobFeed* feed, JobRetention* retention, std::string owner)
    : context_(*context), feed_(*feed), retention_(*retention), owner_(std::move(owner)), pace_(owner_) {
  subscription_ = context_.store.Subscribe([this](const StoreNews& news) {
    const std::lock_guard lock(mutex_);
    if (news.everything) {
      for (auto& [name, attempt] : attempts_) attempt.look = true;
    }
    missed_ = missed_ || (claiming_ && !news.works.empty());
    for (const std::string& work : news.works) {
      if (const auto found = attempts_.find(work); found != attempts_.end()) found->second.look = true;
    }
    if (!news.work) return;
    may_claim_ = true;
    changed_.notify_all();
  });
}

JobRunner::Attempt* JobRunner::Find(const std::string& name, int attempt) {
  const auto found = attempts_.find(name);
  if (found == attempts_.end() || found->second.work.lease.attempt != attempt || found->second.ended) return nullptr;
  return &found->second;
}

int JobRunner::running() const {
  const std::lock_guard lock(mutex_);
  return static_cast<int>(attempts_.size());
}

absl::Status JobRunner::CheckWritten(const std::string& work, const std::string& job) const {
  const std::lock_guard lock(mutex_);
  if (!unwritten_.contains(work)) return absl::OkStatus();
  return WithRetryDelay(MakeError(absl::StatusCode::kResourceExhausted, "STORAGE_FULL",
                                  absl::StrCat("how ", job, " ended cannot be written for now")),
                        context_.options.retry_delay);
}

void JobRunner::Tell(const std::vector<JobChange>& changes, const StoredBlobPtr& uv) {
  feed_.Tell(changes, uv);
  retention_.NoteEnds(changes);
}

// ---- starting work

Turn JobRunner::TakeNext(absl::Duration patience, JobAssignment* assignment) {
  const auto until = std::chrono::steady_clock::now() + absl::ToChronoNanoseconds(std::min(patience, absl::Hours(24)));
  std::unique_lock lock(mutex_);
  const auto may_claim = [this] {
    return may_claim_ && !claiming_ && context_.options.steady_clock() >= std::max(next_start_, next_claim_);
  };
  for (;;) {
    ++waiting_;
    const auto pause = absl::ToChronoNanoseconds(next_claim_ - context_.options.steady_clock());
    const auto claim_at = std::chrono::steady_clock::now() + pause;
    const auto wake = may_claim_ && pause.count() > 0 ? std::min(until, claim_at) : until;
    const bool woken = changed_.wait_until(lock, wake, [&] { return stopped_ || !ready_.empty() || may_claim(); });
    if (woken && !stopped_ && ready_.empty()) Claim(&lock);
    --waiting_;
    if (stopped_) return Turn::kOver;
    if (ready_.empty()) {
      if (std::chrono::steady_clock::now() >= until) return Turn::kNothing;
      continue;
    }
    const ClaimedWork work = std::move(ready_.front());
    ready_.pop_front();
    lock.unlock();
    if (Prepare(work, assignment)) return Turn::kWork;
    lock.lock();
  }
}

void JobRunner::Claim(std::unique_lock<std::mutex>* lock) {
  claiming_ = true;
  may_claim_ = missed_ = false;
  ClaimRequest request;
  request.owner = owner_;
  request.lease = context_.options.lease;
  request.most = std::min(waiting_, context_.options.workers - static_cast<int>(attempts_.size()));
  request.most = std::max(request.most, 1);
  request.memory_bytes = context_.options.memory_bytes;
  request.tenant_limits = context_.options.tenant_limits;
  if (context_.options.short_workers > 0) {
    request.long_from = context_.options.short_time;
    request.most_long = context_.options.workers - context_.options.short_workers;
  }
  request.seconds_factor = seconds_factor_;
  lock->unlock();
  ClaimWait wait;
  const bool may_begin = retention_.HasRoomForResults();
  absl::StatusOr<std::vector<ClaimedWork>> claimed = std::vector<ClaimedWork>();
  if (may_begin) claimed = context_.store.Claim(context_.Verb(), request, &wait);
  const absl::Time next_claim =
      pace_.Next(context_.options.steady_clock(), context_.Pace(kClaimsPerSecond, kLeastClaimInterval), wait.queued);
  if (claimed.ok()) {
    for (const ClaimedWork& work : *claimed) feed_.Tell(work.jobs);
  } else {
    Postpone(claimed.status());
  }
  lock->lock();
  claiming_ = false;
  next_claim_ = next_claim;
  if (claimed.ok()) {
    const absl::Time now = context_.options.steady_clock();
    for (const ClaimedWork& work : *claimed) {
      Attempt& attempt = attempts_[work.lease.work];
      // The database forgot this claim (a crash loses its last moments) and granted the work again under the same
      // lease: the worker that has it goes on, and no other one starts.
      if (IsSameLease(attempt.work.lease, work.lease)) {
        attempt.renewed = now;
        attempt.look = true;
        continue;
      }
      if (attempt.link != nullptr) attempt.link->Close();
      attempt = Attempt();
      attempt.work = work;
      attempt.start = attempt.reported = attempt.renewed = now;
      attempt.wish = work.wish;
      attempt.look = missed_;
      ready_.push_back(work);
    }
    if (wait.gave_up || static_cast<int>(claimed->size()) == request.most) may_claim_ = true;
  } else {
    may_claim_ = true;
  }
  changed_.notify_all();
}

absl::Status JobRunner::MeshLost(const absl::Status& why) {
  return MakeError(absl::StatusCode::kDataLoss, "MESH_LOST",
                   absl::StrCat("the server's store has lost the mesh, send it again: ", why.message()));
}

bool JobRunner::Prepare(const ClaimedWork& work, JobAssignment* assignment) {
  const JobRecord& record = FirstOf(work);
  absl::StatusOr<std::vector<BlobPtr>> blobs = LoadBlobs(record);
  if (!blobs.ok()) {
    absl::Status status = blobs.status();
    if (IsLost(status)) {
      // `forget` frees the jobs' request ids, so that a caller who has the mesh can send it again for a new job.
      const google::rpc::Status error = ToRpcStatus(MeshLost(status));
      status = absl::OkStatus();
      for (const JobChange& job : work.jobs) {
        absl::StatusOr<JobChange> change =
            context_.store.Fail(context_.Verb(), job.record.job().name(), error, /*forget=*/true);
        if (change.ok()) {
          Tell({*std::move(change)});
        } else {
          status = change.status();
        }
      }
    }
    if (!status.ok()) Postpone(status);
    // The work's remaining jobs are queued again.
    const absl::StatusOr<std::vector<JobChange>> released =
        context_.store.Release(context_.Verb(), owner_, work.lease.work);
    if (released.ok()) {
      Tell(*released);
    } else {
      context_.TellError(released.status());  // the lease expires by itself
    }
    Forget(work.lease);
    return false;
  }
  const v1::Job& job = record.job();
  *assignment = JobAssignment();
  assignment->name = work.lease.work;
  assignment->attempt = work.lease.attempt;
  assignment->blobs = *std::move(blobs);
  worker::v1::WorkRequest& request = assignment->request;
  request.set_job(work.lease.work);
  *request.mutable_options() = job.options();
  request.set_max_threads(context_.options.threads);
  if (record.has_array_vertices()) request.set_array_vertices(record.array_vertices());
  // The job may take no more than its reservation, since the rest belongs to the other running jobs.
  request.set_expected_bytes(work.memory_bytes);
  request.set_memory_bytes(work.memory_bytes);
  request.set_max_triangles(context_.options.max_triangles);
  request.set_failpoint(record.failpoint());
  request.set_traceparent(job.traceparent());
  return true;
}

absl::StatusOr<std::vector<BlobPtr>> JobRunner::LoadBlobs(const JobRecord& record) {
  std::vector<BlobPtr> blobs;
  for (const std::string& sha256 : {record.mesh_sha256(), record.elements_sha256()}) {
    if (sha256.empty()) continue;
    PLANISH_ASSIGN_OR_RETURN(BlobPtr blob, context_.blobs.Load({record.job().tenant(), sha256}));
    blobs.push_back(std::move(blob));
  }
  return blobs;
}

void JobRunner::Postpone(const absl::Status& why) {
  context_.TellError(why);
  const std::lock_guard lock(mutex_);
  next_start_ = context_.options.steady_clock() + context_.options.retry_delay;
}

void JobRunner::Forget(const Lease& lease) {
  const std::lock_guard lock(mutex_);
  const auto found = attempts_.find(lease.work);
  // The work may have been claimed again since its end was written.
  if (found != attempts_.end() && found->second.work.lease.attempt == lease.attempt) attempts_.erase(found);
}

// ---- desired states and leases

void JobRunner::SetLink(const std::string& name, int attempt, std::shared_ptr<WorkerLink> link) {
  const std::lock_guard lock(mutex_);
  Attempt* found = Find(name, attempt);
  if (found == nullptr) return;
  found->link = std::move(link);
  TellWish(found);
}

absl::Time JobRunner::ObeyBy(const std::string& name, int attempt) {
  const std::lock_guard lock(mutex_);
  const Attempt* found = Find(name, attempt);
  return found == nullptr ? absl::InfinitePast() : found->obey_by;
}

void JobRunner::TellWish(Attempt* attempt) {
  if (attempt->wish == attempt->told || attempt->link == nullptr) return;
  worker::v1::ToWorker message;
  if (attempt->wish == Wish::kCancel) {
    message.mutable_cancel();
  } else if (attempt->wish == Wish::kStop) {
    message.mutable_stop();
  } else {
    return;
  }
  attempt->told = attempt->wish;
  attempt->link->Send(std::move(message));
}

void JobRunner::ObeyWishes() {
  std::vector<Lease> leases;
  {
    const std::lock_guard lock(mutex_);
    for (auto& [name, attempt] : attempts_) {
      if (attempt.look && !attempt.ended) leases.push_back(attempt.work.lease);
      attempt.look = false;
    }
  }
  if (!leases.empty()) Renew(leases);
}

void JobRunner::LookForWishes() {
  const absl::StatusOr<std::vector<std::pair<std::string, Wish>>> wishes = context_.store.Wishes(owner_);
  if (!wishes.ok()) return context_.TellError(wishes.status());
  const std::lock_guard lock(mutex_);
  for (const auto& [work, wish] : *wishes) {
    const auto found = attempts_.find(work);
    if (found != attempts_.end() && found->second.wish != wish) found->second.look = true;
  }
}

void JobRunner::Renew(const std::vector<Lease>& leases) {
  const absl::Time now = context_.options.steady_clock();
  const absl::StatusOr<std::vector<Wish>> wishes = context_.store.Renew(leases, context_.options.lease);
  if (!wishes.ok()) context_.TellError(wishes.status());
  const std::lock_guard lock(mutex_);
  for (std::size_t i = 0; i < leases.size(); ++i) {
    Attempt* const attempt = Find(leases[i].work, leases[i].attempt);
    if (attempt == nullptr) continue;
    if (!wishes.ok()) {
      attempt->look = true;
      continue;
    }
    attempt->renewed = now;
    const Wish wish = (*wishes)[i];
    if (wish == Wish::kGiveUp) {
      // Nobody wants the result any more, or another server runs the work.
      if (attempt->link != nullptr) attempt->link->Close();
      attempts_.erase(leases[i].work);
      continue;
    }
    if (wish == Wish::kCancel && attempt->wish != Wish::kCancel) {
      attempt->obey_by = now + context_.options.obey_limit;
    }
    attempt->wish = wish;
    TellWish(attempt);
  }
}

void JobRunner::Tick() {
  std::vector<Lease> leases;
  std::vector<std::string> reports;
  std::vector<Ending> endings;
  const absl::Duration interval = ReportInterval();
  const bool hears = context_.store.hears_others();
  bool asks_wishes = false;
  {
    const std::lock_guard lock(mutex_);
    const absl::Time now = context_.options.steady_clock();
    const absl::Duration renewal = context_.options.lease / kRenewalsPerLease;
    for (auto& [name, attempt] : attempts_) {
      // Leases renewed less than half an interval ago wait for the next round, since much work is short.
      if (now >= next_renewal_ && now - attempt.renewed >= renewal / 2) leases.push_back(attempt.work.lease);
      const bool due = now - attempt.reported >= interval;
      if (due && !attempt.progress.empty()) reports.push_back(name);
    }
    if (now >= next_renewal_) next_renewal_ = now + renewal;
    for (auto& [name, ending] : unwritten_) endings.push_back(std::move(ending));
    unwritten_.clear();
    if (now >= next_look_) {
      next_look_ = now + (hears ? kWorkLookInterval : kDeafLookInterval);
      may_claim_ = true;
      asks_wishes = !hears && !attempts_.empty();
    }
    if (may_claim_ && now >= next_start_) changed_.notify_all();
  }
  for (Ending& ending : endings) End(std::move(ending));
  if (!leases.empty()) Renew(leases);
  if (asks_wishes) LookForWishes();
  ObeyWishes();
  for (const std::string& work : reports) WriteProgress(work);
}

// ---- progress

absl::Duration JobRunner::ReportInterval() const {
  const absl::Duration interval = context_.options.report_interval;
  if (!context_.store.is_shared() || interval == absl::ZeroDuration()) return interval;
  return std::max(interval, absl::Seconds(context_.Capacity().workers / kReportsPerSecond));
}

void JobRunner::ReportProgress(const std::string& name, int attempt, v1::Progress progress) {
  const absl::Duration interval = ReportInterval();
  {
    const std::lock_guard lock(mutex_);
    Attempt* found = Find(name, attempt);
    if (found == nullptr) return;
    if (found->progress.size() >= kMostProgress) found->progress.erase(found->progress.begin());
    found->progress.push_back(std::move(progress));
    const bool is_due = context_.options.steady_clock() - found->reported >= interval;
    if (!is_due && found->progress.size() < kManyProgress) return;
  }
  WriteProgress(name);
}

void JobRunner::WriteProgress(const std::string& work) {
  Lease lease;
  std::vector<v1::Progress> progress;
  {
    const std::lock_guard lock(mutex_);
    const auto found = attempts_.find(work);
    if (found == attempts_.end()) return;
    Attempt& attempt = found->second;
    if (attempt.reporting || attempt.ended || attempt.progress.empty()) return;
    attempt.reporting = true;
    attempt.reported = context_.options.steady_clock();
    progress.swap(attempt.progress);
    lease = attempt.work.lease;
  }
  const absl::StatusOr<std::vector<JobChange>> changes = context_.store.Report(context_.Verb(), lease, progress);
  if (changes.ok()) {
    feed_.Tell(*changes);
  } else if (!absl::IsAborted(changes.status())) {
    context_.TellError(changes.status());
  }
  const std::lock_guard lock(mutex_);
  changed_.notify_all();
  const auto found = attempts_.find(work);
  if (found == attempts_.end() || found->second.work.lease.attempt != lease.attempt) return;
  Attempt& attempt = found->second;
  attempt.reporting = false;
  if (absl::IsAborted(changes.status())) attempt.look = true;
  if (changes.ok() || absl::IsAborted(changes.status())) return;
  attempt.progress.insert(attempt.progress.begin(), progress.begin(), progress.end());
  while (attempt.progress.size() > kMostProgress) attempt.progress.erase(attempt.progress.begin());
}

// ---- ends

std::optional<JobRunner::Ending> JobRunner::BeginEnd(const std::string& name, int attempt) {
  std::unique_lock lock(mutex_);
  // Progress is written before the end.
  changed_.wait(lock, [&] {
    const Attempt* found = Find(name, attempt);
    return found == nullptr || !found->reporting;
  });
  Attempt* found = Find(name, attempt);
  if (found == nullptr) return std::nullopt;
  found->ended = true;
  Ending ending;
  ending.work = found->work;
  ending.outcome.progress = std::move(found->progress);
  ending.duration = context_.options.steady_clock() - found->start;
  return ending;
}

void JobRunner::ReportResult(const std::string& name, int attempt, worker::v1::WorkResult result, BlobPtr uv) {
  std::optional<Ending> ending = BeginEnd(name, attempt);
  if (!ending.has_value()) return;
  const bool succeeded = result.status().code() == 0;
  const double expected = absl::ToDoubleSeconds(ending->work.run_time);
  if (succeeded && expected > 0) {
    const double ratio = std::clamp(absl::ToDoubleSeconds(ending->duration) / expected, 1 / kMostFactor, kMostFactor);
    seconds_factor_ = seconds_factor_ + kLearningRate * (ratio - seconds_factor_);
  }
  const std::int64_t larger = LargerReservation(ending->work, result.status());
  if (larger > 0) {
    ending->outcome.memory_bytes = larger;
    ending->loss = {"OUT_OF_MEMORY", result.status().message(), {}};
    return End(*std::move(ending));
  }
  if (succeeded && uv == nullptr) *result.mutable_status() = ToRpcStatus(InternalError("the worker sent no UV"));
  if (context_.options.observer != nullptr) {
    context_.options.observer->OnWorkEnded(FirstOf(ending->work).job(), result, ending->duration);
  }
  ending->outcome.status = std::move(*result.mutable_status());
  ending->outcome.report = std::move(*result.mutable_report());
  ending->outcome.uv = std::move(*result.mutable_uv());
  if (succeeded) ending->uv_bytes = std::move(uv);
  End(*std::move(ending));
}

std::int64_t JobRunner::LargerReservation(const ClaimedWork& work, const google::rpc::Status& status) const {
  if (ReasonOf(status) != "OUT_OF_MEMORY" || FirstOf(work).enlargements() >= kMostEnlargements) return 0;
  const std::int64_t most = context_.MostMemory(FirstOf(work).job().tenant());
  return work.memory_bytes < most ? std::min(kEnlargement * work.memory_bytes, most) : 0;
}

absl::Status JobRunner::KeepUv(Ending* ending) {
  if (ending->uv_bytes == nullptr) return absl::OkStatus();
  const std::string& tenant = FirstOf(ending->work).job().tenant();
  const std::string& sha256 = ending->outcome.uv.uv_sha256();
  ending->hold = retention_.Hold({tenant, sha256});
  absl::StatusOr<StoredBlobPtr> kept = PutUv(*ending);
  if (absl::IsUnavailable(kept.status())) return kept.status();
  ending->uv_bytes = nullptr;  // now in the store
  if (kept.ok()) {
    ending->uv = *std::move(kept);
    ending->outcome.blobs = retention_.Pending(tenant, {sha256});
  } else {
    ending->outcome.status = ToRpcStatus(kept.status());
  }
  return absl::OkStatus();
}

absl::StatusOr<StoredBlobPtr> JobRunner::PutUv(const Ending& ending) {
  const std::string_view bytes = ending.uv_bytes->bytes();
  const v1::UvDescription& description = ending.outcome.uv;
  if (description.total_bytes() != static_cast<std::int64_t>(bytes.size())) {
    return InternalError("the worker sent UV of another length than it says");
  }
  const std::string sha256 = Sha256(bytes);
  if (sha256 != description.uv_sha256()) return InternalError("the worker sent other UV than it says");
  return retention_.Put(FirstOf(ending.work).job().tenant(), bytes, sha256);
}

void JobRunner::ReportLost(const std::string& name, int attempt, WorkerLoss loss) {
  std::optional<Ending> ending = BeginEnd(name, attempt);
  if (!ending.has_value()) return;
  bool stopped = false;
  {
    const std::lock_guard lock(mutex_);
    stopped = stopped_ && !context_.store.is_shared();  // no other worker could retry it
  }
  ending->outcome.loss = {loss.reason, loss.message, loss.metadata, IsOutOfMemory(loss) || stopped};
  ending->loss = std::move(loss);
  End(*std::move(ending));
}

void JobRunner::End(Ending ending) {
  const std::string work = ending.work.lease.work;
  const absl::Status kept = KeepUv(&ending);
  const absl::StatusOr<std::vector<JobChange>> changes =
      kept.ok() ? context_.store.Finish(context_.Verb(), ending.work.lease, ending.outcome)
                : absl::StatusOr<std::vector<JobChange>>(kept);
  if (!changes.ok() && !absl::IsAborted(changes.status())) {
    context_.TellError(changes.status());
    const std::lock_guard lock(mutex_);
    unwritten_.insert_or_assign(work, std::move(ending));
    return;
  }
  Forget(ending.work.lease);
  if (!changes.ok()) return;  // all jobs of the work have ended in another way, or another server runs it
  retention_.Committed(ending.outcome.blobs);
  if (!ending.loss.reason.empty() && context_.options.observer != nullptr) {
    const auto again = std::count_if(changes->begin(), changes->end(), [](const JobChange& change) {
      return change.record.job().state() == v1::JOB_STATE_QUEUED;
    });
    context_.options.observer->OnWorkLost(FirstOf(ending.work).job(), ending.loss, static_cast<int>(again),
                                          ending.duration);
  }
  ending.hold.Release();
  Tell(*changes, ending.uv);
  if (context_.on_end) context_.on_end();
}

void JobRunner::Stop() {
  std::unique_lock lock(mutex_);
  stopped_ = true;
  changed_.notify_all();
  changed_.wait(lock, [this] { return !claiming_; });
}

void JobRunner::CloseLinks() {
  const std::lock_guard lock(mutex_);
  for (const auto& [name, attempt] : attempts_) {
    if (attempt.link != nullptr) attempt.link->Close();
  }
}

void JobRunner::GiveBack() {
  std::vector<Ending> endings;
  {
    const std::lock_guard lock(mutex_);
    for (auto& [name, ending] : unwritten_) endings.push_back(std::move(ending));
    unwritten_.clear();
  }
  // An end that cannot be written now is lost, and its jobs run again.
  for (Ending& ending : endings) End(std::move(ending));
  const absl::Status released = context_.store.Release(context_.Verb(), owner_).status();
  if (!released.ok()) context_.TellError(released);
  CloseLinks();
  const std::lock_guard lock(mutex_);
  attempts_.clear();
  unwritten_.clear();
  ready_.clear();
  changed_.notify_all();
}

}  // namespace planish
