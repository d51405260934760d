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

namespace planish {
namespace {

// Intervals between progress events that are shorter than this are treated as zero.
constexpr absl::Duration kUnpacedInterval = absl::Milliseconds(20);

template <class Response>
class WatchReactor : public Call {
 public:
  WatchReactor(CallInfo call, JobOpener open, StreamTasks tasks, const StreamSurroundings& surroundings)
      : Call(std::move(call)),
        deadline_(DeadlineOf(*info().context)),
        open_(std::move(open)),
        tasks_(std::move(tasks)),
        surroundings_(surroundings) {}

  ~WatchReactor() override {
    if (is_counted_) surroundings_.streams->Remove();
  }

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

 private:
  void OnMessage(ReceivedMessagePtr message) override {
    surroundings_.streams->Add();
    is_counted_ = true;
    tasks_.open_on.Post([self = Self(), message = std::move(message)] { self->Open(*message); });
  }

  void OnEnd() override {
    subscription_.reset();
    Detach();
  }

  std::shared_ptr<WatchReactor> Self() { return std::static_pointer_cast<WatchReactor>(shared_from_this()); }

  void Open(ReceivedMessage& message) {
    bool is_gone = false;
    {
      const std::lock_guard lock(mutex_);
      is_gone = gone_;
    }
    if (is_gone) return End(absl::CancelledError("the caller is gone"));
    absl::StatusOr<OpenedJob> opened = open_(info(), message);
    if (!opened.ok()) return End(opened.status());
    const std::weak_ptr<WatchReactor> weak = Self();
    // busy_ is still set, so OnEnd() cannot run meanwhile.
    subscription_ = opened->job.events->Subscribe([weak] {
      if (const auto alive = weak.lock()) alive->Pump();
    });
    bool gone = false;
    {
      const std::lock_guard lock(mutex_);
      stream_.emplace(std::move(opened->job.events), opened->position);
      attachment_ = std::move(opened->job.attachment);
      busy_ = false;
      gone = gone_;
    }
    if (gone) Detach();
    Pump();
  }

  // Runs on a task thread, since releasing a job writes to the store, which gRPC's threads must not wait for.
  void Detach() {
    const auto released = std::make_shared<JobAttachment>();
    Parting parting = HasPassed(deadline_) ? Parting::kForGood : Parting::kMayReturn;
    {
      const std::lock_guard lock(mutex_);
      *released = std::move(attachment_);
      if (stream_.has_value() && stream_->job_ended()) parting = Parting::kJobEnded;
    }
    if (released->empty()) return;
    tasks_.release_on.Post([released, parting] { released->Release(parting); });
  }

  // Starts the next operation if none is running. Called on any thread.
  void Pump() {
    JobStream::Step step = JobStream::Step::kEnd;
    Response response;
    absl::Status status;
    {
      const std::lock_guard lock(mutex_);
      if (busy_) return;
      if (gone_) {
        status = absl::CancelledError("");
      } else {
        step = NextStep(&response);
        if (step == JobStream::Step::kWait) return;
        status = stream_->status();
      }
      busy_ = true;  // stays set if this is the end
    }
    // This runs without the lock, since gRPC may react on this very thread. After End() `this` may be gone.
    if (step == JobStream::Step::kEnd) {
      End(status);
    } else {
      Send(response);
    }
  }

  // Fills *response with the next message if there is one to send now. Requires mutex_.
  JobStream::Step NextStep(Response* response) {
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
    if (step == JobStream::Step::kEvent) *response->mutable_event() = std::move(event);
    if (step == JobStream::Step::kUv) {
      surroundings_.streams->AddUvBytes(static_cast<std::int64_t>(chunk.data().size()));
      *response->mutable_uv() = std::move(chunk);
    }
    return step;
  }

  // Has Pump() called after `delay`. Requires mutex_.
  void WakeIn(absl::Duration delay) {
    if (std::exchange(armed_, true)) return;
    const std::weak_ptr<WatchReactor> weak = Self();
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
  const JobOpener open_;
  const StreamTasks tasks_;
  const StreamSurroundings surroundings_;
  bool is_counted_ = false;  // by the StreamCounter; from OnMessage() on

  // Set by Open(), dropped by OnEnd().
  JobEventLog::Subscription subscription_;

  std::mutex mutex_;
  // Guarded by mutex_.
  std::optional<JobStream> stream_;  // set before busy_ is first false
  JobAttachment attachment_;
  bool busy_ = true;  // Open() will run or is running
  bool gone_ = false;
  absl::Time last_progress_ = absl::InfinitePast();  // when progress was last sent
  grpc::Alarm alarm_;                                // fires when held-back progress may be sent
  bool armed_ = false;
};

}  // namespace

std::shared_ptr<Call> StreamUnwrap(CallInfo info, JobOpener open, StreamTasks tasks,
                                   const StreamSurroundings& surroundings) {
  return std::make_shared<WatchReactor<v1::UnwrapResponse>>(std::move(info), std::move(open), std::move(tasks),
                                                            surroundings);
}

std::shared_ptr<Call> StreamWatchJob(CallInfo info, JobOpener open, StreamTasks tasks,
                                     const StreamSurroundings& surroundings) {
  return std::make_shared<WatchReactor<v1::WatchJobResponse>>(std::move(info), std::move(open), std::move(tasks),
                                                              surroundings);
}

}  // namespace planish
