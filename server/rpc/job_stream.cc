#include "server/rpc/job_stream.h"

#include <algorithm>
#include <string>
#include <utility>

#include "absl/strings/str_cat.h"
#include "core/base/error.h"
#include "server/blobs/blob_store.h"

namespace planish {

JobStream::Step JobStream::Next(v1::JobEvent* event, v1::UvChunk* chunk, Pace pace) {
  JobEventLog::Read read = events_->ReadAfter(position_.after_sequence);
  const std::int64_t last = events_->last_sequence();
  if (read.ended && read.status.ok() && last > 0 && position_.after_sequence > last && !told_end_) {
    // The caller has seen events that the database forgot in a crash. Sends the last event under a new number.
    read = events_->ReadAfter(last - 1);
    read.event->set_sequence(position_.after_sequence + 1);
    told_end_ = true;
  }
  while (pace != Pace::kAll && read.event.has_value() && read.event->has_progress()) {
    JobEventLog::Read newer = events_->ReadAfter(read.event->sequence());
    if (!newer.event.has_value()) {
      if (pace == Pace::kHold) return Step::kWait;
      break;
    }
    read = std::move(newer);
  }
  if (read.event.has_value()) {
    *event = *std::move(read.event);
    event->set_skipped(event->sequence() - position_.after_sequence - 1);
    position_.after_sequence = event->sequence();
    return Step::kEvent;
  }
  if (!read.ended) return Step::kWait;
  if (!read.status.ok()) {
    status_ = read.status;
    return Step::kEnd;
  }

  job_ended_ = true;
  const StoredBlobPtr uv = events_->uv();
  if (!position_.include_uv || uv == nullptr) return Step::kEnd;
  status_ = ReadUv(*uv, position_.uv_offset, kChunkBytes, "uv_offset", chunk->mutable_data());
  if (!status_.ok() || chunk->data().empty()) return Step::kEnd;
  chunk->set_offset(position_.uv_offset);
  position_.uv_offset += static_cast<std::int64_t>(chunk->data().size());
  return Step::kUv;
}

absl::Status ReadUv(const StoredBlob& uv, std::int64_t offset, std::int64_t limit, const std::string& field,
                    std::string* bytes) {
  const std::int64_t size = uv.size();
  if (offset > size) {
    return MakeError(absl::StatusCode::kOutOfRange, "UV_OFFSET_OUT_OF_RANGE",
                     absl::StrCat(field, " ", offset, " is beyond the UV, which have ", size, " bytes"),
                     {{"field", field}, {"total_bytes", absl::StrCat(size)}});
  }
  if (offset == size) return absl::OkStatus();
  const absl::Status got = uv.Read(offset, std::min(limit, size - offset), bytes);
  if (!IsLost(got)) return got;
  // Damaged UV count as absent; the next request for the same work computes them again.
  return MakeError(absl::StatusCode::kNotFound, "RESULT_EXPIRED",
                   absl::StrCat("the server can no longer read the UV: ", got.message()));
}

absl::Status Validate(const JobStream::Position& position) {
  const char* field = position.after_sequence < 0 ? "after_sequence" : position.uv_offset < 0 ? "uv_offset" : nullptr;
  if (field == nullptr) return absl::OkStatus();
  return MakeError(absl::StatusCode::kInvalidArgument, "REQUEST_INVALID", absl::StrCat(field, " is negative"),
                   {{"field", field}});
}

}  // namespace planish
