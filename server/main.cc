// planishd: puts jobs, workers and RPC together and takes them down again in order (server/README.md).
#include <sys/resource.h>

#include <csignal>
#include <cstdlib>
#include <iostream>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <variant>

#include "absl/strings/str_join.h"
#include "absl/time/clock.h"
#include "core/base/heap.h"
#include "core/base/status_macros.h"
#include "google/protobuf/util/time_util.h"
#include "grpc/grpc.h"
#include "grpc/support/log.h"
#include "server/data_directory.h"
#include "server/flags.h"
#include "server/job_log.h"
#include "server/jobs/blob_store.h"
#include "server/jobs/job_manager.h"
#include "server/jobs/job_store.h"
#include "server/jobs/upload_store.h"
#include "server/jobs/worker_pool.h"
#include "server/link/in_process_link.h"
#include "server/link/process_link.h"
#include "server/rpc/caller_source.h"
#include "server/rpc/rpc_server.h"
#include "server/rpc/service.h"
#include "server/shutdown_events.h"
#include "server/upkeep.h"
#include "server/worker/needs.h"
#include "server/worker/options.h"
#include "server/worker/worker.h"
#include "server/worker_main.h"
#include "spdlog/sinks/stdout_color_sinks.h"
#include "spdlog/spdlog.h"

