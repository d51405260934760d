// Where workers get their jobs from, and whom they tell how it goes.
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
  int attempt = 1;  // whatever is reported for another one is late and ignored
  worker::v1::WorkRequest request;
  std::vector<BlobPtr> blobs;
};

// What comes of asking for work.
enum class Turn {
  kWork,     // there is some
  kNothing,  // not within the time given
  kOver,     // there will be no more
};

// What WorkerPool needs of JobRunner. Thread-safe.
class JobSource {
 public:
  virtual ~JobSource() = default;

  // Waits for a job, at most for `patience`, and fills `assignment` if there is one.
  virtual Turn TakeNext(absl::Duration patience, JobAssignment* assignment) = 0;

  // Tells who is at work, after the WorkRequest was sent: cancellations and stops go there, also those from before.
  virtual void SetLink(const std::string& name, int attempt, std::shared_ptr<WorkerLink> link) = 0;

  virtual void ReportProgress(const std::string& name, int attempt, v1::Progress progress) = 0;
  // `uv` is null unless the worker sent bytes with its result.
  virtual void ReportResult(const std::string& name, int attempt, worker::v1::WorkResult result, BlobPtr uv) = 0;
  virtual void ReportLost(const std::string& name, int attempt, WorkerLoss loss) = 0;

  // When, by the steady clock, the worker is to be killed if the job has not ended by then: the infinite future, unless
  // the job was cancelled or ran out of time; the infinite past if nobody wants its result any more.
  virtual absl::Time ObeyBy(const std::string& name, int attempt) = 0;
};

}  // namespace planish
