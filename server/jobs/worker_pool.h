// Threads that each see one job after the other through its worker.
#pragma once

#include <thread>
#include <vector>

#include "server/jobs/job_manager.h"
#include "server/link/worker_link.h"

namespace planish {

class WorkerPool {
 public:
  // Starts `workers` (>= 1) threads. `manager` must outlive the pool; `factory` makes a worker for each job.
  WorkerPool(JobManager* manager, WorkerFactory factory, int workers);

  // Waits for the threads: call JobManager::Stop() before.
  ~WorkerPool();

  WorkerPool(const WorkerPool&) = delete;
  WorkerPool& operator=(const WorkerPool&) = delete;

 private:
  void Serve(JobAssignment assignment);

  JobManager* const manager_;
  const WorkerFactory factory_;
  std::vector<std::thread> threads_;
};

}  // namespace planish
