// Follows one job from its stream's first event to the last UV byte, over as many streams as that takes.
#pragma once

#include <chrono>
#include <condition_variable>
#include <functional>
#include <memory>
#include <mutex>
#include <optional>
#include <stop_token>
#include <string>

#include "client/src/backoff.h"
#include "client/src/mesh_packer.h"
#include "client/src/mesh_sender.h"
#include "client/src/rpc.h"

namespace planish {
inline namespace abi0 {

// What to follow: a mesh to be unwrapped (`unwrap` set), or a job that exists (`watch` set).
struct FollowPlan {
  std::optional<v1::UnwrapRequest> unwrap;
  std::optional<v1::WatchJobRequest> watch;
  // The mesh that is sent with `unwrap`, that the UV must belong to, and whose numbering errors are told in; may be
  // null with `watch`. Must outlive the follower, which takes the Draco bytes out if they travel inside the request.
  PackedMesh* mesh = nullptr;
  CallOptions call;                                     // traceparent: valid, of the whole call
  std::stop_token finish;                               // a request to stop the job and bring what it has
  std::function<void(const std::string&)> on_job_name;  // on the thread of Run()
};

struct Followed {
  v1::Job job;  // terminal
  std::string uv_bytes;
  double upload_seconds = 0;    // from the start of Run() to the first event
  double download_seconds = 0;  // from the last event to the last byte
};

class Follower {
 public:
  Follower(std::shared_ptr<Rpc> rpc, const ClientOptions& options, FollowPlan plan, const Callbacks& callbacks);

  // Once. Returns when the job ended, whatever its end, and its UV are here if it succeeded and they were asked for.
  // Throws planish::Error otherwise. The name of the job, if there is one, is in the error.
  Followed Run();

 private:
  using Clock = std::chrono::steady_clock;

  void RunOneStream();
  void TakeEvent(const v1::JobEvent& event);
  void TakeUv(const v1::UvChunk& chunk);
  bool IsComplete() const;
  void OnStreamError(const Error& error);
  void OnLost(const Error& error);
  void PauseBeforeRetry(const Error& why, double seconds);
  void StartAnew();
  void OnStop();
  void OnFinish();
  std::string JobName();
  [[noreturn]] void ThrowCancelled() const;

  const std::shared_ptr<Rpc> rpc_;
  const ClientOptions options_;
  FollowPlan plan_;
  const Callbacks& callbacks_;
  const Deadline deadline_;
  const bool wants_uv_;
  std::optional<MeshSender> sender_;  // with plan_.unwrap
  Backoff backoff_;

  Clock::time_point start_ = Clock::now();
  std::optional<Clock::time_point> first_event_, last_event_;
  Followed followed_;
  std::int64_t last_sequence_ = 0;
  bool lost_stream_ = false;               // of the present job
  std::optional<Clock::time_point> lost_;  // when the trouble began that nothing came through since
  int lost_jobs_ = 0;
  double queue_full_waited_ = 0;

  // Guarded by mutex_: what a stop from another thread touches.
  std::mutex mutex_;
  std::condition_variable stopped_changed_;
  bool stopped_ = false;
  bool finishing_ = false;
  std::string job_name_;
  std::unique_ptr<Stream> stream_;
};

}  // namespace abi0
}  // namespace planish
