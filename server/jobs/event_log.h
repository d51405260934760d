// The events of a job, for any number of readers, each at its own pace.
#pragma once

#include <cstddef>
#include <cstdint>
#include <deque>
#include <functional>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <vector>

#include "absl/status/status.h"
#include "planish/v1/job.pb.h"
#include "server/blobs/stored_blob.h"

namespace planish {

// A bounded ring of a job's events, in the order of the sequence numbers that the store assigned. The event with a
// terminal state is the last one. When the ring is full, the oldest progress event is dropped; changes of state are
// kept, since there are only a few. The writer never waits for a reader.
//
// Thread-safe.
class JobEventLog {
 public:
  // Dropping the last copy of this pointer ends the subscription.
  using Subscription = std::shared_ptr<const std::function<void()>>;

  struct Read {
    std::optional<v1::JobEvent> event;  // empty: none yet, or `ended`
    bool ended = false;                 // there will be no more events
    absl::Status status;                // with `ended`: OK if the job ended, otherwise the status of Interrupt()
  };

  // `capacity`: the number of events that are kept at most; changes of state are kept even beyond it.
  explicit JobEventLog(std::size_t capacity) : capacity_(capacity) {}

  // Adds an event of the store if it is newer than all events here. The caller must have added every event before it.
  // `uv`: with the final event the job's result, if there is one; otherwise null.
  void Restore(v1::JobEvent event, StoredBlobPtr uv = nullptr);

  // Adds an event if its sequence number is the next one. Returns false and changes nothing if an earlier event is
  // missing.
  bool Append(v1::JobEvent event, StoredBlobPtr uv = nullptr);

  // Ends the log although the job goes on: after the events that are here, readers get `status`, which must not be OK.
  void Interrupt(const absl::Status& status);

  // Calls every subscriber, on this thread. Call it after each append, holding no lock.
  void Notify() const;

  // The first event whose sequence number is greater than `after` (>= 0). Its `skipped` is the number of dropped events
  // between `after` and this event.
  Read ReadAfter(std::int64_t after) const;

  // Sequence number of the newest event; 0 if there is none.
  std::int64_t last_sequence() const;

  bool ended() const;

  // The job's result. Null before the last event, and for a job that did not succeed.
  StoredBlobPtr uv() const;

  // From now on calls `wake` after each append. A call that is running when the subscription is dropped finishes, so
  // `wake` should hold weak pointers only.
  [[nodiscard]] Subscription Subscribe(std::function<void()> wake) const;

 private:
  // Appends the event, and drops the oldest progress event if the ring is full. Requires mutex_.
  void Hold(v1::JobEvent event, StoredBlobPtr uv);

  const std::size_t capacity_;

  mutable std::mutex mutex_;
  // Guarded by mutex_.
  std::deque<v1::JobEvent> events_;
  std::int64_t last_sequence_ = 0;
  bool ended_ = false;
  absl::Status status_;
  StoredBlobPtr uv_;
  mutable std::vector<std::weak_ptr<const std::function<void()>>> subscribers_;
};

}  // namespace planish
