#include "server/worker/worker.h"

#include <condition_variable>
#include <memory>
#include <mutex>
#include <optional>
#include <thread>
#include <utility>

#include "core/base/heap.h"
#include "core/base/interrupter.h"
#include "server/link/rpc_status.h"
#include "server/worker/failpoints.h"
#include "server/worker/process_memory.h"
#include "server/worker/work.h"

namespace planish {
namespace {

// Free memory that a process keeps between jobs: as much as 250,000 triangles take. Getting memory back from the
// kernel, which clears it, costs a job of 200,000 triangles up to a fifth of its time.
constexpr std::size_t kWarmBytes = std::size_t{256} << 20;

using worker::v1::FromWorker;
using worker::v1::WorkRequest;

struct Order {
  ServerLink::Received received;
  Interrupter cancel;
  Interrupter stop;
};

// The orders of the server. Reads them on its own thread until the link closes, also while a job runs. Thread-safe.
class Orders {
 public:
  explicit Orders(ServerLink* server) : server_(server), listener_([this] { Listen(); }) {}
  ~Orders() {
    server_->Close();
    listener_.join();
  }

  // Waits for the next job, after the previous one has ended; null when the link is closed.
  std::shared_ptr<const Order> Next() {
    std::unique_lock lock(mutex_);
    present_ = nullptr;
    changed_.wait(lock, [this] { return closed_ || next_ != nullptr; });
    present_ = std::exchange(next_, nullptr);
    return present_;
  }

 private:
  void Listen() {
    while (std::optional<ServerLink::Received> received = server_->Receive()) {
      const std::lock_guard lock(mutex_);
      if (received->message.has_request()) {
        next_ = std::make_shared<Order>();
        next_->received = *std::move(received);
        changed_.notify_all();
        continue;
      }
      // A cancel or stop is for the job that was sent last; no effect if that has ended.
      Order* const order = next_ != nullptr ? next_.get() : present_.get();
      if (order == nullptr) continue;
      if (received->message.has_cancel()) order->cancel.Interrupt();
      if (received->message.has_stop()) order->stop.Interrupt();
    }
    const std::lock_guard lock(mutex_);
    closed_ = true;
    for (const auto& order : {next_, present_}) {
      if (order != nullptr) order->cancel.Interrupt();
    }
    next_ = nullptr;
    changed_.notify_all();
  }

  ServerLink* const server_;
  std::mutex mutex_;
  std::condition_variable changed_;
  // Guarded by mutex_.
  std::shared_ptr<Order> next_, present_;
  bool closed_ = false;

  std::thread listener_;
};

WorkOutcome WorkOn(const Order& order, ServerLink& server,
                   const std::function<absl::Status(std::string_view)>& at_point) {
  WorkControl control;
  control.cancel = &order.cancel;
  control.stop = &order.stop;
  control.at_point = at_point;
  control.on_progress = [&server](const v1::Progress& progress) {
    FromWorker event;
    *event.mutable_event()->mutable_progress() = progress;
    server.Send(std::move(event));
  };
  WorkOutcome outcome;
  if (const absl::Status status = at_point("start"); !status.ok()) {
    *outcome.result.mutable_status() = ToRpcStatus(status);
    return outcome;
  }
  outcome = DoWork(order.received.message.request(), order.received.blobs, control);
  if (const absl::Status status = at_point("result"); !status.ok()) {
    *outcome.result.mutable_status() = ToRpcStatus(status);
  }
  return outcome;
}

void Serve(const Order& order, ServerLink& server, const WorkerSettings& settings) {
  const WorkRequest& request = order.received.message.request();
  const absl::StatusOr<Failpoint> failpoint = Failpoint::Parse(settings.failpoints ? request.failpoint() : "");
  const FailpointHooks hooks = {settings.send_garbage, [&server] { server.Close(); }};
  const auto at_point = [&](std::string_view point) -> absl::Status {
    if (!failpoint.ok()) return failpoint.status();
    return ReachPoint(*failpoint, point, hooks);
  };
  WorkOutcome outcome;
  if (settings.owns_process) {
    const MemoryLimit limit(request.memory_bytes(), request.expected_bytes(), request.max_threads());
    ResetPeakMemory();
    outcome = WorkOn(order, server, at_point);
  } else {
    outcome = WorkOn(order, server, at_point);
  }
  FromWorker answer;
  *answer.mutable_result() = std::move(outcome.result);
  server.Send(std::move(answer), std::move(outcome.uv));
  // The job has ended, so this status no longer matters.
  at_point("idle").IgnoreError();
}

}  // namespace

void ServeJobs(ServerLink& server, const WorkerSettings& settings) {
  Orders orders(&server);
  while (true) {
    FromWorker idle;
    *idle.mutable_idle() = settings.idle;
    if (settings.owns_process) idle.mutable_idle()->set_held_bytes(HeldBytes());
    server.Send(std::move(idle));
    const std::shared_ptr<const Order> order = orders.Next();
    if (order == nullptr) return;
    Serve(*order, server, settings);
    ReturnFreedMemory(settings.owns_process ? kWarmBytes : 0);
  }
}

void RunWorker(ServerLink& server) {
  ServeJobs(server, {});
}

}  // namespace planish
