#include "server/link/in_process_link.h"

#include <atomic>
#include <chrono>
#include <condition_variable>
#include <deque>
#include <exception>
#include <mutex>
#include <system_error>
#include <thread>
#include <utility>

#include "absl/time/clock.h"
#include "core/base/error.h"

namespace planish {
namespace {

using worker::v1::FromWorker;
using worker::v1::ToWorker;

// One direction of the link. The queue needs no limit: a worker limits how often it reports progress, and the server
// sends a few messages for each job. Thread-safe.
template <typename Item>
class Pipe {
 public:
  void Push(Item item) {
    const std::lock_guard lock(mutex_);
    if (closed_) return;
    items_.push_back(std::move(item));
    changed_.notify_one();
  }

  WorkerLink::Wait Pop(absl::Time deadline, Item* item) {
    std::unique_lock lock(mutex_);
    const auto ready = [this] { return closed_ || !items_.empty(); };
    if (deadline == absl::InfiniteFuture()) {
      changed_.wait(lock, ready);
    } else if (!changed_.wait_for(lock, absl::ToChronoNanoseconds(deadline - absl::Now()), ready)) {
      return WorkerLink::Wait::kTimeout;
    }
    if (items_.empty()) return WorkerLink::Wait::kClosed;
    *item = std::move(items_.front());
    items_.pop_front();
    return WorkerLink::Wait::kMessage;
  }

  void Close() {
    const std::lock_guard lock(mutex_);
    closed_ = true;
    changed_.notify_all();
  }

 private:
  std::mutex mutex_;
  std::condition_variable changed_;
  // Guarded by mutex_.
  std::deque<Item> items_;
  bool closed_ = false;
};

struct Pipes {
  Pipe<ServerLink::Received> to_worker;
  Pipe<WorkerLink::Received> from_worker;

  void Close() {
    to_worker.Close();
    from_worker.Close();
  }
};

class InProcessServerLink : public ServerLink {
 public:
  explicit InProcessServerLink(Pipes* pipes) : pipes_(pipes) {}

  void Send(FromWorker message, BlobPtr blob) override {
    pipes_->from_worker.Push({std::move(message), std::move(blob)});
  }
  std::optional<Received> Receive() override {
    Received received;
    const bool open = pipes_->to_worker.Pop(absl::InfiniteFuture(), &received) == WorkerLink::Wait::kMessage;
    return open ? std::optional(std::move(received)) : std::nullopt;
  }
  void Close() override { pipes_->Close(); }

 private:
  Pipes* const pipes_;
};

class InProcessWorkerLink : public WorkerLink {
 public:
  explicit InProcessWorkerLink(std::function<void(ServerLink&)> worker)
      : thread_([this, worker = std::move(worker)] {
          InProcessServerLink link(&pipes_);
          try {
            worker(link);
          } catch (const std::exception& error) {
            thrown_ = error.what();
          } catch (...) {
            thrown_ = "something";
          }
          pipes_.Close();
        }) {}

  ~InProcessWorkerLink() override {
    pipes_.Close();
    thread_.join();
  }

  void Send(ToWorker message, std::vector<BlobPtr> blobs) override {
    pipes_.to_worker.Push({std::move(message), std::move(blobs)});
  }
  Wait Receive(absl::Time deadline, Received* received) override { return pipes_.from_worker.Pop(deadline, received); }
  void Close() override {
    given_up_ = true;
    pipes_.Close();
  }
  WorkerLoss HowEnded() override {
    if (given_up_) return {"WORKER_HUNG", "the worker was given up", {}};
    // thrown_ was set before the pipe was closed, and this thread has seen the pipe closed.
    if (!thrown_.empty()) return {"WORKER_CRASHED", "the worker threw: " + thrown_, {}};
    return {"WORKER_CRASHED", "the worker ended without a result", {}};
  }

 private:
  Pipes pipes_;
  std::string thrown_;
  std::atomic<bool> given_up_ = false;
  std::thread thread_;
};

}  // namespace

absl::StatusOr<std::shared_ptr<WorkerLink>> StartInProcessWorker(std::function<void(ServerLink&)> worker) {
  try {
    return std::make_shared<InProcessWorkerLink>(std::move(worker));
  } catch (const std::system_error& error) {
    return InternalError(std::string("cannot start a worker thread: ") + error.what());
  }
}

}  // namespace planish
