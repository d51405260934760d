#include "client/src/follower.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "client/src/convert.h"
#include "client/src/errors.h"
#include "client/src/request_id.h"
#include "client/src/stream_errors.h"
#include "client/src/trace_scope.h"

namespace planish {
inline namespace abi0 {
namespace {

// Times a job is submitted anew after it was lost together with its stream.
constexpr int kMostLostJobs = 3;

bool IsTerminal(v1::JobState state) {
  return IsTerminal(static_cast<JobState>(state));
}

}  // namespace

Follower::Follower(std::shared_ptr<Rpc> rpc, const ClientOptions& options, FollowPlan plan, const Callbacks& callbacks)
    : rpc_(std::move(rpc)),
      options_(options),
      plan_(std::move(plan)),
      callbacks_(callbacks),
      deadline_(DeadlineAfter(plan_.call.timeout_seconds)),
      wants_uv_(plan_.unwrap.has_value() || plan_.watch->include_uv()),
      backoff_(options.reattach_backoff_seconds, kLongestPauseSeconds,
               plan_.unwrap ? plan_.unwrap->request_id() : NewRequestId()) {
  if (plan_.unwrap) sender_.emplace(rpc_, options_, plan_.mesh, plan_.call, callbacks_, deadline_);
  if (plan_.watch) {
    job_name_ = plan_.watch->name();
    last_sequence_ = plan_.watch->after_sequence();
  }
}

Followed Follower::Run() {
  const std::stop_callback on_stop(plan_.call.stop, [this] { OnStop(); });
  const std::stop_callback on_finish(plan_.finish, [this] { OnFinish(); });
  try {
    while (!IsComplete()) RunOneStream();
  } catch (Error& error) {
    if (error.job().empty()) error.set_job(job_name_);
    throw;
  }
  const Clock::time_point end = Clock::now();
  followed_.upload_seconds = std::chrono::duration<double>(first_event_.value_or(end) - start_).count();
  followed_.download_seconds = std::chrono::duration<double>(end - last_event_.value_or(end)).count();
  return std::move(followed_);
}

bool Follower::IsComplete() const {
  if (!IsTerminal(followed_.job.state())) return false;
  if (!wants_uv_ || followed_.job.state() != v1::JOB_STATE_SUCCEEDED) return true;
  return static_cast<std::int64_t>(followed_.uv_bytes.size()) >= followed_.job.uv().total_bytes();
}

void Follower::RunOneStream() {
  std::optional<Error> error;
  v1::WatchJobRequest watch;
  try {
    rpc_->Connect(deadline_);
    const bool begins = plan_.unwrap && JobName().empty();
    if (begins) sender_->Send(*plan_.unwrap->mutable_spec());
    bool cancel_again = false, finish_again = false;
    {
      const std::lock_guard lock(mutex_);
      if (stopped_ && (begins || plan_.watch)) ThrowCancelled();
      if (begins) {
        stream_ = rpc_->Unwrap(*plan_.unwrap, deadline_);
      } else {
        watch.set_name(job_name_);
        watch.set_after_sequence(last_sequence_);
        watch.set_include_uv(wants_uv_);
        watch.set_uv_offset(static_cast<std::int64_t>(followed_.uv_bytes.size()));
        watch.set_attach(plan_.unwrap && !plan_.call.detached);
        stream_ = rpc_->WatchJob(watch, deadline_);
        // The first request may have been lost with the connection.
        cancel_again = stopped_;
        finish_again = finishing_;
      }
    }
    stream_->Start();
    if (cancel_again) rpc_->CancelJobInBackground(job_name_);
    if (finish_again) rpc_->StopJobInBackground(job_name_);
    StreamItem item;
    while (stream_->Read(item)) {
      lost_.reset();
      backoff_.Reset();
      if (item.event) TakeEvent(*item.event);
      if (item.uv) TakeUv(*item.uv);
    }
    error = stream_->Finish();
  } catch (const Error& e) {
    if (!IsUnreachable(e)) throw;
    error = e;
  }
  {
    const std::lock_guard lock(mutex_);
    stream_.reset();
  }
  if (error) {
    OnStreamError(*error);
  } else if (!IsComplete()) {
    OnStreamError(Error(ErrorCode::kUnavailable, "CONNECTION_LOST", "the stream ended before the job did"));
  } else if (followed_.job.state() == v1::JOB_STATE_CANCELLED && plan_.unwrap && lost_stream_ &&
             !plan_.call.stop.stop_requested()) {
    // The server noticed the loss of the stream and cancelled the job it belonged to.
    StartAnew();
  } else if (followed_.job.state() == v1::JOB_STATE_FAILED && plan_.unwrap &&
             ErrorFrom(followed_.job.error()).reason() == "MESH_LOST" && lost_jobs_ < kMostLostJobs) {
    // The server's store has lost the mesh. It is here.
    StartAnew();
  }
}

void Follower::TakeEvent(const v1::JobEvent& proto) {
  if (proto.sequence() <= last_sequence_) return;  // overlap after re-attaching
  Event event = FromProto(proto, plan_.mesh != nullptr ? plan_.mesh->ToCaller() : ids::Renumbering());
  event.skipped = proto.sequence() - last_sequence_ - 1;
  last_sequence_ = proto.sequence();
  if (!first_event_) first_event_ = Clock::now();
  if (proto.has_job()) {
    followed_.job = proto.job();
    if (IsTerminal(proto.job().state())) last_event_ = Clock::now();
    bool cancel_now = false, finish_now = false;
    {
      const std::lock_guard lock(mutex_);
      if (job_name_.empty()) {
        job_name_ = proto.job().name();
        // What came before there was a job to ask it of.
        cancel_now = stopped_;
        finish_now = finishing_;
      }
    }
    if (cancel_now) rpc_->CancelJobInBackground(job_name_);
    if (finish_now) rpc_->StopJobInBackground(job_name_);
    if (plan_.on_job_name) plan_.on_job_name(job_name_);
  }
  if (callbacks_.on_event) callbacks_.on_event(event);
}

void Follower::TakeUv(const v1::UvChunk& chunk) {
  const auto have = static_cast<std::int64_t>(followed_.uv_bytes.size());
  if (chunk.offset() > have) {
    throw Error(
        ErrorCode::kDataLoss, "UV_CORRUPT",
        "the server skipped from byte " + std::to_string(have) + " of the UV to " + std::to_string(chunk.offset()));
  }
  const auto known = static_cast<std::size_t>(have - chunk.offset());
  if (known < chunk.data().size()) followed_.uv_bytes.append(chunk.data(), known, std::string::npos);
  if (callbacks_.on_download) {
    callbacks_.on_download(static_cast<std::int64_t>(followed_.uv_bytes.size()), followed_.job.uv().total_bytes());
  }
}

void Follower::OnStreamError(const Error& error) {
  const bool stopped = plan_.call.stop.stop_requested();
  if (stopped && (plan_.watch || job_name_.empty())) ThrowCancelled();
  if (plan_.unwrap && job_name_.empty()) {
    if (AsksToWait(error)) {
      const double pause = std::max(0.05, error.retry_after_seconds());
      if (queue_full_waited_ + pause > options_.queue_full_wait_seconds) throw error;
      queue_full_waited_ += pause;
      PauseBeforeRetry(error, pause);
      return;
    }
    if (sender_->ForgetUpload(error, *plan_.unwrap->mutable_spec())) return;
  }
  if (error.code() == ErrorCode::kNotFound && plan_.unwrap && !job_name_.empty() && lost_stream_) {
    StartAnew();  // the server that had the job, or its UV, has them no more
    return;
  }
  if (!IsBrokenStream(error)) throw error;
  OnLost(error);
}

void Follower::OnLost(const Error& error) {
  // A server that was never reached, or takes no new jobs, is not coming back soon: say so at once.
  if (!rpc_->reached() || (!first_event_ && !lost_stream_ && error.reason() == "DRAINING")) throw error;
  lost_stream_ = true;
  const Clock::time_point now = Clock::now();
  if (!lost_) lost_ = now;
  const double pause = std::max(backoff_.Next(), error.retry_after_seconds());
  if (std::chrono::duration<double>(now - *lost_).count() + pause > options_.reattach_seconds) {
    throw Error(ErrorCode::kUnavailable, "CONNECTION_LOST",
                "lost the planish server at " + rpc_->target() + " and could not re-attach within " +
                    std::to_string(std::lround(options_.reattach_seconds)) + " s: " + error.what());
  }
  PauseBeforeRetry(error, pause);
}

void Follower::PauseBeforeRetry(const Error& why, double seconds) {
  ThrowIfLate(deadline_, seconds, why);
  if (callbacks_.on_reconnect) callbacks_.on_reconnect(why, seconds);
  std::unique_lock lock(mutex_);
  const bool was_stopped = stopped_;
  stopped_changed_.wait_for(lock, std::chrono::duration<double>(seconds), [&] { return stopped_ != was_stopped; });
}

void Follower::StartAnew() {
  const std::lock_guard lock(mutex_);
  job_name_.clear();
  followed_ = Followed();
  last_sequence_ = 0;
  lost_stream_ = false;
  // The old id stands for the job that is gone.
  plan_.unwrap->set_request_id(NewRequestId());
  if (++lost_jobs_ > kMostLostJobs) {
    throw Error(ErrorCode::kUnavailable, "CONNECTION_LOST",
                "the connection to the planish server at " + rpc_->target() + " keeps breaking, and the job with it");
  }
}

void Follower::OnStop() {
  std::string job;
  {
    const std::lock_guard lock(mutex_);
    stopped_ = true;
    stopped_changed_.notify_all();
    if (plan_.watch) {
      if (stream_) stream_->TryCancel();
    } else if (!job_name_.empty()) {
      job = job_name_;
    } else if (stream_ && !plan_.call.detached) {
      // Not accepted yet: the server drops the call, or the job that belongs to it.
      stream_->TryCancel();
    }
  }
  if (job.empty()) return;
  const TraceScope trace(plan_.call.traceparent);  // whoever stops is on another thread
  rpc_->CancelJobInBackground(job);
}

void Follower::OnFinish() {
  std::string job;
  {
    const std::lock_guard lock(mutex_);
    finishing_ = true;
    job = job_name_;
  }
  if (job.empty()) return;
  const TraceScope trace(plan_.call.traceparent);
  rpc_->StopJobInBackground(job);
}

std::string Follower::JobName() {
  const std::lock_guard lock(mutex_);
  return job_name_;
}

void Follower::ThrowCancelled() const {
  throw Error(ErrorCode::kCancelled, "CANCELLED",
              plan_.watch ? "stopped watching; the job goes on" : "cancelled before the server had accepted the job");
}

}  // namespace abi0
}  // namespace planish
