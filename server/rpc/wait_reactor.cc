#include "server/rpc/wait_reactor.h"

#include <memory>
#include <mutex>
#include <utility>

#include "absl/time/clock.h"
#include "grpcpp/alarm.h"

namespace planish {
namespace {

// A WaitJob call. The log and the alarm hold only weak pointers to it.
class WaitReactor : public Call {
 public:
  WaitReactor(CallInfo call, WaitOpener open, TenantTasks tasks)
      : Call(std::move(call)), open_(std::move(open)), tasks_(std::move(tasks)) {}

  void OnCancel() override { Settle(absl::CancelledError("the caller is gone")); }

 private:
  void OnMessage(ReceivedMessagePtr message) override {
    tasks_.Post([self = Self(), message = std::move(message)] { self->Open(*message); });
  }

  void OnEnd() override { subscription_.reset(); }

  std::shared_ptr<WaitReactor> Self() { return std::static_pointer_cast<WaitReactor>(shared_from_this()); }

  void Open(ReceivedMessage& message) {
    {
      const std::lock_guard lock(mutex_);
      if (settled_) return;  // the caller is gone
    }
    absl::StatusOr<WaitedJob> wait = open_(info(), message);
    if (!wait.ok()) return Settle(wait.status());
    const std::weak_ptr<WaitReactor> weak = Self();
    const std::shared_ptr<const JobEventLog> events = wait->job.events;
    auto subscription = events->Subscribe([weak, log = std::weak_ptr(events)] {
      const auto alive = weak.lock();
      const auto held = log.lock();
      if (alive != nullptr && held != nullptr) alive->Check(*held);
    });
    {
      const std::lock_guard lock(mutex_);
      if (settled_) return;
      get_ = std::move(wait->get);
      subscription_ = std::move(subscription);
      events_ = events;
    }
    Check(*events);
    // Sets the alarm without the lock, since an alarm that is due may fire on this thread.
    alarm_.Set(absl::ToChronoTime(absl::Now() + wait->timeout), [weak](bool) {
      if (const auto alive = weak.lock()) alive->Settle(absl::OkStatus());
    });
  }

  void Check(const JobEventLog& events) {
    const JobEventLog::Read read = events.ReadAfter(events.last_sequence());
    if (read.ended) Settle(read.status);
  }

  // Ends the wait with `status`. Called on any thread; the first call decides the outcome.
  void Settle(const absl::Status& status) {
    {
      const std::lock_guard lock(mutex_);
      if (std::exchange(settled_, true)) return;
    }
    tasks_.Post([self = Self(), status] { self->Answer(status); });
  }

  void Answer(const absl::Status& status) {
    if (!status.ok()) return End(status);
    const absl::StatusOr<v1::Job> job = get_();
    job.ok() ? EndWith(*job) : End(job.status());
  }

  const WaitOpener open_;
  const TenantTasks tasks_;

  std::mutex mutex_;
  // Guarded by mutex_. OnEnd() drops the subscription. `get_` is called after `settled_` was set.
  bool settled_ = false;
  std::function<absl::StatusOr<v1::Job>()> get_;
  std::shared_ptr<const JobEventLog> events_;  // keeps the log alive while the call waits
  JobEventLog::Subscription subscription_;

  grpc::Alarm alarm_;  // set by Open()
};

}  // namespace

std::shared_ptr<Call> AwaitJob(CallInfo info, WaitOpener open, TenantTasks tasks) {
  return std::make_shared<WaitReactor>(std::move(info), std::move(open), std::move(tasks));
}

}  // namespace planish
