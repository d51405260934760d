#include "server/rpc/wait_reactor.h"

#include <memory>
#include <mutex>
#include <utility>

#include "absl/time/clock.h"
#include "grpcpp/alarm.h"
#include "server/rpc/grpc_status.h"

namespace planish {
namespace {

// Lives until OnDone(), which comes after Finish(). The log and the alarm hold weak pointers only.
class WaitReactor : public grpc::ServerUnaryReactor, public std::enable_shared_from_this<WaitReactor> {
 public:
  static grpc::ServerUnaryReactor* Start(WaitedJob job, TenantTasks tasks, v1::Job* response) {
    const auto reactor = std::make_shared<WaitReactor>(std::move(job), std::move(tasks), response);
    reactor->self_ = reactor;
    reactor->tasks_.Post([reactor] { reactor->Open(); });
    return reactor.get();
  }

  WaitReactor(WaitedJob job, TenantTasks tasks, v1::Job* response)
      : job_(std::move(job)), tasks_(std::move(tasks)), response_(response) {}

  void OnCancel() override { End(absl::CancelledError("the caller is gone")); }

  void OnDone() override {
    subscription_.reset();
    self_.reset();
  }

 private:
  void Open() {
    {
      const std::lock_guard lock(mutex_);
      if (ended_) return;  // the caller is gone
    }
    absl::StatusOr<WatchedJob> watched = job_.find();
    if (!watched.ok()) return End(watched.status());
    const std::weak_ptr<WaitReactor> weak = weak_from_this();
    const std::shared_ptr<const JobEventLog> events = watched->events;
    auto subscription = events->Subscribe([weak, log = std::weak_ptr(events)] {
      const auto alive = weak.lock();
      const auto held = log.lock();
      if (alive != nullptr && held != nullptr) alive->Check(*held);
    });
    {
      const std::lock_guard lock(mutex_);
      if (ended_) return;
      subscription_ = std::move(subscription);
      events_ = events;
    }
    Check(*events);
    // Not under the lock: an alarm that is due may ring on this thread.
    alarm_.Set(absl::ToChronoTime(absl::Now() + job_.timeout), [weak](bool) {
      if (const auto alive = weak.lock()) alive->End(absl::OkStatus());
    });
  }

  void Check(const JobEventLog& events) {
    const JobEventLog::Read read = events.ReadAfter(events.last_sequence());
    if (read.ended) End(read.status);
  }

  // Any thread; the first one decides.
  void End(const absl::Status& status) {
    {
      const std::lock_guard lock(mutex_);
      if (std::exchange(ended_, true)) return;
    }
    tasks_.Post([self = shared_from_this(), status] { self->Answer(status); });
  }

  void Answer(const absl::Status& status) {
    if (!status.ok()) return Finish(ToGrpcStatus(status));
    absl::StatusOr<v1::Job> job = job_.get();
    if (job.ok()) *response_ = *std::move(job);
    Finish(ToGrpcStatus(job.status()));
  }

  const WaitedJob job_;
  const TenantTasks tasks_;
  v1::Job* const response_;

  // Set by Start(), dropped by OnDone().
  std::shared_ptr<WaitReactor> self_;

  std::mutex mutex_;
  // Guarded by mutex_; the subscription is dropped by OnDone(), after the end.
  bool ended_ = false;
  std::shared_ptr<const JobEventLog> events_;  // keeps them alive while we wait
  JobEventLog::Subscription subscription_;

  grpc::Alarm alarm_;  // set by Open()
};

}  // namespace

grpc::ServerUnaryReactor* AwaitJob(WaitedJob job, TenantTasks tasks, v1::Job* response) {
  return WaitReactor::Start(std::move(job), std::move(tasks), response);
}

}  // namespace planish
