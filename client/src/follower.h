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

#include "client/src/mesh_packer.h"
#include "client/src/rpc.h"

namespace planish {
inline namespace api {

// What to follow: a mesh to be unwrapped (`unwrap` set), or a job that exists (`watch` set).
struct FollowPlan {
  std::optional<v1::UnwrapRequest> unwrap;
  std::optional<v1::WatchJobRequest> watch;
  // The mesh the UV must belong to, and the numbering of ids in errors; may be null. Must outlive the follower.
  const PackedMesh* mesh = nullptr;
  CallOptions call;
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
  void PauseBeforeRetry(const Error& why, double seconds);
  void StartAnew();
  void OnStop();
  [[noreturn]] void ThrowCancelled() const;
  double SecondsLeft() const;

  const std::shared_ptr<Rpc> rpc_;
  const ClientOptions options_;
  FollowPlan plan_;
  const Callbacks& callbacks_;
  const Deadline deadline_;
  const bool wants_uv_;

  Clock::time_point start_ = Clock::now();
  std::optional<Clock::time_point> first_event_, last_event_;
  Followed followed_;
  std::int64_t last_sequence_ = 0;
  bool reached_ = false;      // the server, ever
  bool lost_stream_ = false;  // of the present job
  int failures_ = 0;          // in a row
  int lost_jobs_ = 0;
  double queue_full_waited_ = 0;

  // Guarded by mutex_: what a stop from another thread touches.
  std::mutex mutex_;
  std::condition_variable stopped_changed_;
  bool stopped_ = false;
  std::string job_name_;
  std::unique_ptr<Stream> stream_;
};

}  // namespace api
}  // namespace planish
