// What a watcher of a job is sent, message by message.
#pragma once

#include <cstdint>
#include <memory>
#include <string>
#include <utility>

#include "absl/status/status.h"
#include "planish/v1/job.pb.h"
#include "server/jobs/event_log.h"

namespace planish {

// Not thread-safe.
class JobStream {
 public:
  // Fields as in planish.v1.WatchJobRequest.
  struct Position {
    std::int64_t after_sequence = 0;
    bool include_uv = false;
    std::int64_t uv_offset = 0;
  };

  enum class Step {
    kEvent,  // `event` was filled: send it
    kUv,     // `chunk` was filled: send it
    kWait,   // nothing yet: ask again when the log wakes its subscribers
    kEnd,    // all was sent; status() says how it went
  };

  // What becomes of progress. Changes of state are never left out.
  enum class Pace {
    kAll,     // every event is sent
    kNewest,  // of those that were not sent yet, the newest
    kHold,    // the same, but none now: kWait
  };

  // Bytes of UV in a message: what a reader that stands still costs, twice (the message and its wire form).
  static constexpr std::int64_t kChunkBytes = std::int64_t{128} << 10;

  JobStream(std::shared_ptr<const JobEventLog> events, const Position& position)
      : events_(std::move(events)), position_(position) {}

  Step Next(v1::JobEvent* event, v1::UvChunk* chunk, Pace pace = Pace::kAll);

  // That of ReadUv(); or what the log ended with (UNAVAILABLE, DRAINING) if the job goes on elsewhere.
  const absl::Status& status() const { return status_; }
  // Whether the caller was told the job's end. Known once Next() has said kUv or kEnd.
  bool job_ended() const { return job_ended_; }

 private:
  const std::shared_ptr<const JobEventLog> events_;
  Position position_;
  bool told_end_ = false;  // under a sequence of our own
  bool job_ended_ = false;
  absl::Status status_;
};

// At most `limit` bytes of the UV from `offset` on, which the caller gave as `field`; none at their end. OUT_OF_RANGE
// with UV_OFFSET_OUT_OF_RANGE beyond it; NOT_FOUND with RESULT_EXPIRED if they are lost; other errors of BlobStore.
absl::Status ReadUv(const StoredBlob& uv, std::int64_t offset, std::int64_t limit, const std::string& field,
                    std::string* bytes);

// INVALID_ARGUMENT with REQUEST_INVALID if a number is negative.
absl::Status Validate(const JobStream::Position& position);

}  // namespace planish
