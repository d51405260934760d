#include "client/cli/batch_flight.h"

#include <algorithm>

namespace planish::cli {
namespace {

// A job that waited for less found an idle worker.
constexpr double kIdleSeconds = 0.005;
// Threads of this command; a server with more workers is kept busy by several commands.
constexpr int kMostThreads = 256;

int Spare(int workers) {
  return std::max(2, workers / 2);
}

}  // namespace

BatchFlight::BatchFlight(int workers, std::int64_t most_bytes)
    : most_(std::min(kMostThreads, 4 * std::max(1, workers))),
      most_bytes_(most_bytes),
      limit_(std::min(most_, std::max(1, workers) + Spare(workers))),
      first_jobs_(limit_) {}

int BatchFlight::limit() const {
  const std::lock_guard lock(mutex_);
  return limit_;
}

bool BatchFlight::Enter(std::int64_t bytes) {
  std::unique_lock lock(mutex_);
  changed_.wait(lock,
                [&] { return stopped_ || in_flight_ == 0 || (in_flight_ < limit_ && bytes_ + bytes <= most_bytes_); });
  if (stopped_) return false;
  ++in_flight_;
  bytes_ += bytes;
  return true;
}

void BatchFlight::Leave(std::int64_t bytes) {
  const std::lock_guard lock(mutex_);
  --in_flight_;
  bytes_ -= bytes;
  changed_.notify_all();
}

void BatchFlight::Stop() {
  const std::lock_guard lock(mutex_);
  stopped_ = true;
  changed_.notify_all();
}

void BatchFlight::OnQueueFull() {
  const std::lock_guard lock(mutex_);
  // Those that wait for room in the queue are in memory for nothing.
  limit_ = std::max(1, std::min(limit_, in_flight_) - 1);
}

void BatchFlight::OnDone(double queue_seconds) {
  const std::lock_guard lock(mutex_);
  if (first_jobs_ > 0) {
    --first_jobs_;
    return;
  }
  if (queue_seconds >= kIdleSeconds) return;
  limit_ = std::min(most_, limit_ + 1);
  changed_.notify_all();
}

}  // namespace planish::cli
