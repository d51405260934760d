// The messages that a watcher of a job is sent, one by one.
#pragma once

#include <cstdint>
#include <memory>
#include <string>
#include <utility>

#include "absl/status/status.h"
#include "planish/v1/job.pb.h"
#include "server/jobs/event_log.h"

namespace planish {

// Turns the log of a job into the messages for one caller. Not thread-safe.
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
    kWait,   // nothing to send yet: call Next() again when the log wakes its subscribers
    kEnd,    // everything was sent; status() has the outcome
  };

  // How much progress is sent. Changes of state are always sent.
  enum class Pace {
    kAll,     // every event is sent
    kNewest,  // only the newest event that was not sent yet
    kHold,    // no progress now: Next() returns kWait instead
  };

  // Bytes of UV in a message. A caller that does not read costs twice this: the message and its wire form.
  static constexpr std::int64_t kChunkBytes = std::int64_t{128} << 10;

  JobStream(std::shared_ptr<const JobEventLog> events, const Position& position)
      : events_(std::move(events)), position_(position) {}

  Step Next(v1::JobEvent* event, v1::UvChunk* chunk, Pace pace = Pace::kAll);

  // The status of ReadUv(), or that of the log (UNAVAILABLE, DRAINING) if the job goes on at another server.
  const absl::Status& status() const { return status_; }
  // Whether the job's end was sent. Known once Next() has returned kUv or kEnd.
  bool job_ended() const { return job_ended_; }

 private:
  const std::shared_ptr<const JobEventLog> events_;
  Position position_;
  bool told_end_ = false;  // the last event was sent with a sequence number made here
  bool job_ended_ = false;
  absl::Status status_;
};

// Reads at most `limit` bytes of the UV from `offset` on; none at their end. `field`: the request's field that gave the
// offset. OUT_OF_RANGE with UV_OFFSET_OUT_OF_RANGE beyond the end; NOT_FOUND with RESULT_EXPIRED if the UV are lost;
// other errors of BlobStore.
absl::Status ReadUv(const StoredBlob& uv, std::int64_t offset, std::int64_t limit, const std::string& field,
                    std::string* bytes);

// INVALID_ARGUMENT with REQUEST_INVALID if a number is negative.
absl::Status Validate(const JobStream::Position& position);

}  // namespace planish
