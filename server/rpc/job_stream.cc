#include "server/rpc/job_stream.h"

#include <algorithm>
#include <string>
#include <utility>

#include "absl/strings/str_cat.h"
#include "core/base/error.h"

namespace planish {

JobStream::Step JobStream::Next(v1::JobEvent* event, v1::UvChunk* chunk, Pace pace) {
  JobEventLog::Read read = events_->ReadAfter(position_.after_sequence);
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

  const BlobPtr uv = events_->uv();
  if (!position_.include_uv || uv == nullptr) return Step::kEnd;
  const auto size = static_cast<std::int64_t>(uv->bytes().size());
  if (position_.uv_offset > size) {
    status_ =
        MakeError(absl::StatusCode::kOutOfRange, "UV_OFFSET_OUT_OF_RANGE",
                  absl::StrCat("uv_offset ", position_.uv_offset, " is beyond the UV, which have ", size, " bytes"),
                  {{"field", "uv_offset"}, {"total_bytes", absl::StrCat(size)}});
    return Step::kEnd;
  }
  if (position_.uv_offset == size) return Step::kEnd;
  const std::int64_t length = std::min(kChunkBytes, size - position_.uv_offset);
  chunk->set_offset(position_.uv_offset);
  chunk->set_data(uv->bytes().data() + position_.uv_offset, static_cast<std::size_t>(length));
  position_.uv_offset += length;
  return Step::kUv;
}

absl::Status Validate(const JobStream::Position& position) {
  const char* field = position.after_sequence < 0 ? "after_sequence" : position.uv_offset < 0 ? "uv_offset" : nullptr;
  if (field == nullptr) return absl::OkStatus();
  return MakeError(absl::StatusCode::kInvalidArgument, "REQUEST_INVALID", absl::StrCat(field, " is negative"),
                   {{"field", field}});
}

}  // namespace planish