namespace planish {
namespace {

constexpr int kCannotServe = 2;
constexpr std::int64_t kMiB = std::int64_t{1} << 20;

// Large enough that messages cost nothing, small enough that a broken connection does not either.
constexpr std::int64_t kUploadChunkBytes = kMiB;
constexpr std::int64_t kInlineMeshBytes = 4 * kMiB;

// Longer than any stage of the largest meshes goes without a word.
constexpr absl::Duration kSilenceLimit = absl::Minutes(30);

constexpr absl::Duration kUpkeepInterval = absl::Milliseconds(100);

// How long workers may take to obey, and readers to take in the last events, before they are cut off.
constexpr absl::Duration kCancelLimit = absl::Seconds(5);
constexpr absl::Duration kCloseLimit = absl::Seconds(1);
constexpr absl::Duration kFlushLimit = absl::Seconds(2);
constexpr absl::Duration kLastCallsLimit = absl::Milliseconds(20);

void SetUpLogging(const ServerFlags& flags) {
  spdlog::set_default_logger(spdlog::stderr_color_mt("planishd"));
  spdlog::set_pattern("%Y-%m-%dT%H:%M:%S.%e%z %^%l%$ %v");
  spdlog::set_level(spdlog::level::from_str(flags.log_level));
  // What matters of gRPC's chatter reaches us as errors.
  gpr_set_log_function([](gpr_log_func_args* args) { spdlog::debug("grpc: {}", args->message); });
}

JobManagerOptions ManagerOptions(const ServerFlags& flags) {
  JobManagerOptions options;
  options.workers = flags.workers;
  options.threads = flags.threads;
  options.queue_capacity = flags.queue;
  options.queue_total = flags.queue_total;
  options.max_mesh_bytes = flags.max_mesh_mb * kMiB;
  options.max_triangles = flags.max_triangles;
  options.memory_bytes = flags.memory_mb * kMiB;
  options.retained_jobs = flags.retain_jobs;
  options.retained_bytes = flags.retain_mb * kMiB;
  options.retained_time = absl::Hours(flags.retain_hours);
  options.reattach_grace = absl::Seconds(flags.reattach_seconds);
  options.validate_options = ValidateOptions;
  options.estimate = [](std::string_view draco, std::int64_t mesh_bytes, const v1::MeshSize& size,
                        const v1::UnwrapOptions& unwrap) -> absl::StatusOr<JobNeeds> {
    PLANISH_ASSIGN_OR_RETURN(const WorkNeeds needs, EstimateNeeds(draco, mesh_bytes, size, unwrap));
    return JobNeeds{needs.size, needs.memory_bytes, needs.run_seconds};
  };
  options.on_transition = LogTransition;
  options.on_store_error = [](const absl::Status& status) { spdlog::error("{}", std::string(status.message())); };
  return options;
}

UploadStoreOptions UploadOptions(const ServerFlags& flags, const std::optional<DataDirectory>& directory) {
  UploadStoreOptions options;
  if (directory.has_value()) options.directory = directory->uploads();
  options.max_mesh_bytes = flags.max_mesh_mb * kMiB;
  options.max_bytes = flags.max_uploads_mb * kMiB;
  return options;
}

v1::Capabilities Capabilities(const ServerFlags& flags) {
  v1::Capabilities capabilities;
  capabilities.set_version(PLANISH_VERSION);
  capabilities.set_max_mesh_bytes(flags.max_mesh_mb * kMiB);
  capabilities.set_max_triangles(flags.max_triangles);
  capabilities.set_memory_bytes(flags.memory_mb * kMiB);
  capabilities.set_upload_chunk_bytes(kUploadChunkBytes);
  capabilities.set_inline_mesh_bytes(kInlineMeshBytes);
  capabilities.set_workers(flags.workers);
  capabilities.set_threads(flags.threads);
  capabilities.set_durable(!flags.data_dir.empty());
  capabilities.set_isolated_workers(flags.isolated);
  const auto grace = static_cast<std::int64_t>(flags.reattach_seconds * 1e9);
  *capabilities.mutable_reattach_grace() = google::protobuf::util::TimeUtil::NanosecondsToDuration(grace);
  for (const v1::Seams seams : SeamPolicies()) capabilities.add_seams(seams);
  for (const v1::SolverCombination& combination : SolverCombinations()) *capabilities.add_solvers() = combination;
  return capabilities;
}

// What is kept, in files or in memory. In the order of dependence.
struct Stores {
  std::optional<DataDirectory> directory;
  std::unique_ptr<JobStore> jobs;
  std::unique_ptr<BlobStore> blobs;
  std::unique_ptr<UploadStore> uploads;
};

absl::StatusOr<Stores> OpenStores(const ServerFlags& flags, const TenantLimitsSource& limits) {
  Stores stores;
  if (!flags.data_dir.empty()) {
    PLANISH_ASSIGN_OR_RETURN(stores.directory, DataDirectory::Take(flags.data_dir));
  }
  const bool durable = stores.directory.has_value();
  PLANISH_ASSIGN_OR_RETURN(stores.jobs, OpenJobStore(durable ? stores.directory->jobs() : ":memory:"));
  stores.blobs = std::make_unique<BlobStore>(durable ? stores.directory->blobs() : "", flags.store_mb * kMiB, limits);
  PLANISH_RETURN_IF_ERROR(stores.blobs->Open());
  stores.uploads = std::make_unique<UploadStore>(UploadOptions(flags, stores.directory), stores.blobs.get());
  PLANISH_RETURN_IF_ERROR(stores.uploads->Open());
  return stores;
}

WorkerFactory NewWorkers(const ServerFlags& flags) {
  if (!flags.isolated) {
    return [] { return StartInProcessWorker(RunWorker); };
  }
  WorkerProcessOptions options;
  options.sandbox = flags.sandbox;
  options.failpoints = flags.failpoints;
  return [options] { return StartProcessWorker(options); };
}

WorkerPoolOptions PoolOptions(const ServerFlags& flags) {
  WorkerPoolOptions options;
  options.workers = flags.workers;
  options.recycle_after = flags.recycle_after;
  options.job_limit = absl::Hours(flags.job_hours);
  options.silence_limit = kSilenceLimit;
  options.on_worker_ready = [said = std::make_shared<std::once_flag>()](const worker::v1::WorkerIdle& worker) {
    if (worker.sandbox_error().empty()) return;
    std::call_once(*said, [&] { spdlog::warn("workers run without their sandbox: {}", worker.sandbox_error()); });
  };
  options.on_worker_end = [](const WorkerEnd& end) {
    if (end.loss.message.empty()) {
      spdlog::debug("worker {} after {} jobs", NameOf(end.cause), end.jobs);
    } else {
      spdlog::warn("worker {} after {} jobs: {} {}", NameOf(end.cause), end.jobs, end.loss.message, end.job);
    }
  };
  options.on_start_failed = [](const absl::Status& status, absl::Duration retry) {
    spdlog::error("cannot start a worker, next attempt in {}: {}", absl::FormatDuration(retry),
                  std::string(status.message()));
  };
  return options;
}

// Waits for idleness. False if `limit` passes first, or a signal or the supervisor's end cuts it short.
bool WaitUntilIdle(absl::Duration limit, ShutdownEvents* events) {
  return events->Wait(limit) == Wake::kIdle;
}

// Returns when every job has ended or, if jobs are `durable`, was left to the next server. False if workers did not
// answer, and still run.
bool EndJobs(absl::Duration grace, bool durable, JobManager* manager, ShutdownEvents* events) {
  manager->Drain([events] { events->NotifyIdle(); });
  if (WaitUntilIdle(grace, events)) return true;
  if (durable) {
    spdlog::info("leaving the jobs that are left to the next server");
    manager->Suspend();
    return true;
  }
  spdlog::info("cancelling the jobs that are left");
  manager->CancelAll();
  const absl::Time limit = absl::Now() + kCancelLimit;
  while (absl::Now() < limit) {
    if (WaitUntilIdle(limit - absl::Now(), events)) return true;
  }
  spdlog::warn("giving up workers that did not answer");
  manager->CloseLinks();
  WaitUntilIdle(kCloseLimit, events);
  return false;
}

// Each job kept or waiting may hold descriptors, and each connection does.
void AllowManyDescriptors() {
  rlimit limit;
  if (getrlimit(RLIMIT_NOFILE, &limit) != 0) return;
  limit.rlim_cur = limit.rlim_max;
  setrlimit(RLIMIT_NOFILE, &limit);
}

int Refuse(const absl::Status& status) {
  std::cerr << "planishd: " << status.message() << "\n";
  return kCannotServe;
}

int Serve(const ServerFlags& flags) {
  ShutdownEvents events(flags.supervisor_fd);  // before any thread: it blocks the signals for all of them
  // Never taken back: the last grpc_shutdown() joins gRPC's own threads, one of which may sit in a poll for 10 s.
  grpc_init();
  SetUpLogging(flags);
  AllowManyDescriptors();
  std::signal(SIGXFSZ, SIG_IGN);    // a file that may not grow is a disk that is full
  KeepFreedMemory();                // until the job ends (worker.cc)
  const TenantLimitsSource limits;  // nobody has any
  absl::StatusOr<Stores> stores = OpenStores(flags, limits);
  if (!stores.ok()) return Refuse(stores.status());
  JobManagerOptions options = ManagerOptions(flags);
  options.tenant_limits = limits;
  options.is_blob_used = [uploads = stores->uploads.get()](const BlobId& id) { return uploads->Uses(id); };
  const absl::StatusOr<std::unique_ptr<JobManager>> opened =
      JobManager::Open(std::move(options), stores->jobs.get(), stores->blobs.get());
  if (!opened.ok()) return Refuse(opened.status());
  JobManager& manager = **opened;
  stores->uploads->SetMakeRoom(
      [&manager](const std::string& tenant, std::int64_t bytes) { return manager.MakeRoom(tenant, bytes); });
  StreamCounter streams;
  const std::unique_ptr<CallerSource> callers = NewOpenCallerSource();
  const std::unique_ptr<grpc::Service> service = NewPlanishService(&manager, stores->uploads.get(), callers.get(),
                                                                   {Capabilities(flags), flags.failpoints}, &streams);
  absl::StatusOr<std::unique_ptr<RpcServer>> rpc =
      RpcServer::Start({flags.listen, flags.max_mesh_mb * kMiB}, service.get());
  if (!rpc.ok()) return Refuse(rpc.status());
  auto pool = std::make_unique<WorkerPool>(&manager, NewWorkers(flags), PoolOptions(flags));
  auto upkeep = std::make_unique<Upkeep>(kUpkeepInterval, [&manager, uploads = stores->uploads.get()] {
    manager.Tick();
    uploads->Tick(absl::Now());
  });

  spdlog::info("planishd " PLANISH_VERSION " listens on {} with {} workers of up to {} threads",
               absl::StrJoin((*rpc)->addresses(), ", "), flags.workers, flags.threads);
  for (const ListenAddress& address : flags.listen) {
    if (!IsLocal(address))
      spdlog::warn("{} is open to the network, without encryption or authentication", address.text);
  }
  events.TellReady();

  const Wake wake = events.Wait(absl::InfiniteDuration());
  const absl::Duration grace = wake == Wake::kSignal ? absl::Seconds(flags.grace_seconds) : absl::ZeroDuration();
  spdlog::info("shutting down, jobs have {} to end", absl::FormatDuration(grace));
  (*rpc)->SetServing(false);
  const bool workers_done = EndJobs(grace, !flags.data_dir.empty(), &manager, &events);
  streams.WaitForNone(absl::Now() + kFlushLimit);
  (*rpc)->Shutdown(absl::Now() + kLastCallsLimit);
  manager.StopWorkers();
  // A worker that is deaf cannot be joined; its job has failed, so nothing is lost with it.
  if (!workers_done) std::_Exit(EXIT_SUCCESS);
  pool.reset();
  upkeep.reset();
  spdlog::info("bye");
  // gRPC's threads may outlive the logger.
  gpr_set_log_function(nullptr);
  return EXIT_SUCCESS;
}

}  // namespace
}  // namespace planish

int main(int argc, char** argv) {
  if (const std::optional<int> code = planish::RunIfWorker(argc, argv)) return *code;
  const std::variant<planish::ServerFlags, int> flags = planish::ParseFlags(argc, argv);
  if (const int* code = std::get_if<int>(&flags)) return *code;
  return planish::Serve(std::get<planish::ServerFlags>(flags));
}
