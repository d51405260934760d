// One call about a job: sends its mesh, has the job created, and follows it to the last UV byte, reconnecting as
// needed.
#pragma once

#include <chrono>
#include <condition_variable>
#include <functional>
#include <memory>
#include <mutex>
#include <optional>
#include <stop_token>
#include <string>

#include "client/src/mesh_packer.h"
#include "client/src/rpc.h"
#include "core/base/random_id.h"

namespace planish {

struct Followed {
  v1::Job job;  // terminal
  std::string uv_bytes;
  Seconds upload_time{0};    // from the start to the first event
  Seconds download_time{0};  // from the last event to the last byte
};

// Call one of Unwrap(), Watch() and Create(), once. They throw planish::Error, with the name of the job if there is
// one, and exceptions of callbacks.
class Follower {
 public:
  // `call.traceparent` must be valid. `mesh` is the mesh to send, to check the UV against, and whose numbering is used
  // in errors; it may be null for Watch(). If the Draco bytes are sent within the request, they are moved out of it.
  // `mesh`, `rpc` and `callbacks` must outlive the follower. `finish`: a request to stop the job and return its best
  // map.
  Follower(Rpc& rpc, const CallOptions& call, const Callbacks& callbacks, PackedMesh* mesh, std::stop_token finish = {},
           std::function<void(const std::string&)> on_job_name = {});

  // Return when the job has ended, in any state; with its UV if it succeeded and `mesh` is given.
  Followed Unwrap(v1::UnwrapRequest request);
  Followed Watch(const std::string& job, std::int64_t after_sequence);
  // Returns once the server has accepted the job.
  v1::Job Create(v1::CreateJobRequest request);

 private:
  using Clock = std::chrono::steady_clock;

  // Repeats `step` until it returns true. Waits after temporary errors of network and server.
  template <typename Step>
  void Run(const Step& step);
  void Recover(const Error& error);
  template <typename Callback, typename... Values>
  void Tell(const Callback& callback, const Values&... values);

  // Puts the mesh, or the name of a complete upload of it, into `spec`.
  void Send(v1::JobSpec& spec);
  bool GoesInline();
  bool IsUploaded() const;
  void Upload();
  void WriteRest();
  void OnCommitted();

  Followed Follow();
  // One stream, resumed where the last one broke; returns true at the end of the job and its UV.
  bool FollowOnce();
  template <typename Response>
  void ReadAll(std::unique_ptr<grpc::ClientReader<Response>> reader, grpc::ClientContext& context);
  void TakeEvent(const v1::JobEvent& event);
  void TakeUv(const v1::UvChunk& chunk);
  bool IsComplete() const;
  void StartAnew();

  // The context of the next stream. Throws CANCELLED after a stop if no job must be cancelled.
  std::shared_ptr<grpc::ClientContext> NewContext(bool may_be_cut_off = true);
  void OnStop();
  void Ask();
  // Whether a stop request only ends this call.
  bool StopEndsCall() const { return unwrap_ == nullptr || job_name_.empty(); }
  [[noreturn]] void ThrowCancelled() const;

  Rpc& rpc_;
  const CallOptions call_;
  const Callbacks& callbacks_;
  PackedMesh* const mesh_;
  const std::stop_token finish_;
  const std::function<void(const std::string&)> on_job_name_;
  const Deadline deadline_ = DeadlineAfter(call_.timeout);
  v1::UnwrapRequest* unwrap_ = nullptr;  // of Unwrap()
  Retry retry_;
  bool in_callback_ = false;  // an exception thrown now is the caller's

  std::optional<bool> inline_;
  std::int64_t chunk_bytes_ = 0;
  v1::Upload upload_;
  std::string upload_request_id_ = NewUuid();
  std::int64_t best_committed_ = -1;
  int lost_uploads_ = 0;
  bool damaged_upload_ = false;

  const Clock::time_point start_ = Clock::now();
  std::optional<Clock::time_point> first_event_, last_event_;
  Followed followed_;
  std::int64_t last_sequence_ = 0;
  bool in_stream_ = false;
  bool lost_stream_ = false;  // of the current job
  int lost_jobs_ = 0;

  // Guarded by mutex_: state that a stop from another thread reads. Only the thread of Run() changes job_name_.
  std::mutex mutex_;
  std::condition_variable stopped_changed_;
  bool stopped_ = false;                              // whether the caller wants to cancel; to stop: finish_
  bool asked_cancel_ = false, asked_finish_ = false;  // what the server was asked
  std::string job_name_;
  std::shared_ptr<grpc::ClientContext> context_;
};

}  // namespace planish
