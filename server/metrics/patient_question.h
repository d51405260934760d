#pragma once

#include <algorithm>
#include <chrono>
#include <condition_variable>
#include <cstdint>
#include <functional>
#include <mutex>
#include <optional>
#include <thread>
#include <utility>

namespace planish {

// Asks a question that may never return, on its own thread. A caller waits for the answer for a limited time, and then
// uses the previous answer. Thread-safe.
template <class Answer>
class PatientQuestion {
 public:
  using Clock = std::chrono::steady_clock;

  explicit PatientQuestion(std::function<Answer()> ask) : ask_(std::move(ask)), thread_([this] { Run(); }) {}
  // Waits for a running question.
  ~PatientQuestion() {
    {
      const std::lock_guard lock(mutex_);
      ending_ = true;
    }
    changed_.notify_all();
    thread_.join();
  }
  PatientQuestion(const PatientQuestion&) = delete;
  PatientQuestion& operator=(const PatientQuestion&) = delete;

  // Asks, unless a question is already running.
  void Ask() {
    const std::lock_guard lock(mutex_);
    if (!begun_at_.has_value()) Want(begun_ + 1);
  }

  // Asks once more and waits for the answer, at most for `patience`; does not wait if a question has been running for
  // that long already. Returns whether the new answer arrived. `answer` becomes the newest answer, if there is any.
  bool AskAndWait(Clock::duration patience, std::optional<Answer>* answer) {
    std::unique_lock lock(mutex_);
    const std::int64_t next = begun_ + 1;
    bool came = false;
    if (!begun_at_.has_value() || Clock::now() - *begun_at_ < patience) {
      Want(next);
      came = changed_.wait_for(lock, patience, [&] { return answered_ >= next; });
    }
    *answer = answer_;
    return came;
  }

  // The newest answer, if there is any.
  std::optional<Answer> Newest() const {
    const std::lock_guard lock(mutex_);
    return answer_;
  }

  // How long the running question has taken so far; zero if none is running.
  Clock::duration Silence() const {
    const std::lock_guard lock(mutex_);
    return begun_at_.has_value() ? Clock::now() - *begun_at_ : Clock::duration::zero();
  }

 private:
  // Has question `number` asked, and all before it. Requires mutex_.
  void Want(std::int64_t number) {
    wanted_ = std::max(wanted_, number);
    changed_.notify_all();
  }

  void Run() {
    std::unique_lock lock(mutex_);
    for (;;) {
      changed_.wait(lock, [this] { return ending_ || wanted_ > begun_; });
      if (ending_) return;
      ++begun_;
      begun_at_ = Clock::now();
      lock.unlock();
      Answer answer = ask_();
      lock.lock();
      answer_ = std::move(answer);
      begun_at_.reset();
      answered_ = begun_;
      changed_.notify_all();
    }
  }

  const std::function<Answer()> ask_;
  mutable std::mutex mutex_;
  std::condition_variable changed_;
  // Guarded by mutex_. Questions are numbered from 1.
  std::int64_t wanted_ = 0, begun_ = 0, answered_ = 0;
  std::optional<Clock::time_point> begun_at_;  // when the running question began
  std::optional<Answer> answer_;
  bool ending_ = false;
  std::thread thread_;  // the last member, since the thread uses the others
};

}  // namespace planish
