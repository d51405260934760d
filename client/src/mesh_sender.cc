#include "client/src/mesh_sender.h"

#include <algorithm>
#include <utility>

#include "client/src/request_id.h"
#include "client/src/stream_errors.h"

namespace planish {
inline namespace abi0 {
namespace {

// Meshes up to this size travel inline without asking what the server advises.
constexpr std::int64_t kAlwaysInlineBytes = std::int64_t{1} << 20;
constexpr std::int64_t kDefaultChunkBytes = std::int64_t{1} << 20;

}  // namespace

MeshSender::MeshSender(std::shared_ptr<Rpc> rpc, const ClientOptions& options, PackedMesh* mesh,
                       const CallOptions& call, const Callbacks& callbacks, Deadline deadline)
    : rpc_(std::move(rpc)),
      options_(options),
      mesh_(mesh),
      stop_(call.stop),
      callbacks_(callbacks),
      deadline_(deadline),
      backoff_(options.reattach_backoff_seconds, kLongestPauseSeconds, mesh->sha256) {}

bool MeshSender::GoesInline() {
  if (inline_) return *inline_;
  const auto bytes = static_cast<std::int64_t>(mesh_->draco.size());
  if (bytes <= std::min(options_.inline_mesh_bytes.value_or(kAlwaysInlineBytes), kAlwaysInlineBytes)) {
    inline_ = true;
    return true;
  }
  const v1::Capabilities capabilities = rpc_->GetCapabilities();
  const auto with_seams =
      bytes + 4 * static_cast<std::int64_t>(mesh_->seam_corners.size() + mesh_->uncut_corners.size());
  const std::int64_t limit = capabilities.max_mesh_bytes();
  if (limit > 0 && with_seams > limit) {
    throw Error(ErrorCode::kResourceExhausted, "MESH_TOO_LARGE",
                "the mesh has " + std::to_string(with_seams) + " bytes as sent; this server takes at most " +
                    std::to_string(limit),
                {{"bytes", std::to_string(with_seams)}, {"limit", std::to_string(limit)}});
  }
  chunk_bytes_ = capabilities.upload_chunk_bytes() > 0 ? capabilities.upload_chunk_bytes() : kDefaultChunkBytes;
  const std::int64_t advised = capabilities.inline_mesh_bytes() > 0 ? capabilities.inline_mesh_bytes() : bytes;
  inline_ = bytes <= options_.inline_mesh_bytes.value_or(advised);
  return *inline_;
}

std::string MeshSender::Upload() {
  const std::stop_callback on_stop(stop_, [this] {
    const std::lock_guard lock(mutex_);
    if (stream_) stream_->TryCancel();
  });
  v1::CreateUploadRequest request;
  request.set_total_bytes(static_cast<std::int64_t>(mesh_->draco.size()));
  request.set_sha256(mesh_->sha256);
  request.set_request_id(NewRequestId());
  best_ = -1;
  lost_.reset();
  v1::Upload upload;
  bool damaged = false;
  while (upload.name().empty() || upload.committed_bytes() < request.total_bytes()) {
    if (stop_.stop_requested()) ThrowCancelled();
    try {
      if (upload.name().empty()) upload = rpc_->CreateUpload(request);
      OnProgress(upload.committed_bytes());
      if (upload.committed_bytes() < request.total_bytes()) WriteRest(upload);
    } catch (const Error& error) {
      if (stop_.stop_requested()) ThrowCancelled();
      // Once, bytes may turn on the way. Twice is no accident.
      if (error.reason() == "DIGEST_MISMATCH" && !std::exchange(damaged, true)) {
        upload.clear_name();
      } else {
        Resume(upload, error);
      }
    }
  }
  OnProgress(upload.committed_bytes());
  return upload.name();
}

void MeshSender::WriteRest(v1::Upload& upload) {
  UploadStream* stream = nullptr;
  {
    auto opened = rpc_->WriteUpload(deadline_);
    const std::lock_guard lock(mutex_);
    stream_ = std::move(opened);
    stream = stream_.get();
    if (stop_.stop_requested()) stream->TryCancel();
  }
  const auto end = [this] {
    const std::lock_guard lock(mutex_);
    stream_.reset();
  };
  try {
    v1::WriteUploadRequest message;
    message.set_name(upload.name());
    const auto total = static_cast<std::int64_t>(mesh_->draco.size());
    for (std::int64_t offset = upload.committed_bytes(); offset < total;) {
      const std::int64_t size = std::min(chunk_bytes_, total - offset);
      message.set_offset(offset);
      message.set_data(mesh_->draco.data() + offset, static_cast<std::size_t>(size));
      if (!stream->Write(message)) break;  // Finish() says why
      message.clear_name();
      offset += size;
      // What the server really has may be a few messages less; it is what counts when the stream breaks.
      if (callbacks_.on_upload) callbacks_.on_upload(offset, total);
    }
    upload = stream->Finish();
  } catch (...) {
    end();
    throw;
  }
  end();
}

// After `why` stopped the sending: waits, and asks how far it came. Throws if there is no way on.
void MeshSender::Resume(v1::Upload& upload, const Error& why) {
  const bool is_lost = IsUploadGone(why);
  if (!is_lost && !IsBrokenStream(why) && !AsksToWait(why) && why.reason() != "UPLOAD_BUSY" &&
      why.reason() != "UPLOAD_OFFSET_MISMATCH") {
    throw why;
  }
  if (!rpc_->reached()) throw why;  // a server that was never there is not coming back soon
  if (is_lost) upload.clear_name();
  Pause(why);
  if (upload.name().empty()) return;
  try {
    upload = rpc_->GetUpload(upload.name());
    OnProgress(upload.committed_bytes());
  } catch (const Error& error) {
    if (IsUploadGone(error)) {
      upload.clear_name();
    } else if (!IsBrokenStream(error)) {
      throw;
    }
  }
}

void MeshSender::Pause(const Error& why) {
  const double pause = std::max(backoff_.Next(), why.retry_after_seconds());
  if (!lost_) lost_ = Clock::now();
  const double silent = std::chrono::duration<double>(Clock::now() - *lost_).count();
  if (AsksToWait(why)) {
    if (silent + pause > options_.queue_full_wait_seconds) throw why;
  } else if (silent + pause > options_.reattach_seconds) {
    throw Error(ErrorCode::kUnavailable, "CONNECTION_LOST",
                "lost the planish server at " + rpc_->target() + " while sending the mesh: " + why.what());
  }
  ThrowIfLate(deadline_, pause, why);
  if (callbacks_.on_reconnect) callbacks_.on_reconnect(why, pause);
  std::unique_lock lock(mutex_);
  stopped_changed_.wait_for(lock, stop_, std::chrono::duration<double>(pause), [] { return false; });
}

void MeshSender::OnProgress(std::int64_t committed) {
  if (committed <= best_) return;
  best_ = committed;
  lost_.reset();
  backoff_.Reset();
  if (callbacks_.on_upload) callbacks_.on_upload(committed, static_cast<std::int64_t>(mesh_->draco.size()));
}

bool MeshSender::IsUploadGone(const Error& error) {
  return error.reason() == "UPLOAD_NOT_FOUND" || error.reason() == "UPLOAD_INCOMPLETE";
}

void MeshSender::ThrowCancelled() {
  throw Error(ErrorCode::kCancelled, "CANCELLED", "cancelled before the server had accepted the job");
}

}  // namespace abi0
}  // namespace planish
