// What a worker is given: one or more jobs that ask for the same.
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "absl/time/time.h"
#include "planish/v1/job.pb.h"
#include "server/jobs/job_request.h"
#include "server/link/worker_link.h"

namespace planish {

struct Work {
  std::string name;               // of the job that it began with
  std::string key;                // WorkKey()
  std::string tenant;             // whose jobs these are
  std::vector<std::string> jobs;  // at least one, in the order they came
  std::int64_t mesh_bytes = 0;
  JobNeeds needs;

  // One of its jobs was lost with the server before and has one attempt left: nothing else runs beside it, so that a
  // mesh that takes servers down takes no other job's attempts with it.
  bool alone = false;

  // While a worker has it.
  bool running = false;
  int attempt = 0;  // counts up each time a worker gets it: tells a late worker from the present one
  absl::Time start;
  std::shared_ptr<WorkerLink> link;
  bool cancelled = false;  // the worker was told
  bool stopped = false;    // likewise
  absl::Time obey_by = absl::InfiniteFuture();
  std::optional<v1::Progress> progress;

  void SendCancel();
  void SendStop();
};

}  // namespace planish
