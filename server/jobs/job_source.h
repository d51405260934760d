// The interface through which workers get jobs and report on them.
#pragma once

#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "absl/time/time.h"
#include "planish/v1/job.pb.h"
#include "planish/worker/v1/worker.pb.h"
#include "server/link/blob.h"
#include "server/link/worker_link.h"

namespace planish {

struct JobAssignment {
  std::string name;
  int attempt = 1;  // reports for any other attempt are late and ignored
  worker::v1::WorkRequest request;
  std::vector<BlobPtr> blobs;
};

// The result of asking for work.
enum class Turn {
  kWork,     // there is work
  kNothing,  // no work within the given time
  kOver,     // there will be no more work
};

// What WorkerPool needs of JobRunner. Thread-safe.
class JobSource {
 public:
  virtual ~JobSource() = default;

  // Waits at most `patience` for a job, and fills `assignment` if there is one.
  virtual Turn TakeNext(absl::Duration patience, JobAssignment* assignment) = 0;

  // Sets the link of the worker, after the WorkRequest was sent to it. Cancellations and stops go there, including
  // those that came before this call.
  virtual void SetLink(const std::string& name, int attempt, std::shared_ptr<WorkerLink> link) = 0;

  virtual void ReportProgress(const std::string& name, int attempt, v1::Progress progress) = 0;
  // `uv` is null unless the worker sent bytes with its result.
  virtual void ReportResult(const std::string& name, int attempt, worker::v1::WorkResult result, BlobPtr uv) = 0;
  virtual void ReportLost(const std::string& name, int attempt, WorkerLoss loss) = 0;

  // The time, by the steady clock, at which the worker is killed if the job has not ended. The infinite future unless
  // the job was cancelled or ran out of time; the infinite past if nobody wants its result any more.
  virtual absl::Time ObeyBy(const std::string& name, int attempt) = 0;
};

}  // namespace planish
