#include "tests/server/testing/event_reader.h"

#include <condition_variable>
#include <memory>
#include <mutex>

namespace planish {
namespace {

// Shared with the subscription: a wake-up may come after the reader has left.
struct Bell {
  std::mutex mutex;
  std::condition_variable rung;
  bool ring = false;
};

class Reader {
 public:
  explicit Reader(const JobEventLog& log)
      : log_(log), subscription_(log.Subscribe([bell = bell_] {
          const std::lock_guard lock(bell->mutex);
          bell->ring = true;
          bell->rung.notify_one();
        })) {}

  // The event after `after`; empty at the end.
  std::optional<v1::JobEvent> WaitAfter(std::int64_t after) {
    while (true) {
      JobEventLog::Read read = log_.ReadAfter(after);
      if (read.event.has_value() || read.ended) return read.event;
      std::unique_lock lock(bell_->mutex);
      bell_->rung.wait(lock, [this] { return bell_->ring; });
      bell_->ring = false;
    }
  }

 private:
  const JobEventLog& log_;
  const std::shared_ptr<Bell> bell_ = std::make_shared<Bell>();
  const JobEventLog::Subscription subscription_;
};

}  // namespace

std::vector<v1::JobEvent> Follow(const JobEventLog& log) {
  Reader reader(log);
  std::vector<v1::JobEvent> events;
  while (auto event = reader.WaitAfter(events.empty() ? 0 : events.back().sequence())) events.push_back(*event);
  return events;
}

void WaitForEvent(const JobEventLog& log, std::int64_t sequence) {
  Reader(log).WaitAfter(sequence - 1);
}

}  // namespace planish
