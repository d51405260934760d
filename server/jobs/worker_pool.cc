#include "server/jobs/worker_pool.h"

#include <algorithm>
#include <chrono>
#include <optional>
#include <string>
#include <utility>

#include "absl/strings/match.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/strip.h"
#include "absl/time/clock.h"
#include "core/base/error.h"

namespace planish {
namespace {

using worker::v1::FromWorker;
using Wait = WorkerLink::Wait;

// Measures time; changes of the machine's clock do not affect it.
class Stopwatch {
 public:
  void Restart() { start_ = std::chrono::steady_clock::now(); }
  absl::Duration Elapsed() const { return absl::FromChrono(std::chrono::steady_clock::now() - start_); }

 private:
  std::chrono::steady_clock::time_point start_ = std::chrono::steady_clock::now();
};

std::string StageName(v1::Stage stage) {
  if (stage == v1::STAGE_UNSPECIFIED) return "START";
  return std::string(absl::StripPrefix(v1::Stage_Name(stage), "STAGE_"));
}

WorkerLoss Hung(const std::string& what, v1::Stage stage, absl::Duration time) {
  const std::string seconds = absl::StrCat(absl::ToInt64Milliseconds(time) / 1000.0);
  return {"WORKER_HUNG",
          absl::StrCat("the worker was killed: ", what, " (", seconds, " s, stage ", StageName(stage), ")"),
          {{"stage", StageName(stage)}, {"seconds", seconds}}};
}

}  // namespace

const char* NameOf(WorkerEndCause cause) {
  switch (cause) {
    case WorkerEndCause::kRecycled:
      return "recycled";
    case WorkerEndCause::kGrown:
      return "grown";
    case WorkerEndCause::kCrashed:
      return "crashed";
    case WorkerEndCause::kHung:
      return "hung";
    case WorkerEndCause::kDisobedient:
      return "disobedient";
    case WorkerEndCause::kShutdown:
      return "shutdown";
  }
  return "";
}

// One thread's worker, and the job it has.
class WorkerPool::Seat {
 public:
  explicit Seat(WorkerPool* pool) : pool_(*pool), options_(pool->options_), source_(*pool->source_) {}
  ~Seat() { End(WorkerEndCause::kShutdown, {}, ""); }

  void Run() {
    while (Fill(nullptr)) {
      JobAssignment assignment;
      const Turn turn = source_.TakeNext(options_.idle_look_interval, &assignment);
      if (turn == Turn::kOver) return;
      // The worker may have died while there was nothing to do.
      CheckAlive();
      if (turn == Turn::kNothing) continue;
      if (Fill(&assignment)) {
        Serve(std::move(assignment));
      } else {
        source_.ReportLost(assignment.name, assignment.attempt, {"INTERNAL", "no worker could be started", {}});
      }
    }
  }

 private:
  bool IsWanted(const JobAssignment& assignment) const {
    return source_.ObeyBy(assignment.name, assignment.attempt) > options_.steady_clock();
  }

  // Makes sure that a worker is ready. False if the pool ends first, or if nobody wants `job` (may be null) any more.
  bool Fill(const JobAssignment* job) {
    absl::Duration retry = options_.retry_min;
    for (int failed = 1; link_ == nullptr; ++failed) {
      const absl::Status status = Start();
      if (status.ok()) return true;
      pool_.NoteFailedStart(status, failed);
      if (options_.on_start_failed) options_.on_start_failed(status, retry);
      if (pool_.EndsWithin(retry)) return false;
      if (job != nullptr && !IsWanted(*job)) return false;
      retry = std::min(2 * retry, options_.retry_max);
    }
    return true;
  }

  absl::Status Start() {
    absl::StatusOr<std::shared_ptr<WorkerLink>> link = pool_.factory_();
    if (!link.ok()) return link.status();
    WorkerLink::Received received;
    const absl::Duration limit =
        pool_.any_ready_ ? options_.start_limit : std::min(options_.start_limit, pool_.FirstTimeLeft());
    switch ((*link)->Receive(absl::Now() + limit, &received)) {
      case Wait::kTimeout:
        (*link)->Close();
        return InternalError("a started worker did not become ready: " + (*link)->HowEnded().message);
      case Wait::kClosed:
        return InternalError("a worker ended right after its start: " + (*link)->HowEnded().message);
      case Wait::kMessage:
        break;
    }
    if (!received.message.has_idle()) return InternalError("a started worker sent another message before it was idle");
    pool_.any_ready_ = true;
    link_ = *std::move(link);
    jobs_ = 0;
    traceparent_.clear();
    since_ready_.Restart();
    if (options_.on_worker_ready) options_.on_worker_ready(received.message.idle());
    return absl::OkStatus();
  }

