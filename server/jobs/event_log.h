// What happened to a job, for any number of readers at their own pace.
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

// A bounded ring of a job's events in the order of the sequences that the store gave them. The event with a terminal
// state is the last one. When it is full the oldest progress event goes; changes of state stay, there are only a
// handful. The writer never waits for a reader.
//
// Thread-safe.
class JobEventLog {
 public:
  // A live subscription; dropping it ends it.
  using Subscription = std::shared_ptr<const std::function<void()>>;

  struct Read {
    std::optional<v1::JobEvent> event;  // empty: none yet, or `ended`
    bool ended = false;                 // there will be no more events
    absl::Status status;                // with `ended`: not OK if the job goes on, but not here (Interrupt)
  };

  // `capacity`: events held at most, unless changes of state alone are more.
  explicit JobEventLog(std::size_t capacity) : capacity_(capacity) {}

  // Takes over an event of the store, which has its sequence, if it is newer than all there are: whoever calls has all
  // between. `uv` with the final one: the job's result or null.
  void Restore(v1::JobEvent event, StoredBlobPtr uv = nullptr);

  // Takes over an event if it is the next one. False, and nothing has changed, if one before it is missing.
  bool Append(v1::JobEvent event, StoredBlobPtr uv = nullptr);

  // Ends the log though not the job: readers get `status`, which must not be OK, after what there is.
  void Interrupt(const absl::Status& status);

  // Calls every subscriber, on this thread. Call it after each append, holding no lock.
  void Notify() const;

  // The first event held with a sequence greater than `after` (>= 0), with `skipped` set to the number of events
  // between the two that are gone.
  Read ReadAfter(std::int64_t after) const;

  // Of the newest event; 0: none.
  std::int64_t last_sequence() const;

  bool ended() const;

  // Null before the last event, and for a job that did not succeed.
  StoredBlobPtr uv() const;

  // From now on calls `wake` after each append. A call under way when the subscription is dropped runs on, so
  // `wake` should hold weak pointers only.
  [[nodiscard]] Subscription Subscribe(std::function<void()> wake) const;

 private:
  // Requires mutex_.
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
