#include "client/src/follower.h"

#include <algorithm>
#include <utility>

#include "absl/strings/str_cat.h"
#include "client/src/convert.h"
#include "client/src/errors.h"

namespace planish {
namespace {

using Stub = v1::Planish::Stub;

// How often a job is submitted again after the server lost it, and how often an upload is restarted.
constexpr int kMostLostJobs = 3;
constexpr int kMostLostUploads = 5;

// Meshes up to this size are sent inline without asking for the server's advice.
constexpr std::int64_t kAlwaysInlineBytes = std::int64_t{1} << 20;
constexpr std::int64_t kDefaultChunkBytes = std::int64_t{1} << 20;

bool IsTerminal(v1::JobState state) {
  return IsTerminal(static_cast<JobState>(state));
}

std::int64_t SizeOf(const std::string& bytes) {
  return static_cast<std::int64_t>(bytes.size());
}

}  // namespace

Follower::Follower(Rpc& rpc, const CallOptions& call, const Callbacks& callbacks, PackedMesh* mesh,
                   std::stop_token finish, std::function<void(const std::string&)> on_job_name)
    : rpc_(rpc),
      call_(call),
      callbacks_(callbacks),
      mesh_(mesh),
      finish_(std::move(finish)),
      on_job_name_(std::move(on_job_name)),
      retry_(rpc.target(),
             {rpc.options().reattach_timeout, rpc.options().queue_full_timeout, rpc.options().backoff, deadline_}) {}

Followed Follower::Unwrap(v1::UnwrapRequest request) {
  unwrap_ = &request;
  return Follow();
}

Followed Follower::Watch(const std::string& job, std::int64_t after_sequence) {
  job_name_ = job;
  last_sequence_ = after_sequence;
  return Follow();
}

v1::Job Follower::Create(v1::CreateJobRequest request) {
  v1::Job job;
  Run([&] {
    Send(*request.mutable_spec());
    job = rpc_.Call(&Stub::CreateJob, request, deadline_, call_.traceparent);
    return true;
  });
  return job;
}

Followed Follower::Follow() {
  Run([this] { return FollowOnce(); });
  const Clock::time_point end = Clock::now();
  followed_.upload_time = first_event_.value_or(end) - start_;
  followed_.download_time = end - last_event_.value_or(end);
  return std::move(followed_);
}

template <typename Step>
void Follower::Run(const Step& step) {
  const std::stop_callback on_stop(call_.stop, [this] { OnStop(); });
  const std::stop_callback on_finish(finish_, [this] { Ask(); });
  try {
    for (bool done = false; !done;) {
      try {
        done = step();
      } catch (const Error& error) {
        if (in_callback_) throw;
        Recover(error);
      }
    }
  } catch (Error& error) {
    if (error.job().empty()) error.set_job(job_name_);
    throw;
  }
}

// Waits until another step may succeed after `error`. Throws `error` if none may, CANCELLED after a stop request.
void Follower::Recover(const Error& error) {
  if (call_.stop.stop_requested() && StopEndsCall()) ThrowCancelled();
  if (job_name_.empty() && !upload_.name().empty()) {
    const bool is_gone = IsUploadGone(error);
    if (is_gone && ++lost_uploads_ > kMostLostUploads) throw error;
    // One damaged upload may be an accident of the network, so it is repeated once.
    const bool is_damaged = error.reason() == "DIGEST_MISMATCH" && !std::exchange(damaged_upload_, true);
    if (is_gone || is_damaged) {
      upload_.Clear();
      upload_request_id_ = NewUuid();
      best_committed_ = -1;
    }
    if (is_damaged) return;
  }
  if (error.code() == ErrorCode::kNotFound && unwrap_ != nullptr && !job_name_.empty() && lost_stream_) {
    return StartAnew();  // the server has lost the job or its UV
  }
  // A draining server will not accept jobs again soon.
  if (error.reason() == "DRAINING" && !first_event_ && !lost_stream_) throw error;
  if (in_stream_ && error.code() != ErrorCode::kResourceExhausted) lost_stream_ = true;
  const Seconds pause = retry_.PauseAfter(error, rpc_.reached());
  Tell(callbacks_.on_reconnect, error, pause);
  std::unique_lock lock(mutex_);
  const bool was_stopped = stopped_;
  stopped_changed_.wait_for(lock, pause, [&] { return stopped_ != was_stopped; });
  if (stopped_ && StopEndsCall()) ThrowCancelled();
}

template <typename Callback, typename... Values>
void Follower::Tell(const Callback& callback, const Values&... values) {
  if (!callback) return;
  in_callback_ = true;
  callback(values...);
  in_callback_ = false;
}

// ---- sending the mesh

void Follower::Send(v1::JobSpec& spec) {
  if (GoesInline()) {
    if (!mesh_->draco.empty()) spec.set_draco(std::move(mesh_->draco));
    return;
  }
  if (!IsUploaded()) Upload();
  spec.set_upload(upload_.name());
}

bool Follower::GoesInline() {
  if (inline_) return *inline_;
  const std::int64_t bytes = SizeOf(mesh_->draco);
  const std::optional<std::int64_t>& most = rpc_.options().inline_mesh_bytes;
  if (bytes <= std::min(most.value_or(kAlwaysInlineBytes), kAlwaysInlineBytes)) return *(inline_ = true);
  const auto server =
      rpc_.Call(&Stub::GetCapabilities, v1::GetCapabilitiesRequest(), DeadlineAfter(kUnaryLimit), call_.traceparent);
  const std::int64_t whole = mesh_->bytes();
  const std::int64_t limit = server.max_mesh_bytes();
  if (limit > 0 && whole > limit) {
    throw Error(ErrorCode::kResourceExhausted, "MESH_TOO_LARGE",
                absl::StrCat("the mesh has ", whole, " bytes as sent; this server takes at most ", limit),
                {{"bytes", absl::StrCat(whole)}, {"limit", absl::StrCat(limit)}});
  }
  chunk_bytes_ = server.upload_chunk_bytes() > 0 ? server.upload_chunk_bytes() : kDefaultChunkBytes;
  return *(inline_ = bytes <= most.value_or(server.inline_mesh_bytes() > 0 ? server.inline_mesh_bytes() : bytes));
}

bool Follower::IsUploaded() const {
  return !upload_.name().empty() && upload_.committed_bytes() == SizeOf(mesh_->draco);
}

// Starts an upload, or resumes the one that broke off. Throws UNAVAILABLE if the server has only a part of the mesh
// afterwards.
void Follower::Upload() {
  if (call_.stop.stop_requested()) ThrowCancelled();
  const Deadline soon = DeadlineAfter(kUnaryLimit);
  if (upload_.name().empty()) {
    v1::CreateUploadRequest request;
    request.set_total_bytes(SizeOf(mesh_->draco));
    request.set_sha256(mesh_->sha256);
    request.set_request_id(upload_request_id_);
    upload_ = rpc_.Call(&Stub::CreateUpload, request, soon, call_.traceparent);
  } else {
    upload_ = rpc_.Call(&Stub::GetUpload, Named<v1::GetUploadRequest>(upload_.name()), soon, call_.traceparent);
  }
  OnCommitted();
  if (!IsUploaded()) WriteRest();
  if (!IsUploaded()) throw Error(ErrorCode::kUnavailable, "UNAVAILABLE", "the server took a part of the mesh only");
}

void Follower::WriteRest() {
  rpc_.Connect(deadline_);
  const auto context = NewContext();
  v1::Upload upload;
  const auto writer = rpc_.stub().WriteUpload(context.get(), &upload);
  try {
    v1::WriteUploadRequest message;
    message.set_name(upload_.name());
    const std::int64_t total = SizeOf(mesh_->draco);
    for (std::int64_t offset = upload_.committed_bytes(); offset < total;) {
      const std::int64_t size = std::min(chunk_bytes_, total - offset);
      message.set_offset(offset);
      message.set_data(mesh_->draco.data() + offset, static_cast<std::size_t>(size));
      if (!writer->Write(message)) break;  // Finish() returns the error
      message.clear_name();
      offset += size;
      // The server may have slightly less. If the stream breaks, its own count is used.
      Tell(callbacks_.on_upload, offset, total);
    }
  } catch (...) {
    context->TryCancel();
    writer->Finish();
    throw;
  }
  writer->WritesDone();
  const grpc::Status status = writer->Finish();
  if (!status.ok()) throw rpc_.ErrorOf(status);
  upload_ = std::move(upload);
  OnCommitted();
}

void Follower::OnCommitted() {
  if (upload_.committed_bytes() <= best_committed_) return;
  best_committed_ = upload_.committed_bytes();
  retry_.Reset();
  Tell(callbacks_.on_upload, best_committed_, SizeOf(mesh_->draco));
}

// ---- following the job

bool Follower::FollowOnce() {
  in_stream_ = false;
  rpc_.Connect(deadline_);
  if (unwrap_ != nullptr && job_name_.empty()) {
    Send(*unwrap_->mutable_spec());
    const auto context = NewContext(!call_.detached);
    ReadAll(rpc_.stub().Unwrap(context.get(), *unwrap_), *context);
  } else {
    v1::WatchJobRequest watch;
    watch.set_name(job_name_);
    watch.set_after_sequence(last_sequence_);
    watch.set_include_uv(mesh_ != nullptr);
    watch.set_uv_offset(SizeOf(followed_.uv_bytes));
    watch.set_attach(unwrap_ != nullptr && !call_.detached);
    const auto context = NewContext();
    auto reader = rpc_.stub().WatchJob(context.get(), watch);
    Ask();
    ReadAll(std::move(reader), *context);
  }
  if (!IsComplete()) throw Error(ErrorCode::kUnavailable, "UNAVAILABLE", "the stream ended before the job did");
  const v1::Job& job = followed_.job;
  // True: the server cancelled the job because it noticed the loss of the stream.
  const bool was_dropped = job.state() == v1::JOB_STATE_CANCELLED && lost_stream_ && !call_.stop.stop_requested();
  // True: the server's store lost the mesh, so it must be sent again.
  const bool lacks_mesh = job.state() == v1::JOB_STATE_FAILED && lost_jobs_ < kMostLostJobs &&
                          ErrorFrom(job.error()).reason() == "MESH_LOST";
  if (unwrap_ == nullptr || (!was_dropped && !lacks_mesh)) return true;
  StartAnew();
  return false;
}

template <typename Response>
void Follower::ReadAll(std::unique_ptr<grpc::ClientReader<Response>> reader, grpc::ClientContext& context) {
  in_stream_ = true;
  try {
    Response response;
    while (reader->Read(&response)) {
      retry_.Reset();
      if (response.has_event()) TakeEvent(response.event());
      if (response.has_uv()) TakeUv(response.uv());
    }
  } catch (...) {
    context.TryCancel();
    reader->Finish();
    throw;
  }
  const grpc::Status status = reader->Finish();
  if (!status.ok() && !IsComplete()) throw rpc_.ErrorOf(status);
}

void Follower::TakeEvent(const v1::JobEvent& proto) {
  if (proto.sequence() <= last_sequence_) return;  // already received before re-attaching
  Event event = FromProto(proto, mesh_ != nullptr ? mesh_->ToCaller() : ids::Renumbering());
  event.skipped = proto.sequence() - last_sequence_ - 1;
  last_sequence_ = proto.sequence();
  if (!first_event_) first_event_ = Clock::now();
  if (proto.has_job()) {
    followed_.job = proto.job();
    if (IsTerminal(proto.job().state())) last_event_ = Clock::now();
    if (job_name_.empty()) {
      const std::lock_guard lock(mutex_);
      job_name_ = proto.job().name();
    }
    Ask();  // the caller may have asked to cancel or stop before the job existed
    if (on_job_name_) on_job_name_(job_name_);
  }
  Tell(callbacks_.on_event, event);
}

void Follower::TakeUv(const v1::UvChunk& chunk) {
  const std::int64_t have = SizeOf(followed_.uv_bytes);
  if (chunk.offset() > have) {
    throw Error(ErrorCode::kDataLoss, "UV_CORRUPT",
                absl::StrCat("the server skipped from byte ", have, " of the UV to ", chunk.offset()));
  }
  const auto known = static_cast<std::size_t>(have - chunk.offset());
  if (known < chunk.data().size()) followed_.uv_bytes.append(chunk.data(), known, std::string::npos);
  Tell(callbacks_.on_download, SizeOf(followed_.uv_bytes), followed_.job.uv().total_bytes());
}

bool Follower::IsComplete() const {
  if (!IsTerminal(followed_.job.state())) return false;
  if (mesh_ == nullptr || followed_.job.state() != v1::JOB_STATE_SUCCEEDED) return true;
  return SizeOf(followed_.uv_bytes) >= followed_.job.uv().total_bytes();
}

void Follower::StartAnew() {
  const std::lock_guard lock(mutex_);
  job_name_.clear();
  followed_ = Followed();
  last_sequence_ = 0;
  lost_stream_ = false;
  // The old request id belongs to the lost job.
  unwrap_->set_request_id(NewUuid());
  if (++lost_jobs_ > kMostLostJobs) {
    throw Error(ErrorCode::kUnavailable, "CONNECTION_LOST",
                "the connection to the planish server at " + rpc_.target() + " keeps breaking, and the job with it");
  }
}

// ---- stops

std::shared_ptr<grpc::ClientContext> Follower::NewContext(bool may_be_cut_off) {
  std::shared_ptr<grpc::ClientContext> context = rpc_.NewContext(deadline_, call_.traceparent);
  const std::lock_guard lock(mutex_);
  if (stopped_ && StopEndsCall()) ThrowCancelled();
  context_ = may_be_cut_off ? context : nullptr;
  asked_cancel_ = asked_finish_ = false;  // these calls may have been lost with the connection
  return context;
}

void Follower::OnStop() {
  {
    const std::lock_guard lock(mutex_);
    stopped_ = true;
    stopped_changed_.notify_all();
    // Cuts the stream. That is enough: a watched job goes on, and if the server has just accepted the job of an
    // Unwrap(), it cancels the job because its caller is gone.
    if (StopEndsCall() && context_) context_->TryCancel();
  }
  Ask();
}

// Asks the server to cancel or stop the job, if the caller wants that and the job exists.
void Follower::Ask() {
  const std::lock_guard lock(mutex_);
  if (StopEndsCall()) return;
  if (stopped_ && !std::exchange(asked_cancel_, true)) {
    rpc_.InBackground<v1::CancelJobRequest>(&Stub::CancelJob, job_name_, call_.traceparent);
  }
  if (finish_.stop_requested() && !std::exchange(asked_finish_, true)) {
    rpc_.InBackground<v1::StopJobRequest>(&Stub::StopJob, job_name_, call_.traceparent);
  }
}

void Follower::ThrowCancelled() const {
  const bool watches = unwrap_ == nullptr && !job_name_.empty();
  throw Error(ErrorCode::kCancelled, "CANCELLED",
              watches ? "stopped watching; the job goes on" : "cancelled before the server had accepted the job");
}

}  // namespace planish
