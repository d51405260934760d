#include "server/link/in_process_link.h"

#include <condition_variable>
#include <deque>
#include <mutex>
#include <system_error>
#include <thread>
#include <utility>

#include "core/base/error.h"

namespace planish {
namespace {

using worker::v1::FromWorker;
using worker::v1::ToWorker;

// One direction. Unbounded: what a worker sends in a job is bounded by its throttle, what the server sends is two
// messages at most. Thread-safe.
template <typename Message>
class Pipe {
 public:
  void Push(Message message) {
    const std::lock_guard lock(mutex_);
    if (closed_) return;
    messages_.push_back(std::move(message));
    changed_.notify_one();
  }

  std::optional<Message> Pop() {
    std::unique_lock lock(mutex_);
    changed_.wait(lock, [this] { return closed_ || !messages_.empty(); });
    if (messages_.empty()) return std::nullopt;
    std::optional<Message> message(std::move(messages_.front()));
    messages_.pop_front();
    return message;
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
  std::deque<Message> messages_;
  bool closed_ = false;
};

struct Pipes {
  Pipe<ToWorker> to_worker;
  Pipe<FromWorker> from_worker;

  void Close() {
    to_worker.Close();
    from_worker.Close();
  }
};

class InProcessServerLink : public ServerLink {
 public:
  explicit InProcessServerLink(Pipes* pipes) : pipes_(pipes) {}

  void Send(FromWorker message) override { pipes_->from_worker.Push(std::move(message)); }
  std::optional<ToWorker> Receive() override { return pipes_->to_worker.Pop(); }
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
          } catch (...) {
            // The server sees a link that closed without a result, as from a process that died.
          }
          pipes_.Close();
        }) {}

  ~InProcessWorkerLink() override {
    pipes_.Close();
    thread_.join();
  }

  void Send(ToWorker message) override { pipes_.to_worker.Push(std::move(message)); }
  std::optional<FromWorker> Receive() override { return pipes_.from_worker.Pop(); }
  void Close() override { pipes_.Close(); }

 private:
  Pipes pipes_;
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
