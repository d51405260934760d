#include "server/daemon.h"

#include <sys/resource.h>
#include <unistd.h>

#include <cerrno>
#include <csignal>
#include <cstdlib>
#include <cstring>
#include <iostream>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <variant>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"
#include "absl/time/clock.h"
#include "core/base/error.h"
#include "core/base/heap.h"
#include "core/base/program_path.h"
#include "core/base/sanitizers.h"
#include "core/base/status_macros.h"
#include "core/base/trace_context.h"
#include "google/protobuf/stubs/logging.h"
#include "google/protobuf/util/time_util.h"
#include "grpc/grpc.h"
#include "grpc/support/log.h"
#include "server/admin.h"
#include "server/blobs/blob_catalog.h"
#include "server/farm.h"
#include "server/flags.h"
#include "server/front_door.h"
#include "server/job_log.h"
#include "server/jobs/job_manager.h"
#include "server/jobs/upload_store.h"
#include "server/jobs/worker_pool.h"
#include "server/link/in_process_link.h"
#include "server/link/process_link.h"
#include "server/log/log.h"
#include "server/log/output_lines.h"
#include "server/metrics/store_probe.h"
#include "server/monitoring.h"
#include "server/reload.h"
#include "server/rpc/rpc_server.h"
#include "server/rpc/service.h"
#include "server/service_manager.h"
#include "server/shutdown_events.h"
#include "server/store/ids.h"
#include "server/stores.h"
#include "server/upkeep.h"
#include "server/worker/needs.h"
#include "server/worker/options.h"
#include "server/worker/worker.h"
#include "server/worker_main.h"

