#include "server/rpc/watch_reactor.h"

#include <algorithm>
#include <memory>
#include <mutex>
#include <optional>
#include <utility>

#include "absl/time/clock.h"
#include "absl/time/time.h"
#include "grpcpp/alarm.h"
#include "server/rpc/call_deadline.h"
#include "server/rpc/grpc_status.h"

namespace planish {
namespace {

// Shorter intervals between progress events are as good as none.
constexpr absl::Duration kUnpacedInterval = absl::Milliseconds(20);

// Owns itself until gRPC is done with it.
template <class Response>
class WatchReactor : public grpc::ServerWriteReactor<Response>,
                     public std::enable_shared_from_this<WatchReactor<Response>> {
 public:
  static WatchReactor* Start(grpc::CallbackServerContext* context, WatchedCall call,
                             const JobStream::Position& position, const StreamSurroundings& surroundings) {
    auto reactor = std::make_shared<WatchReactor>(context, call.write_on, surroundings);
    reactor->self_ = reactor;
    call.find_on.Post([reactor, find = std::move(call.find), position] { reactor->Find(find, position); });
    return reactor.get();
  }

  WatchReactor(grpc::CallbackServerContext* context, TenantTasks write_on, const StreamSurroundings& surroundings)
      : deadline_(DeadlineOf(*context)), write_on_(std::move(write_on)), surroundings_(surroundings) {
    surroundings_.streams->Add();
  }

  ~WatchReactor() override { surroundings_.streams->Remove(); }

  void OnWriteDone(bool ok) override {
    {
      const std::lock_guard lock(mutex_);
      busy_ = false;
      gone_ = gone_ || !ok;
    }
    Pump();
  }

  // The caller went away or its deadline passed.
  void OnCancel() override {
    {
      const std::lock_guard lock(mutex_);
      gone_ = true;
    }
    Detach();
    Pump();
  }

  void OnDone() override {
    subscription_.reset();
    Detach();
    self_.reset();
  }

 private:
  void Find(const JobFinder& find, const JobStream::Position& position) {
    bool gone = false;
    {
      const std::lock_guard lock(mutex_);
      gone = gone_;
    }
    Open(gone ? absl::CancelledError("the caller is gone") : find(), position);
  }

  void Open(absl::StatusOr<WatchedJob> job, const JobStream::Position& position) {
    if (!job.ok()) {
      this->Finish(ToGrpcStatus(job.status()));
      return;
    }
    const std::weak_ptr<WatchReactor> weak = this->weak_from_this();
    // While busy_, which keeps OnDone() away.
    subscription_ = job->events->Subscribe([weak] {
      if (const auto alive = weak.lock()) alive->Pump();
    });
    bool gone = false;
    {
      const std::lock_guard lock(mutex_);
      stream_.emplace(std::move(job->events), position);
      attachment_ = std::move(job->attachment);
      busy_ = false;
      gone = gone_;
    }
    if (gone) Detach();
    Pump();
  }

  // On a task thread: releasing a job writes to the store, which gRPC's own threads must not wait for.
  void Detach() {
    const auto released = std::make_shared<JobAttachment>();
    Parting parting = HasPassed(deadline_) ? Parting::kForGood : Parting::kMayReturn;
    {
      const std::lock_guard lock(mutex_);
      *released = std::move(attachment_);
      if (stream_.has_value() && stream_->job_ended()) parting = Parting::kJobEnded;
    }
    if (released->empty()) return;
    write_on_.Post([released, parting] { released->Release(parting); });
  }

  // Starts the next operation if none is under way. Any thread.
  void Pump() {
    JobStream::Step step = JobStream::Step::kEnd;
    grpc::Status status;
    {
      const std::lock_guard lock(mutex_);
      if (busy_) return;
      if (gone_) {
        status = grpc::Status::CANCELLED;
      } else {
        response_.Clear();
        step = NextStep();
        if (step == JobStream::Step::kWait) return;
        status = ToGrpcStatus(stream_->status());
      }
      busy_ = true;  // for good if this is the end
    }
    // Outside the lock: gRPC may react on this very thread. After Finish() `this` may be gone.
    if (step == JobStream::Step::kEnd) {
      this->Finish(std::move(status));
    } else {
      this->StartWrite(&response_);
    }
  }

  // Requires mutex_.
  JobStream::Step NextStep() {
    v1::JobEvent event;
    v1::UvChunk chunk;
    const absl::Time now = absl::Now();
    const absl::Duration interval = absl::Seconds(surroundings_.streams->count() / surroundings_.progress_per_second);
    const absl::Duration early = last_progress_ + interval - now;
    JobStream::Pace pace = JobStream::Pace::kAll;
    if (interval > kUnpacedInterval) pace = JobStream::Pace::kNewest;
    if (pace != JobStream::Pace::kAll && early > absl::ZeroDuration()) pace = JobStream::Pace::kHold;
    const JobStream::Step step = stream_->Next(&event, &chunk, pace);
    if (pace == JobStream::Pace::kHold && step == JobStream::Step::kWait) WakeIn(std::min(early, interval));
    if (event.has_progress()) last_progress_ = now;
    if (step == JobStream::Step::kEvent) *response_.mutable_event() = std::move(event);
    if (step == JobStream::Step::kUv) {
      surroundings_.streams->AddUvBytes(static_cast<std::int64_t>(chunk.data().size()));
      *response_.mutable_uv() = std::move(chunk);
    }
    return step;
  }

  // Requires mutex_.
  void WakeIn(absl::Duration delay) {
    if (std::exchange(armed_, true)) return;
    const std::weak_ptr<WatchReactor> weak = this->weak_from_this();
    alarm_.Set(absl::ToChronoTime(absl::Now() + delay), [weak](bool) {
      const auto alive = weak.lock();
      if (alive == nullptr) return;
      {
        const std::lock_guard lock(alive->mutex_);
        alive->armed_ = false;
      }
      alive->Pump();
    });
  }

  const std::optional<absl::Time> deadline_;
  const TenantTasks write_on_;
  const StreamSurroundings surroundings_;

  // Set by Start(), dropped by OnDone().
  std::shared_ptr<WatchReactor> self_;
  // Set by Open(), dropped by OnDone().
  JobEventLog::Subscription subscription_;

  std::mutex mutex_;
  // Guarded by mutex_; response_ belongs to gRPC while busy_.
  std::optional<JobStream> stream_;  // set before busy_ is first false
  JobAttachment attachment_;
  Response response_;
  bool busy_ = true;  // Find() is under way
  bool gone_ = false;
  absl::Time last_progress_ = absl::InfinitePast();  // sent
  grpc::Alarm alarm_;                                // wakes us when progress was held back
  bool armed_ = false;
};

}  // namespace

grpc::ServerWriteReactor<v1::UnwrapResponse>* StreamUnwrap(grpc::CallbackServerContext* context, WatchedCall call,
                                                           const JobStream::Position& position,
                                                           const StreamSurroundings& surroundings) {
  return WatchReactor<v1::UnwrapResponse>::Start(context, std::move(call), position, surroundings);
}

grpc::ServerWriteReactor<v1::WatchJobResponse>* StreamWatchJob(grpc::CallbackServerContext* context, WatchedCall call,
                                                               const JobStream::Position& position,
                                                               const StreamSurroundings& surroundings) {
  return WatchReactor<v1::WatchJobResponse>::Start(context, std::move(call), position, surroundings);
}

}  // namespace planish
