// Workers that are kept ready, served with one job after the other, watched, and replaced when they die, hang or grow.
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

// Why a worker is no longer there.
enum class WorkerEndCause {
  kRecycled,     // served recycle_after jobs
  kGrown,        // held more than recycle_bytes when idle, or its memory had run out
  kCrashed,      // died, or broke the protocol, with or without a job
  kHung,         // killed: a stage, the job or the silence took too long, or it did not get ready again
  kDisobedient,  // killed: the job was to end and did not, or nobody wanted it any more
  kShutdown,     // the pool ended
};
const char* NameOf(WorkerEndCause cause);  // "recycled", ...

struct WorkerEnd {
  WorkerEndCause cause = WorkerEndCause::kShutdown;
  WorkerLoss loss;          // kCrashed, kHung, kDisobedient
  std::string job;          // that was lost with it; empty: none
  std::string traceparent;  // of the job it had, or had last; empty: none
  int jobs = 0;             // it served
  absl::Duration lived;     // since it was ready
};

struct WorkerPoolOptions {
  int workers = 1;                                       // >= 1
  int recycle_after = 200;                               // jobs, >= 1
  std::int64_t recycle_bytes = std::int64_t{256} << 20;  // WorkerIdle.held_bytes
  absl::Duration start_limit = absl::Seconds(30);        // to get ready, at the start and between two jobs
  // Where no worker has been ready yet: starts of one place that fail, >= 1, and time since the pool began, after which
  // on_none_ready is called, once. A machine that starts no worker in that time will start none.
  int first_starts = 5;
  absl::Duration first_limit = absl::Seconds(10);
  absl::Duration retry_min = absl::Milliseconds(100);  // after a start that failed; doubles up to retry_max
  absl::Duration retry_max = absl::Seconds(10);
  // Until a mesh is decoded: decode_limit and decode_limit_per_mib for each MiB of Draco.
  absl::Duration decode_limit = absl::Seconds(30);
  absl::Duration decode_limit_per_mib = absl::Seconds(2);
  absl::Duration silence_limit = absl::Seconds(300);       // between two messages of a worker with a job
  absl::Duration job_limit = absl::InfiniteDuration();     // of a whole job
  absl::Duration look_interval = absl::Milliseconds(100);  // between two looks at JobSource::ObeyBy()
  absl::Duration idle_look_interval = absl::Seconds(1);    // between two looks whether an idle worker lives
  // Called on the pool's threads, so they must be quick and thread-safe; null: nobody listens.
  std::function<void(const worker::v1::WorkerIdle&)> on_worker_ready;  // for the first time
  std::function<void(const WorkerEnd&)> on_worker_end;
  std::function<void(const absl::Status& status, absl::Duration retry_in)> on_start_failed;
  std::function<void(const absl::Status& last)> on_none_ready;  // `last`: how the last start failed
  std::function<absl::Time()> steady_clock = SteadyNow;         // of JobSource::ObeyBy()
};

// A thread for each worker, which takes a job only when its worker is there and ready: one that cannot be started or
// dies between jobs costs no job.
class WorkerPool {
 public:
  // Starts the workers. `source` must outlive the pool.
  WorkerPool(JobSource* source, WorkerFactory factory, WorkerPoolOptions options);

  // Waits for jobs under way: make TakeNext() return before.
  ~WorkerPool();

  // WorkerPoolOptions::recycle_after from now on. Thread-safe.
  void SetRecycleAfter(int jobs) { recycle_after_ = jobs; }

  WorkerPool(const WorkerPool&) = delete;
  WorkerPool& operator=(const WorkerPool&) = delete;

 private:
  class Seat;

  // A start failed, the `failed`th of its place.
  void NoteFailedStart(const absl::Status& status, int failed);
  // Time left until first_limit, not below 0.
  absl::Duration FirstTimeLeft() const;

  // Whether the pool ends before `duration` is over.
  bool EndsWithin(absl::Duration duration);

  JobSource* const source_;
  const WorkerFactory factory_;
  const WorkerPoolOptions options_;
  std::atomic<int> recycle_after_;
  const std::chrono::steady_clock::time_point began_ = std::chrono::steady_clock::now();
  std::atomic<bool> any_ready_ = false;  // a worker was, once
  std::atomic<bool> told_ = false;       // on_none_ready was called

  std::mutex mutex_;
  std::condition_variable ending_changed_;
  bool ending_ = false;  // guarded by mutex_

  std::vector<std::thread> threads_;
};

}  // namespace planish