namespace planish {
namespace {

constexpr int kCannotServe = 2;

// Large enough that messages cost nothing, small enough that a broken connection does not either.
constexpr std::int64_t kUploadChunkBytes = kMiB;
constexpr std::int64_t kInlineMeshBytes = 4 * kMiB;

// Longer than any stage of the largest meshes goes without a word.
constexpr absl::Duration kSilenceLimit = absl::Minutes(30);

constexpr absl::Duration kUpkeepInterval = absl::Milliseconds(100);
constexpr absl::Duration kTidyInterval = absl::Seconds(1);
constexpr absl::Duration kFileWatchInterval = absl::Milliseconds(250);

// How long workers may take to obey, and readers to take in the last events, before they are cut off.
constexpr absl::Duration kCancelLimit = absl::Seconds(5);
constexpr absl::Duration kCloseLimit = absl::Seconds(1);
constexpr absl::Duration kFlushLimit = absl::Seconds(2);
constexpr absl::Duration kLastCallsLimit = absl::Milliseconds(20);

void SetUpLogging(const ServerFlags& flags) {
  SetUpLog(flags.log_format, flags.log_level);
  // What matters of gRPC's chatter reaches us as errors.
  gpr_set_log_function([](gpr_log_func_args* args) { LogDebug(args->message, {{"source", "grpc"}}); });
  // Mostly about texts of callers that are not UTF-8; they hear of that themselves.
  google::protobuf::SetLogHandler([](google::protobuf::LogLevel level, const char*, int, const std::string& message) {
    Log(level == google::protobuf::LOGLEVEL_FATAL ? LogLevel::kError : LogLevel::kDebug, message,
        {{"source", "protobuf"}});
  });
}

JobLimits Limits(const ServerFlags& flags) {
  JobLimits limits;
  limits.queue_capacity = flags.queue;
  limits.retained_bytes = flags.retain_mb * kMiB;
  limits.retained_time = absl::Hours(flags.retain_hours);
  limits.retained_record_bytes = flags.retain_records_mb * kMiB;
  limits.retained_record_time = absl::Hours(flags.retain_records_hours);
  limits.reattach_grace = absl::Seconds(flags.reattach_seconds);
  return limits;
}

JobManagerOptions ManagerOptions(const ServerFlags& flags) {
  JobManagerOptions options;
  options.limits = Limits(flags);
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

v1::Capabilities Capabilities(const ServerFlags& flags) {
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

void UpdateCapabilities(const JobLimits& limits, const JobCapacity& capacity, v1::Capabilities* capabilities) {
  capabilities->set_workers(capacity.workers);
  capabilities->set_memory_bytes(capacity.memory_bytes);
  *capabilities->mutable_reattach_grace() =
      google::protobuf::util::TimeUtil::NanosecondsToDuration(absl::ToInt64Nanoseconds(limits.reattach_grace));
}

// `stderr_fd`: WorkerProcessOptions.
WorkerFactory NewWorkers(const ServerFlags& flags, int stderr_fd) {
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

// Why no worker can be started, from the pool's threads to the main one.
class NoWorkers {
 public:
  void Set(const absl::Status& last, ShutdownEvents* events) {
    {
      const std::lock_guard lock(mutex_);
      status_ = MakeError(absl::StatusCode::kUnavailable, "NO_WORKERS",
                          absl::StrCat("no worker can be started: ", last.message()));
    }
    events->NotifyFailed();
  }

  absl::Status status() {
    const std::lock_guard lock(mutex_);
    return status_;
  }

 private:
  std::mutex mutex_;
  absl::Status status_;  // guarded by mutex_
};

WorkerPoolOptions PoolOptions(const ServerFlags& flags) {
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

// Waits for idleness. False if `limit` passes first, or a signal or the supervisor's end cuts it short. It is too late
// for new settings.
bool WaitUntilIdle(absl::Duration limit, ShutdownEvents* events) {
  const absl::Time end = absl::Now() + limit;
  Wake wake = events->Wait(limit);
  while (wake == Wake::kReload) wake = events->Wait(end - absl::Now());
  return wake == Wake::kIdle;
}

// Returns when every job has ended or, if the store outlives this process, was left to another server. False if workers
// did not answer, and still run.
bool EndJobs(absl::Duration grace, const ServerFlags& flags, JobManager* manager, ShutdownEvents* events) {
  manager->Drain([events] { events->NotifyIdle(); });
  const bool idle = WaitUntilIdle(grace, events);
  // In a farm jobs go on elsewhere, and so do those that watch them here.
  if (idle && !flags.store.is_farm()) return true;
  if (flags.store.is_durable()) {
    if (!idle) LogInfo("leaving the jobs that are left to another server");
    manager->Suspend();
    return true;
  }
  LogInfo("cancelling the jobs that are left");
  manager->CancelAll();
  const absl::Time limit = absl::Now() + kCancelLimit;
  while (absl::Now() < limit) {
    if (WaitUntilIdle(limit - absl::Now(), events)) return true;
  }
  LogWarn("giving up workers that did not answer");
  manager->CloseLinks();
  WaitUntilIdle(kCloseLimit, events);
  return false;
}

void LogReadiness(const std::string& why_not) {
  if (why_not.empty()) {
    LogInfo("ready again");
  } else {
    LogWarn("not ready: " + why_not);
  }
}

void LogClockSkew(absl::Duration ahead) {
  if (ahead == absl::ZeroDuration()) return LogInfo("this machine's clock agrees with the database's again");
  LogWarn(absl::StrCat("this machine's clock is ", absl::FormatDuration(absl::AbsDuration(ahead)),
                       ahead > absl::ZeroDuration() ? " ahead of" : " behind",
                       " the database's: set it by NTP. Jobs go by the database's clock, but certificates, credentials "
                       "that expire, and the times in this log go by this one"));
}

// Whether the store answers and takes what is written; may wait for ever. Null: it is in this process.
std::function<absl::Status()> StoreQuestion(const Stores& stores, const Farm* farm) {
  if (!stores.directory.has_value() && farm == nullptr) return nullptr;
  return [&stores, farm]() -> absl::Status {
    if (stores.directory.has_value()) {
      PLANISH_ASSIGN_OR_RETURN(const std::int64_t shortage, stores.DiskShortage(0));
      PLANISH_RETURN_IF_ERROR(TryToWrite(stores.directory->path()));
      // Below that, old results give way to new meshes.
      if (shortage > 0 && shortage > stores.blobs->bytes()) {
        return absl::ResourceExhaustedError(
            absl::StrCat("the disk of ", stores.directory->path(), " is nearly full: ", shortage >> 20,
                         " MiB more must be free before new meshes are taken (deploy/OPERATION.md)"));
      }
    }
    if (farm != nullptr) PLANISH_RETURN_IF_ERROR(farm->LastTick());
    return stores.jobs()->Find("jobs/none").status();
  };
}

WatchedServer Watched(const ServerFlags& flags, const Stores& stores, const Farm* farm, const JobManager* manager,
                      const StreamCounter* streams, RpcServer* rpc) {
  WatchedServer server;
  server.jobs = manager;
  server.uploads = stores.uploads.get();
  server.blobs = stores.blobs.get();
  server.streams = streams;
  server.rpc = rpc;
  server.ask_store = StoreQuestion(stores, farm);
  server.workers = flags.workers;
  server.memory_limit_bytes = flags.memory_mb * kMiB;
  server.store_limit_bytes = flags.store_mb * kMiB;
  server.uploads_limit_bytes = flags.max_uploads_mb * kMiB;
  return server;
}

// This server, as others see it.
ServerEntry Self(const ServerFlags& flags) {
  return {RandomId(), AnswersCallers(flags.store.role), flags.workers, flags.memory_mb * kMiB, PLANISH_VERSION};
}

// What it does, for the log. `rpc` may be null.
std::string Describe(const ServerFlags& flags, const RpcServer* rpc) {
  std::vector<std::string> parts;
  if (rpc != nullptr) parts.push_back("listens on " + absl::StrJoin(rpc->addresses(), ", "));
  if (flags.workers > 0) {
    parts.push_back(absl::StrCat("runs jobs with ", flags.workers, " workers of up to ", flags.threads, " threads"));
  }
  return absl::StrJoin(parts, " and ");
}

// Each job kept or waiting may hold descriptors, and each connection does.
void AllowManyDescriptors() {
  rlimit limit;
  if (getrlimit(RLIMIT_NOFILE, &limit) != 0) return;
  limit.rlim_cur = limit.rlim_max;
  setrlimit(RLIMIT_NOFILE, &limit);
}

int Refuse(const ServerFlags& flags, const absl::Status& status) {
  if (flags.log_format == LogFormat::kJson) {
    LogError(status.message());
  } else {
    std::cerr << "planishd: " << status.message() << "\n";
  }
  return kCannotServe;
}

// Hooks for what can change without a restart. `grace_seconds` is for the caller's own thread.
void AddReloadHooks(FrontDoor* door, JobManager* manager, UploadStore* uploads, WorkerPool* pool, double* grace_seconds,
                    Reloader* reloader) {
  using Keys = std::vector<std::string>;
  const auto add = [reloader](const Keys& keys, std::function<void(const ServerFlags&)> apply) {
    reloader->AddHook(keys, [apply = std::move(apply)](const ServerFlags& flags) {
      return std::function<void()>([apply, flags] { apply(flags); });
    });
  };
  add({"log-level", "log-format"}, [](const ServerFlags& flags) { SetUpLog(flags.log_format, flags.log_level); });
  add({"queue", "retain-mb", "retain-hours", "retain-records-mb", "retain-records-hours", "reattach-grace"},
      [manager](const ServerFlags& flags) { manager->SetLimits(Limits(flags)); });
  add({"uploads-mb"}, [uploads](const ServerFlags& flags) { uploads->SetMaxBytes(flags.max_uploads_mb * kMiB); });
  add({"recycle-after"}, [pool](const ServerFlags& flags) {
    if (pool != nullptr) pool->SetRecycleAfter(flags.recycle_after);
  });
  // Files, whose names stay; they are read again whenever they change as well.
  reloader->AddHook({}, [door](const ServerFlags&) { return door->PrepareReload(); });
  add({"grace"}, [grace_seconds](const ServerFlags& flags) { *grace_seconds = flags.grace_seconds; });
}

// Runs planishd-farm, which is beside this program, in the place of this process. Returns only if that cannot be.
int BecomeFarmServer(char** argv) {
  const std::string program = SelfPath() + "-farm";
  execv(program.c_str(), argv);
  std::cerr << "planishd: --store: cannot run " << program << ": " << std::strerror(errno) << "\n";
  return kCannotServe;
}

int Serve(const ServerConfig& config, const std::vector<std::string>& arguments, const FarmOpener& open_farm) {
  const ServerFlags& flags = config.flags;
  const ServiceManager service_manager;        // before any thread: it changes the environment
  ShutdownEvents events(flags.supervisor_fd);  // before any thread: it blocks the signals for all of them
  // Never taken back: the last grpc_shutdown() joins gRPC's own threads, one of which may sit in a poll for 10 s.
  grpc_init();
  SetUpLogging(flags);
  for (const std::string& warning : config.warnings) LogWarn(warning);
  AllowManyDescriptors();
  std::signal(SIGXFSZ, SIG_IGN);  // a file that may not grow is a disk that is full
  // Until the job ends (worker.cc). A server without jobs in it gives back what a burst of large requests took.
  if (!flags.isolated) KeepFreedMemory();
  Monitoring monitoring(PLANISH_VERSION, LogReadiness);  // first, so that probes are answered while stores are opened
  if (flags.metrics_listen.has_value()) {
    if (const absl::Status status = monitoring.Listen(*flags.metrics_listen); !status.ok())
      return Refuse(flags, status);
  }
  const absl::StatusOr<std::unique_ptr<FrontDoor>> door = FrontDoor::Open(flags.security);
  if (!door.ok()) return Refuse(flags, door.status());
  absl::StatusOr<Stores> stores = OpenStores(flags, (*door)->limits(), open_farm);
  if (!stores.ok()) return Refuse(flags, stores.status());
  JobManagerOptions options = ManagerOptions(flags);
  options.tenant_limits = (*door)->limits();
  monitoring.Hook(&options);
  if (stores->disk != nullptr) {
    options.disk_shortage = [&stores = *stores](std::int64_t more) { return stores.DiskShortage(more); };
    options.has_room_for_results = [disk = stores->disk.get()] { return disk->HasRoomForResults(); };
  }
  options.is_blob_used = [&stores = *stores](const BlobId& id) { return stores.IsBlobUsed(id); };
  std::optional<Farm> farm;
  if (stores->farm.registry != nullptr) {
    farm.emplace(stores->farm.registry.get(), Self(flags), LogClockSkew);
    if (const absl::Status status = farm->Tick(); !status.ok()) return Refuse(flags, status);
    options.capacity = [&farm] { return farm->Capacity(); };
  }
  const absl::StatusOr<std::unique_ptr<JobManager>> opened =
      JobManager::Open(std::move(options), stores->jobs(), stores->blobs.get());
  if (!opened.ok()) return Refuse(flags, opened.status());
  JobManager& manager = **opened;
  stores->uploads->SetMakeRoom(
      [&manager](const std::string& tenant, std::int64_t bytes) { return manager.MakeRoom(tenant, bytes); });
  stores->uploads->SetCheckDisk(
      [&manager](const std::string& tenant, std::int64_t bytes) { return manager.CheckDisk(tenant, bytes); });
  StreamCounter streams;
  ServiceOptions service_options;
  service_options.capabilities = Capabilities(flags);
  service_options.failpoints = flags.failpoints;
  service_options.update_capabilities = [&manager](const Caller& caller, v1::Capabilities* capabilities) {
    capabilities->set_queue_capacity(manager.QueueCapacity(caller));
    UpdateCapabilities(manager.Limits(), manager.Capacity(), capabilities);
  };
  const std::unique_ptr<RpcService> service =
      NewPlanishService(&manager, stores->uploads.get(), std::move(service_options), &streams);
  Reloader reloader(config.settings);
  Admin admin(&manager, &monitoring, &reloader, &service_manager);
  const std::unique_ptr<RpcService> admin_service = NewAdminService(admin.Actions());
  RpcServerOptions rpc_options;
  rpc_options.listen = flags.listen;
  rpc_options.callers = &(*door)->callers();
  rpc_options.max_mesh_bytes = flags.max_mesh_mb * kMiB;
  rpc_options.upload_chunk_bytes = kUploadChunkBytes;
  rpc_options.on_call = [count = monitoring.Calls()](const EndedCall& call) {
    count(call);
    if (!call.hidden.empty()) LogError(call.hidden, {{"call", call.call}, {"reason", call.reason}});
  };
  (*door)->Configure(&rpc_options);
  std::unique_ptr<RpcServer> rpc;  // null: a worker of a farm answers nobody
  if (AnswersCallers(flags.store.role)) {
    absl::StatusOr<std::unique_ptr<RpcServer>> started =
        RpcServer::Start(rpc_options, {service.get(), admin_service.get()});
    if (!started.ok()) return Refuse(flags, started.status());
    rpc = *std::move(started);
  }
  auto worker_output = std::make_unique<OutputLines>([](const std::string& line) {
    LogWarn(line, {{"source", "worker"}});
  });
  WorkerPoolOptions pool_options = PoolOptions(flags);
  NoWorkers no_workers;
  pool_options.on_none_ready = [&no_workers, &events](const absl::Status& last) { no_workers.Set(last, &events); };
  monitoring.Hook(&pool_options);
  std::unique_ptr<WorkerPool> pool;  // null: a front of a farm runs nothing
  if (RunsJobs(flags.store.role)) {
    pool = std::make_unique<WorkerPool>(manager.source(), NewWorkers(flags, worker_output->write_fd()),
                                        std::move(pool_options));
  }
  auto upkeep = std::make_unique<Upkeep>(
      kUpkeepInterval, [&manager, &monitoring, uploads = stores->uploads.get(), disk = stores->disk.get()] {
        manager.Tick();
        uploads->Tick(absl::Now());
        if (disk != nullptr) disk->Tick();
        monitoring.NoteUpkeep();
      });
  auto watching = std::make_unique<Upkeep>(kUpkeepInterval, [&monitoring] { monitoring.Beat(); });
  std::optional<Upkeep> tidying, announcing;
  if (farm.has_value()) {
    tidying.emplace(kTidyInterval, [&manager] { manager.Tidy(); });
    announcing.emplace(Farm::kInterval, [&farm] {
      if (const absl::Status status = farm->Tick(); !status.ok()) LogError(status.message());
    });
  }
  WatchedServer watched = Watched(flags, *stores, farm.has_value() ? &*farm : nullptr, &manager, &streams, rpc.get());
  watched.certificate_end = (*door)->certificate_end();
  if (farm.has_value()) watched.clock_skew = [&farm] { return farm->ClockSkew(); };
  monitoring.Attach(watched);

  double grace_seconds = flags.grace_seconds;
  AddReloadHooks(door->get(), &manager, stores->uploads.get(), pool.get(), &grace_seconds, &reloader);

  const std::string does = Describe(flags, rpc.get());
  LogInfo("planishd " PLANISH_VERSION " " + does);
  if (const auto address = monitoring.address()) LogInfo("metrics and probes at http://" + *address);
  const Upkeep file_watch(kFileWatchInterval, [door = door->get()] { door->Tick(); });
  events.TellReady();
  service_manager.Ready(does);

  Wake wake = events.Wait(absl::InfiniteDuration());
  for (; wake == Wake::kReload; wake = events.Wait(absl::InfiniteDuration())) {
    service_manager.Reloading();
    reloader.Reload(ReadConfig(arguments, ReadEnvironment(kEnvironmentPrefix)));
    service_manager.Ready(does);
  }
  const bool failed = wake == Wake::kFailed;
  if (failed) {
    LogError(no_workers.status().message());
    // They wait for another server or, where the store ends with this one, will never run.
    if (!flags.store.is_durable()) manager.FailAll(no_workers.status());
  }
  const absl::Duration grace = wake == Wake::kSignal ? absl::Seconds(grace_seconds) : absl::ZeroDuration();
  LogInfo(absl::StrCat("shutting down, jobs have ", absl::FormatDuration(grace), " to end"));
  service_manager.Stopping(absl::StrCat("shutting down, jobs have ", absl::FormatDuration(grace), " to end"));
  monitoring.SetEnding();
  const bool workers_done = EndJobs(grace, flags, &manager, &events);
  streams.InterruptSenders();
  streams.WaitForNone(absl::Now() + kFlushLimit);
  monitoring.Detach();
  if (rpc != nullptr) rpc->Shutdown(absl::Now() + kLastCallsLimit);
  manager.StopWorkers();
  // A worker that is deaf cannot be joined; its job has failed, so nothing is lost with it.
  if (!workers_done) std::_Exit(EXIT_SUCCESS);
  pool.reset();
  worker_output.reset();
  upkeep.reset();
  watching.reset();
  tidying.reset();
  announcing.reset();
  if (farm.has_value()) farm->Leave().IgnoreError();  // its row ends by itself
  LogInfo("bye");
  // gRPC's threads may outlive the logger.
  gpr_set_log_function(nullptr);
  google::protobuf::SetLogHandler(nullptr);
  return failed ? kCannotServe : EXIT_SUCCESS;
}

}  // namespace

int RunDaemon(int argc, char** argv, const FarmOpener& open_farm) {
  if (const std::optional<int> code = RunIfWorker(argc, argv)) return *code;
  const std::variant<ServerConfig, int> config = ParseFlags(argc, argv);
  if (const int* code = std::get_if<int>(&config)) return *code;
  const ServerConfig& read = std::get<ServerConfig>(config);
  if (read.flags.store.is_farm() && open_farm == nullptr) return BecomeFarmServer(argv);
  return Serve(read, {argv + 1, argv + argc}, open_farm);
}

}  // namespace planish
