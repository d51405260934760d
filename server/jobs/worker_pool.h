// A pool of workers. Each is kept ready, gets one job after the other, is watched, and is replaced when it dies, hangs
// or grows.
#pragma once

#include <atomic>
#include <chrono>
#include <condition_variable>
#include <cstdint>
#include <functional>
#include <memory>
#include <mutex>
#include <string>
#include <thread>
#include <vector>

#include "absl/time/time.h"
#include "server/jobs/job_source.h"
#include "server/jobs/steady_clock.h"
#include "server/link/worker_link.h"

namespace planish {

// Why a worker was ended.
enum class WorkerEndCause {
  kRecycled,     // served recycle_after jobs
  kGrown,        // held more than recycle_bytes when idle, or its memory had run out
  kCrashed,      // died, or broke the protocol, with or without a job
  kHung,         // killed: a stage, the job or a silence took too long, or it did not become ready again
  kDisobedient,  // killed: the job was told to end and did not, or nobody wanted it any more
  kShutdown,     // the pool ended
};
const char* NameOf(WorkerEndCause cause);  // "recycled", ...

struct WorkerEnd {
  WorkerEndCause cause = WorkerEndCause::kShutdown;
  WorkerLoss loss;          // for kCrashed, kHung, kDisobedient
  std::string job;          // the job that was lost with it; empty: none
  std::string traceparent;  // of its current or last job; empty: none
  int jobs = 0;             // jobs it served
  absl::Duration lived;     // time since it was first ready
};

struct WorkerPoolOptions {
  int workers = 1;                                       // >= 1
  int recycle_after = 200;                               // jobs after which a worker is replaced, >= 1
  std::int64_t recycle_bytes = std::int64_t{256} << 20;  // an idle worker that holds more is replaced
  absl::Duration start_limit = absl::Seconds(30);        // time to become ready, at the start and between two jobs
  // While no worker has ever been ready: on_none_ready is called, once, after this many failed starts of one thread (>=
  // 1), or after this time. A machine that starts no worker by then is assumed to be unable to.
  int first_starts = 5;
  absl::Duration first_limit = absl::Seconds(10);
  absl::Duration retry_min = absl::Milliseconds(100);  // delay after a failed start; doubles up to retry_max
  absl::Duration retry_max = absl::Seconds(10);
  // Time limit of decoding: decode_limit plus decode_limit_per_mib for each MiB of Draco.
  absl::Duration decode_limit = absl::Seconds(30);
  absl::Duration decode_limit_per_mib = absl::Seconds(2);
  absl::Duration silence_limit = absl::Seconds(300);       // longest silence of a worker with a job
  absl::Duration job_limit = absl::InfiniteDuration();     // longest time of a job
  absl::Duration look_interval = absl::Milliseconds(100);  // poll interval for JobSource::ObeyBy()
  absl::Duration idle_look_interval = absl::Seconds(1);    // interval between checks that an idle worker is alive
  // Called on the pool's threads, so they must be quick and thread-safe; null: nobody listens.
  std::function<void(const worker::v1::WorkerIdle&)> on_worker_ready;  // when a worker is first ready
  std::function<void(const WorkerEnd&)> on_worker_end;
  std::function<void(const absl::Status& status, absl::Duration retry_in)> on_start_failed;
  std::function<void(const absl::Status& last)> on_none_ready;  // `last`: how the last start failed
  std::function<absl::Time()> steady_clock = SteadyNow;         // the clock of JobSource::ObeyBy()
};

// Has a thread for each worker. The thread takes a job only when its worker is ready, so a worker that cannot be
// started or dies between jobs costs no job an attempt.
class WorkerPool {
 public:
  // Starts the workers. `source` must outlive the pool.
  WorkerPool(JobSource* source, WorkerFactory factory, WorkerPoolOptions options);

  // Waits for running jobs. Before, make JobSource::TakeNext() return kOver.
  ~WorkerPool();

  // Changes WorkerPoolOptions::recycle_after. Thread-safe.
  void SetRecycleAfter(int jobs) { recycle_after_ = jobs; }

  WorkerPool(const WorkerPool&) = delete;
  WorkerPool& operator=(const WorkerPool&) = delete;

 private:
  class Seat;

  // Handles a failed start, the `failed`th in a row of one thread.
  void NoteFailedStart(const absl::Status& status, int failed);
  // Time left until first_limit, at least 0.
  absl::Duration FirstTimeLeft() const;

  // Waits for `duration`, or until the pool ends. Returns whether it ends.
  bool EndsWithin(absl::Duration duration);

  JobSource* const source_;
  const WorkerFactory factory_;
  const WorkerPoolOptions options_;
  std::atomic<int> recycle_after_;
  const std::chrono::steady_clock::time_point began_ = std::chrono::steady_clock::now();
  std::atomic<bool> any_ready_ = false;  // a worker was ready at least once
  std::atomic<bool> told_ = false;       // on_none_ready was called

  std::mutex mutex_;
  std::condition_variable ending_changed_;
  bool ending_ = false;  // guarded by mutex_

  std::vector<std::thread> threads_;
};

}  // namespace planish
