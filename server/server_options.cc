#include "server/server_options.h"

#include <memory>
#include <mutex>
#include <string>
#include <string_view>
#include <utility>

#include "absl/strings/str_cat.h"
#include "absl/time/time.h"
#include "core/base/sanitizers.h"
#include "core/base/status_macros.h"
#include "core/base/trace_context.h"
#include "server/job_log.h"
#include "server/link/in_process_link.h"
#include "server/link/process_link.h"
#include "server/log/log.h"
#include "server/worker/needs.h"
#include "server/worker/options.h"
#include "server/worker/worker.h"

namespace planish {
namespace {

constexpr std::int64_t kInlineMeshBytes = 4 * kMiB;

// Longer than any stage of the largest meshes takes without sending progress.
constexpr absl::Duration kSilenceLimit = absl::Minutes(30);

}  // namespace

JobLimits LimitsFrom(const ServerFlags& flags) {
  JobLimits limits;
  limits.queue_capacity = flags.queue;
  limits.retained_bytes = flags.retain_mb * kMiB;
  limits.retained_time = absl::Hours(flags.retain_hours);
  limits.retained_record_bytes = flags.retain_records_mb * kMiB;
  limits.retained_record_time = absl::Hours(flags.retain_records_hours);
  limits.reattach_grace = absl::Seconds(flags.reattach_seconds);
  return limits;
}

JobManagerOptions ManagerOptionsFrom(const ServerFlags& flags) {
  JobManagerOptions options;
  options.limits = LimitsFrom(flags);
  options.workers = flags.workers;
  options.threads = flags.threads;
  options.short_workers = flags.short_workers;
  options.short_time = absl::Seconds(flags.short_seconds);
  options.queue_total = flags.queue_total;
  options.max_mesh_bytes = flags.max_mesh_mb * kMiB;
  options.max_triangles = flags.max_triangles;
  options.memory_bytes = flags.memory_mb * kMiB;
  options.lease = absl::Seconds(flags.store.lease_seconds);
  options.validate_options = ValidateOptions;
  options.estimate = [](std::string_view draco, std::int64_t mesh_bytes, const v1::MeshSize& size,
                        const v1::UnwrapOptions& unwrap) -> absl::StatusOr<JobNeeds> {
    PLANISH_ASSIGN_OR_RETURN(const WorkNeeds needs, EstimateNeeds(draco, mesh_bytes, size, unwrap));
    return JobNeeds{needs.size, needs.memory_bytes, needs.run_seconds};
  };
  options.on_transition = LogTransition;
  options.on_store_error = [](const absl::Status& status) { LogError(status.message()); };
  return options;
}

v1::Capabilities CapabilitiesFrom(const ServerFlags& flags) {
  v1::Capabilities capabilities;
  capabilities.set_version(PLANISH_VERSION);
  capabilities.set_max_mesh_bytes(flags.max_mesh_mb * kMiB);
  capabilities.set_max_triangles(flags.max_triangles);
  capabilities.set_upload_chunk_bytes(kUploadChunkBytes);
  capabilities.set_inline_mesh_bytes(kInlineMeshBytes);
  capabilities.set_threads(flags.threads);
  capabilities.set_durable(flags.store.is_durable());
  capabilities.set_isolated_workers(flags.isolated);
  for (const v1::Seams seams : SeamPolicies()) capabilities.add_seams(seams);
  for (const v1::SolverCombination& combination : SolverCombinations()) *capabilities.add_solvers() = combination;
  return capabilities;
}

WorkerPoolOptions PoolOptionsFrom(const ServerFlags& flags) {
  WorkerPoolOptions options;
  options.workers = flags.workers;
  options.recycle_after = flags.recycle_after;
  options.job_limit = absl::Hours(flags.job_hours);
  options.silence_limit = kSilenceLimit;
  if (kSanitized) options.first_limit *= 6;
  options.on_worker_ready = [said = std::make_shared<std::once_flag>()](const worker::v1::WorkerIdle& worker) {
    if (worker.sandbox_error().empty()) return;
    std::call_once(*said, [&] { LogWarn("workers run without their sandbox: " + worker.sandbox_error()); });
  };
  options.on_worker_end = [](const WorkerEnd& end) {
    const bool lost = !end.loss.message.empty();
    Log(lost ? LogLevel::kWarn : LogLevel::kDebug, absl::StrCat("worker ", NameOf(end.cause)),
        {{"job", end.job},
         {"trace", std::string(TraceIdOf(end.traceparent))},
         {"jobs_served", end.jobs},
         {"reason", end.loss.reason},
         {"error", end.loss.message}});
  };
  options.on_start_failed = [](const absl::Status& status, absl::Duration retry) {
    LogError("cannot start a worker",
             {{"error", std::string(status.message())}, {"retry_seconds", absl::ToDoubleSeconds(retry)}});
  };
  return options;
}

WorkerFactory WorkersFrom(const ServerFlags& flags, int stderr_fd) {
  if (!flags.isolated) {
    return [] { return StartInProcessWorker(RunWorker); };
  }
  WorkerProcessOptions options;
  options.sandbox = flags.sandbox;
  options.failpoints = flags.failpoints;
  options.stderr_fd = stderr_fd;
  if (!flags.worker_program.empty()) options.program = flags.worker_program;
  return [options] { return StartProcessWorker(options); };
}

}  // namespace planish