  // Ends the worker, if there is one.
  void End(WorkerEndCause cause, WorkerLoss loss, const std::string& job) {
    if (link_ == nullptr) return;
    link_->Close();
    link_->HowEnded();  // waits until its process is gone, even if others hold the link
    link_ = nullptr;
    if (!options_.on_worker_end) return;
    WorkerEnd end;
    end.cause = cause;
    end.loss = std::move(loss);
    end.job = job;
    end.traceparent = std::move(traceparent_);
    end.jobs = jobs_;
    end.lived = since_ready_.Elapsed();
    options_.on_worker_end(end);
  }

  void CheckAlive() {
    if (link_ == nullptr) return;
    WorkerLink::Received received;
    switch (link_->Receive(absl::InfinitePast(), &received)) {
      case Wait::kTimeout:
        return;
      case Wait::kClosed:
        return End(WorkerEndCause::kCrashed, link_->HowEnded(), "");
      case Wait::kMessage:
        return End(WorkerEndCause::kCrashed, {"INTERNAL", "the worker spoke without a job", {}}, "");
    }
  }

  void Serve(JobAssignment job) {
    traceparent_ = job.request.traceparent();
    worker::v1::ToWorker request;
    *request.mutable_request() = std::move(job.request);
    const double mib = job.blobs.empty() ? 0 : static_cast<double>(job.blobs[0]->bytes().size()) / (1 << 20);
    decode_limit_ = options_.decode_limit + mib * options_.decode_limit_per_mib;
    max_uv_bytes_ = request.request().max_triangles() > 0 ? 6 * sizeof(double) * request.request().max_triangles() : 0;
    stage_ = v1::STAGE_UNSPECIFIED;
    since_start_.Restart();
    since_stage_.Restart();
    since_message_.Restart();
    link_->Send(std::move(request), std::move(job.blobs));
    source_.SetLink(job.name, job.attempt, link_);

    while (true) {
      WorkerLink::Received received;
      const Wait wait = link_->Receive(absl::Now() + NextLook(), &received);
      if (wait == Wait::kClosed) return Lose(job, WorkerEndCause::kCrashed, link_->HowEnded());
      if (wait == Wait::kTimeout) {
        if (IsOverdue(job)) return;
        continue;
      }
      since_message_.Restart();
      FromWorker& message = received.message;
      if (message.has_event()) {
        NoteStage(message.event().progress().stage());
        source_.ReportProgress(job.name, job.attempt, std::move(*message.mutable_event()->mutable_progress()));
        if (IsOverdue(job)) return;
      } else if (message.has_result()) {
        return Finish(job, std::move(*message.mutable_result()), std::move(received.blob));
      } else {
        return Lose(job, WorkerEndCause::kCrashed,
                    {"INTERNAL", "the worker broke the protocol: it reported that it was idle during a job", {}});
      }
    }
  }

  void NoteStage(v1::Stage stage) {
    if (stage == stage_) return;
    stage_ = stage;
    since_stage_.Restart();
  }

  bool IsDecoding() const { return stage_ == v1::STAGE_UNSPECIFIED || stage_ == v1::STAGE_DECODE; }

  absl::Duration NextLook() const {
    absl::Duration left = std::min({options_.look_interval, options_.silence_limit - since_message_.Elapsed(),
                                    options_.job_limit - since_start_.Elapsed()});
    if (IsDecoding()) left = std::min(left, decode_limit_ - since_stage_.Elapsed());
    return std::max(left, absl::ZeroDuration());
  }

  // Kills the worker and returns true if one of its limits has passed.
  bool IsOverdue(const JobAssignment& job) {
    if (IsDecoding() && since_stage_.Elapsed() >= decode_limit_) {
      Lose(job, WorkerEndCause::kHung, Hung("the mesh took too long to decode", stage_, since_stage_.Elapsed()));
    } else if (since_message_.Elapsed() >= options_.silence_limit) {
      Lose(job, WorkerEndCause::kHung, Hung("nothing was heard of it", stage_, since_message_.Elapsed()));
    } else if (since_start_.Elapsed() >= options_.job_limit) {
      Lose(job, WorkerEndCause::kHung, Hung("the job took too long", stage_, since_start_.Elapsed()));
    } else if (source_.ObeyBy(job.name, job.attempt) <= options_.steady_clock()) {
      Lose(job, WorkerEndCause::kDisobedient,
           Hung("it did not end the job when it was told to", stage_, since_start_.Elapsed()));
    } else {
      return false;
    }
    return true;
  }

