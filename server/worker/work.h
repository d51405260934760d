// Runs one job, from request to result, on the calling thread.
#pragma once

#include <functional>
#include <optional>
#include <string_view>
#include <vector>

#include "absl/status/status.h"
#include "core/base/interrupter.h"
#include "planish/worker/v1/worker.pb.h"
#include "server/link/blob.h"

namespace planish {

// Thins out progress. Every change of stage passes; with a single chart, also every Newton iteration and every report
// between two linear solves. All other progress, such as the Newton iterations of a thousand charts, passes at most
// every `kIntervalSeconds`.
class ProgressThrottle {
 public:
  static constexpr double kIntervalSeconds = 0.1;

  // Whether to send `progress`, whose `elapsed` is set.
  bool Pass(const v1::Progress& progress);

 private:
  std::optional<v1::Progress> last_;  // the last progress that passed
};

// Interrupters and callbacks of one job.
struct WorkControl {
  const Interrupter* cancel = nullptr;  // ends the job without a result
  const Interrupter* stop = nullptr;    // ends the job soon, with the best map so far
  // Called with progress that passes the ProgressThrottle, on the working thread.
  std::function<void(const v1::Progress&)> on_progress;
  // Called at the points of server/worker/failpoints.h; a status other than OK ends the job.
  std::function<absl::Status(std::string_view point)> at_point;
};

struct WorkOutcome {
  worker::v1::WorkResult result;
  BlobPtr uv;  // the UV bytes; null unless the work succeeded
};

// The error of a job whose worker ran out of memory: RESOURCE_EXHAUSTED with OUT_OF_MEMORY.
absl::Status OutOfMemory();

// Decodes, unwraps, packs. `blobs` as they come with the request (planish.worker.v1.WorkRequest). Never throws: errors
// become the result's status (OUT_OF_MEMORY and INTERNAL for exceptions, also those of callbacks). After a cancel the
// result is CANCELLED, as soon as Unwrap() notices it.
WorkOutcome DoWork(const worker::v1::WorkRequest& request, const std::vector<BlobPtr>& blobs,
                   const WorkControl& control);

}  // namespace planish
