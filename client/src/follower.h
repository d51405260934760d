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
  Seconds upload_time{0};    // from the start of the call to the first event
  Seconds download_time{0};  // from the last event to the last byte of the UV
};

// Call one of Unwrap(), Watch() and Create(), once. These throw planish::Error, with the name of the job if there is
// one, and exceptions of callbacks.
class Follower {
 public:
  // `call.traceparent` must be valid. `mesh`: the mesh to send and to check the UV against; errors use its numbering.
  // It may be null for Watch(); Watch() fetches no UV then. If the Draco bytes are sent within the request, they are
  // moved out of `mesh`. `mesh`, `rpc` and `callbacks` must outlive the follower. A stop request of `finish` asks the
  // server to stop the job and deliver its best map.
  Follower(Rpc& rpc, const CallOptions& call, const Callbacks& callbacks, PackedMesh* mesh, std::stop_token finish = {},
           std::function<void(const std::string&)> on_job_name = {});

  // Both return when the job has ended, in any state; with its UV if it succeeded and `mesh` is given.
  Followed Unwrap(v1::UnwrapRequest request);
  Followed Watch(const std::string& job, std::int64_t after_sequence);
  // Returns once the server has accepted the job.
  v1::Job Create(v1::CreateJobRequest request);

 private:
  using Clock = std::chrono::steady_clock;

  // Repeats `step` until it returns true. After a temporary error of network or server it waits, and goes on.
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
  // Reads one stream, which resumes where the last one broke. Returns true if the job has ended and its UV are
  // complete, false if the job must be submitted again.
  bool FollowOnce();
  template <typename Response>
  void ReadAll(std::unique_ptr<grpc::ClientReader<Response>> reader, grpc::ClientContext& context);
  void TakeEvent(const v1::JobEvent& event);
  void TakeUv(const v1::UvChunk& chunk);
  bool IsComplete() const;
  void StartAnew();

  // The context of the next stream. Throws CANCELLED after a stop request, unless a job must be cancelled first. A stop
  // request cuts the stream off if `may_be_cut_off`.
  std::shared_ptr<grpc::ClientContext> NewContext(bool may_be_cut_off = true);
  void OnStop();
  void Ask();
  // Whether a stop request only ends this call, and no job must be cancelled on the server.
  bool StopEndsCall() const { return unwrap_ == nullptr || job_name_.empty(); }
  [[noreturn]] void ThrowCancelled() const;

  Rpc& rpc_;
  const CallOptions call_;
  const Callbacks& callbacks_;
  PackedMesh* const mesh_;
  const std::stop_token finish_;
  const std::function<void(const std::string&)> on_job_name_;
  const Deadline deadline_ = DeadlineAfter(call_.timeout);
  v1::UnwrapRequest* unwrap_ = nullptr;  // the request of Unwrap(); null in Watch() and Create()
  Retry retry_;
  bool in_callback_ = false;  // true: exceptions come from the caller's callback

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
  bool lost_stream_ = false;  // whether a stream of the current job broke
  int lost_jobs_ = 0;

  // State that a stop request on another thread reads; guarded by mutex_. Only the thread of Run() changes job_name_,
  // so it reads job_name_ without the lock.
  std::mutex mutex_;
  std::condition_variable stopped_changed_;
  bool stopped_ = false;                              // whether the caller wants to cancel the call
  bool asked_cancel_ = false, asked_finish_ = false;  // whether CancelJob and StopJob were called
  std::string job_name_;
  std::shared_ptr<grpc::ClientContext> context_;
};

}  // namespace planish