  // The worker is ended first, so that it is gone when the loss is reported.
  void Lose(const JobAssignment& job, WorkerEndCause cause, WorkerLoss loss) {
    // The link is released here and not by the source, which may hold a lock: the release waits for the end of a worker
    // that is a thread.
    const std::shared_ptr<WorkerLink> link = link_;
    End(cause, loss, job.name);
    source_.ReportLost(job.name, job.attempt, std::move(loss));
  }

  void Finish(const JobAssignment& job, worker::v1::WorkResult result, BlobPtr uv) {
    if (uv != nullptr && max_uv_bytes_ > 0 && uv->bytes().size() > max_uv_bytes_) {
      return Lose(job, WorkerEndCause::kCrashed,
                  {"INTERNAL", "the worker broke the protocol: it sent UV of more triangles than it may take", {}});
    }
    ++jobs_;
    // The state of an allocator that was refused memory is unknown, so the worker is replaced.
    const bool ran_out = result.status().code() == static_cast<int>(absl::StatusCode::kResourceExhausted);
    source_.ReportResult(job.name, job.attempt, std::move(result), std::move(uv));
    WorkerLink::Received received;
    switch (link_->Receive(absl::Now() + options_.start_limit, &received)) {
      case Wait::kTimeout:
        return End(WorkerEndCause::kHung,
                   Hung("it did not become ready again", v1::STAGE_UNSPECIFIED, options_.start_limit), "");
      case Wait::kClosed:
        return End(WorkerEndCause::kCrashed, link_->HowEnded(), "");
      case Wait::kMessage:
        break;
    }
    if (!received.message.has_idle()) {
      return End(WorkerEndCause::kCrashed, {"INTERNAL", "the worker spoke without a job", {}}, "");
    }
    if (jobs_ >= pool_.recycle_after_) return End(WorkerEndCause::kRecycled, {}, "");
    if (ran_out || received.message.idle().held_bytes() > options_.recycle_bytes)
      return End(WorkerEndCause::kGrown, {}, "");
  }

  WorkerPool& pool_;
  const WorkerPoolOptions& options_;
  JobSource& source_;

  std::shared_ptr<WorkerLink> link_;  // null, or a worker that is ready or has a job
  int jobs_ = 0;                      // jobs that the worker has served
  std::string traceparent_;           // of the worker's last job
  Stopwatch since_ready_;

  // State of the running job.
  v1::Stage stage_ = v1::STAGE_UNSPECIFIED;
  Stopwatch since_start_, since_stage_, since_message_;
  absl::Duration decode_limit_;
  std::size_t max_uv_bytes_ = 0;  // 0: any
};

WorkerPool::WorkerPool(JobSource* source, WorkerFactory factory, WorkerPoolOptions options)
    : source_(source),
      factory_(std::move(factory)),
      options_(std::move(options)),
      recycle_after_(options_.recycle_after) {
  for (int i = 0; i < options_.workers; ++i) {
    threads_.emplace_back([this] { Seat(this).Run(); });
  }
}

WorkerPool::~WorkerPool() {
  {
    const std::lock_guard lock(mutex_);
    ending_ = true;
  }
  ending_changed_.notify_all();
  for (std::thread& thread : threads_) thread.join();
}

void WorkerPool::NoteFailedStart(const absl::Status& status, int failed) {
  if (any_ready_ || options_.on_none_ready == nullptr) return;
  if (failed < options_.first_starts && FirstTimeLeft() > absl::ZeroDuration()) return;
  if (!told_.exchange(true)) options_.on_none_ready(status);
}

absl::Duration WorkerPool::FirstTimeLeft() const {
  // After on_none_ready was called, starts have no limit.
  if (told_ || options_.on_none_ready == nullptr) return absl::InfiniteDuration();
  const absl::Duration since = absl::FromChrono(std::chrono::steady_clock::now() - began_);
  return std::max(options_.first_limit - since, absl::ZeroDuration());
}

bool WorkerPool::EndsWithin(absl::Duration duration) {
  std::unique_lock lock(mutex_);
  return ending_changed_.wait_for(lock, absl::ToChronoNanoseconds(duration), [this] { return ending_; });
}

}  // namespace planish
