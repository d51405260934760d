// One call about a job: sends its mesh, has the job created, and follows it to the last UV byte, over as many
// connections as that takes.
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

// Makes one of Unwrap(), Watch() and Create(), once. They throw planish::Error, with the name of the job where there is
// one, and whatever a callback throws.
class Follower {
 public:
  // `call.traceparent` must be valid. `mesh` is what is sent, what the UV must belong to and whose numbering errors are
  // told in; it may be null for Watch(). It must outlive the follower, which takes the Draco bytes out if they travel
  // inside the request; so must `rpc` and `callbacks`. `finish`: a request to stop the job and bring what it has.
  Follower(Rpc& rpc, const CallOptions& call, const Callbacks& callbacks, PackedMesh* mesh, std::stop_token finish = {},
           std::function<void(const std::string&)> on_job_name = {});

  // Return when the job ended, whatever its end, and its UV are here if it succeeded and `mesh` is given.
  Followed Unwrap(v1::UnwrapRequest request);
  Followed Watch(const std::string& job, std::int64_t after_sequence);
  // Returns when the server has the job.
  v1::Job Create(v1::CreateJobRequest request);

 private:
  using Clock = std::chrono::steady_clock;

  // Takes steps until one returns true. Errors of the network and the server that pass are waited for.
  template <typename Step>
  void Run(const Step& step);
  void Recover(const Error& error);
  template <typename Callback, typename... Values>
  void Tell(const Callback& callback, const Values&... values);

  // Puts the mesh into `spec`, or the name of a complete upload of it.
  void Send(v1::JobSpec& spec);
  bool GoesInline();
  bool IsUploaded() const;
  void Upload();
  void WriteRest();
  void OnCommitted();

  Followed Follow();
  // A stream, from where the one before broke; true at the end of the job and its UV.
  bool FollowOnce();
  template <typename Response>
  void ReadAll(std::unique_ptr<grpc::ClientReader<Response>> reader, grpc::ClientContext& context);
  void TakeEvent(const v1::JobEvent& event);
  void TakeUv(const v1::UvChunk& chunk);
  bool IsComplete() const;
  void StartAnew();

  // The context of the next stream. Throws CANCELLED after a stop if there is no job that must be cancelled.
  std::shared_ptr<grpc::ClientContext> NewContext(bool may_be_cut_off = true);
  void OnStop();
  void Ask();
  // Whether a stop ends this call and nothing else.
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
  bool in_callback_ = false;  // an exception that comes now is the caller's

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
  bool lost_stream_ = false;  // of the present job
  int lost_jobs_ = 0;

  // Guarded by mutex_: what a stop from another thread touches. Only the thread of Run() changes job_name_.
  std::mutex mutex_;
  std::condition_variable stopped_changed_;
  bool stopped_ = false;                              // what the caller wants of the job, beside finish_
  bool asked_cancel_ = false, asked_finish_ = false;  // and what the server was told
  std::string job_name_;
  std::shared_ptr<grpc::ClientContext> context_;
};

}  // namespace planish
