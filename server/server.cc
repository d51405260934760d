#include "server/server.h"

#include <csignal>
#include <cstdlib>
#include <functional>
#include <utility>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"
#include "absl/time/clock.h"
#include "core/base/error.h"
#include "core/base/status_macros.h"
#include "google/protobuf/util/time_util.h"
#include "server/jobs/upload_store.h"
#include "server/log/log.h"
#include "server/metrics/store_probe.h"
#include "server/rpc/admin_service.h"
#include "server/server_options.h"
#include "server/store/ids.h"

namespace planish {
namespace {

constexpr absl::Duration kUpkeepInterval = absl::Milliseconds(100);
constexpr absl::Duration kTidyInterval = absl::Seconds(1);
constexpr absl::Duration kFileWatchInterval = absl::Milliseconds(250);

// How long workers may take to end cancelled jobs, and readers to receive the last events, before they are cut off.
constexpr absl::Duration kCancelLimit = absl::Seconds(5);
constexpr absl::Duration kCloseLimit = absl::Seconds(1);
constexpr absl::Duration kFlushLimit = absl::Seconds(2);
constexpr absl::Duration kLastCallsLimit = absl::Milliseconds(20);

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

// The entry of this server in the list of servers.
ServerEntry Self(const ServerFlags& flags) {
  return {RandomId(), AnswersCallers(flags.store.role), flags.workers, flags.memory_mb * kMiB, PLANISH_VERSION};
}

void UpdateCapabilities(const JobLimits& limits, const JobCapacity& capacity, v1::Capabilities* capabilities) {
  capabilities->set_workers(capacity.workers);
  capabilities->set_memory_bytes(capacity.memory_bytes);
  *capabilities->mutable_reattach_grace() =
      google::protobuf::util::TimeUtil::NanosecondsToDuration(absl::ToInt64Nanoseconds(limits.reattach_grace));
}

}  // namespace

Server::Server(const ServerConfig& config, std::vector<std::string> arguments, const ServiceManager* service_manager,
               ShutdownEvents* events)
    : config_(config),
      arguments_(std::move(arguments)),
      service_manager_(*service_manager),
      events_(*events),
      grace_seconds_(config.flags.grace_seconds),
      monitoring_(PLANISH_VERSION, LogReadiness),
      reloader_(config.settings) {}

absl::Status Server::Start(const FarmOpener& open_farm) {
  const ServerFlags& flags = config_.flags;
  if (flags.metrics_listen.has_value()) PLANISH_RETURN_IF_ERROR(monitoring_.Listen(*flags.metrics_listen));
  PLANISH_ASSIGN_OR_RETURN(door_, FrontDoor::Open(flags.security));
  PLANISH_ASSIGN_OR_RETURN(stores_, OpenStores(flags, door_->limits(), open_farm));
  PLANISH_RETURN_IF_ERROR(OpenJobs());
  PLANISH_RETURN_IF_ERROR(OpenRpc());
  StartWorkers();
  StartUpkeep();
  monitoring_.Attach(Watched());
  AddReloadHooks();
  LogInfo("planishd " PLANISH_VERSION " " + Description());
  if (const auto address = monitoring_.address()) LogInfo("metrics and probes at http://" + *address);
  events_.TellReady();
  service_manager_.Ready(Description());
  return absl::OkStatus();
}

absl::Status Server::OpenJobs() {
  const ServerFlags& flags = config_.flags;
  JobManagerOptions options = ManagerOptionsFrom(flags);
  options.tenant_limits = door_->limits();
  monitoring_.Hook(&options);
  if (stores_.disk != nullptr) {
    options.disk_shortage = [this](std::int64_t more) { return stores_.DiskShortage(more); };
    options.has_room_for_results = [this] { return stores_.disk->HasRoomForResults(); };
  }
  options.is_blob_used = [this](const BlobId& id) { return stores_.IsBlobUsed(id); };
  if (stores_.farm.registry != nullptr) {
    farm_.emplace(stores_.farm.registry.get(), Self(flags), LogClockSkew);
    PLANISH_RETURN_IF_ERROR(farm_->Tick());
    options.capacity = [this] { return farm_->Capacity(); };
  }
  PLANISH_ASSIGN_OR_RETURN(manager_, JobManager::Open(std::move(options), stores_.jobs(), stores_.blobs.get()));
  stores_.uploads->SetMakeRoom(
      [this](const std::string& tenant, std::int64_t bytes) { return manager_->MakeRoom(tenant, bytes); });
  stores_.uploads->SetCheckDisk(
      [this](const std::string& tenant, std::int64_t bytes) { return manager_->CheckDisk(tenant, bytes); });
  return absl::OkStatus();
}

absl::Status Server::OpenRpc() {
  const ServerFlags& flags = config_.flags;
  ServiceOptions options;
  options.capabilities = CapabilitiesFrom(flags);
  options.failpoints = flags.failpoints;
  options.update_capabilities = [this](const Caller& caller, v1::Capabilities* capabilities) {
    capabilities->set_queue_capacity(manager_->QueueCapacity(caller));
    UpdateCapabilities(manager_->Limits(), manager_->Capacity(), capabilities);
  };
  service_ = NewPlanishService(manager_.get(), stores_.uploads.get(), std::move(options), &streams_);
  admin_.emplace(manager_.get(), &monitoring_, &reloader_, &service_manager_);
  admin_service_ = NewAdminService(admin_->Actions());
  if (!AnswersCallers(flags.store.role)) return absl::OkStatus();
  RpcServerOptions rpc;
  rpc.listen = flags.listen;
  rpc.callers = &door_->callers();
  rpc.max_mesh_bytes = flags.max_mesh_mb * kMiB;
  rpc.upload_chunk_bytes = kUploadChunkBytes;
  rpc.on_call = [count = monitoring_.Calls()](const EndedCall& call) {
    count(call);
    if (!call.hidden.empty()) LogError(call.hidden, {{"call", call.call}, {"reason", call.reason}});
  };
  door_->Configure(&rpc);
  PLANISH_ASSIGN_OR_RETURN(rpc_, RpcServer::Start(rpc, {service_.get(), admin_service_.get()}));
  return absl::OkStatus();
}

void Server::StartWorkers() {
  if (!RunsJobs(config_.flags.store.role)) return;
  worker_output_.emplace([](const std::string& line) { LogWarn(line, {{"source", "worker"}}); });
  WorkerPoolOptions options = PoolOptionsFrom(config_.flags);
  options.on_none_ready = [this](const absl::Status& last) { no_workers_.Set(last, &events_); };
  monitoring_.Hook(&options);
  pool_ = std::make_unique<WorkerPool>(manager_->source(), WorkersFrom(config_.flags, worker_output_->write_fd()),
                                       std::move(options));
}

void Server::StartUpkeep() {
  ticking_.emplace(kUpkeepInterval, [this] {
    manager_->Tick();
    stores_.uploads->Tick(absl::Now());
    if (stores_.disk != nullptr) stores_.disk->Tick();
    monitoring_.NoteUpkeep();
  });
  beating_.emplace(kUpkeepInterval, [this] { monitoring_.Beat(); });
  watching_files_.emplace(kFileWatchInterval, [this] { door_->Tick(); });
  if (!farm_.has_value()) return;
  tidying_.emplace(kTidyInterval, [this] { manager_->Tidy(); });
  announcing_.emplace(Farm::kInterval, [this] {
    if (const absl::Status status = farm_->Tick(); !status.ok()) LogError(status.message());
  });
}

// Returns a function that checks that the store answers and can be written, and that may never return; null if the
// store is in memory.
std::function<absl::Status()> Server::StoreQuestion() {
  if (!stores_.directory.has_value() && !farm_.has_value()) return nullptr;
  return [this]() -> absl::Status {
    if (stores_.directory.has_value()) {
      PLANISH_ASSIGN_OR_RETURN(const std::int64_t shortage, stores_.DiskShortage(0));
      PLANISH_RETURN_IF_ERROR(TryToWrite(stores_.directory->path()));
      // A smaller shortage is made up by dropping old results.
      if (shortage > 0 && shortage > stores_.blobs->bytes()) {
        return absl::ResourceExhaustedError(
            absl::StrCat("the disk of ", stores_.directory->path(), " is nearly full: ", shortage >> 20,
                         " MiB more must be free before new meshes are taken (deploy/OPERATION.md)"));
      }
    }
    if (farm_.has_value()) PLANISH_RETURN_IF_ERROR(farm_->LastTick());
    return stores_.jobs()->Find("jobs/none").status();
  };
}

WatchedServer Server::Watched() {
  const ServerFlags& flags = config_.flags;
  WatchedServer server;
  server.jobs = manager_.get();
  server.uploads = stores_.uploads.get();
  server.blobs = stores_.blobs.get();
  server.streams = &streams_;
  server.rpc = rpc_.get();
  server.ask_store = StoreQuestion();
  server.workers = flags.workers;
  server.memory_limit_bytes = flags.memory_mb * kMiB;
  server.store_limit_bytes = flags.store_mb * kMiB;
  server.uploads_limit_bytes = flags.max_uploads_mb * kMiB;
  server.certificate_end = door_->certificate_end();
  if (farm_.has_value()) server.clock_skew = [this] { return farm_->ClockSkew(); };
  return server;
}

// Registers the settings that can change without a restart.
void Server::AddReloadHooks() {
  using Keys = std::vector<std::string>;
  const auto add = [this](const Keys& keys, std::function<void(const ServerFlags&)> apply) {
    reloader_.AddHook(keys, [apply = std::move(apply)](const ServerFlags& flags) {
      return std::function<void()>([apply, flags] { apply(flags); });
    });
  };
  add({"log-level", "log-format"}, [](const ServerFlags& flags) { SetUpLog(flags.log_format, flags.log_level); });
  add({"queue", "retain-mb", "retain-hours", "retain-records-mb", "retain-records-hours", "reattach-grace"},
      [this](const ServerFlags& flags) { manager_->SetLimits(LimitsFrom(flags)); });
  add({"uploads-mb"}, [this](const ServerFlags& flags) { stores_.uploads->SetMaxBytes(flags.max_uploads_mb * kMiB); });
  add({"recycle-after"}, [this](const ServerFlags& flags) {
    if (pool_ != nullptr) pool_->SetRecycleAfter(flags.recycle_after);
  });
  // Certificates and access file: their contents may change, their names may not.
  reloader_.AddHook({}, [this](const ServerFlags&) { return door_->PrepareReload(); });
  add({"grace"}, [this](const ServerFlags& flags) { grace_seconds_ = flags.grace_seconds; });
}

// A description of this server for the log.
std::string Server::Description() const {
  const ServerFlags& flags = config_.flags;
  std::vector<std::string> parts;
  if (rpc_ != nullptr) parts.push_back("listens on " + absl::StrJoin(rpc_->addresses(), ", "));
  if (flags.workers > 0) {
    parts.push_back(absl::StrCat("runs jobs with ", flags.workers, " workers of up to ", flags.threads, " threads"));
  }
  return absl::StrJoin(parts, " and ");
}

bool Server::Run() {
  Wake wake = events_.Wait(absl::InfiniteDuration());
  for (; wake == Wake::kReload; wake = events_.Wait(absl::InfiniteDuration())) {
    service_manager_.Reloading();
    reloader_.Reload(ReadConfig(arguments_, ReadEnvironment(kEnvironmentPrefix)));
    service_manager_.Ready(Description());
  }
  const bool failed = wake == Wake::kFailed;
  if (failed) {
    LogError(no_workers_.status().message());
    // Jobs in a durable store wait for another server. In a store that ends with this server they would never run.
    if (!config_.flags.store.is_durable()) manager_->FailAll(no_workers_.status());
  }
  const absl::Duration grace = wake == Wake::kSignal ? absl::Seconds(grace_seconds_) : absl::ZeroDuration();
  const std::string ends = absl::StrCat("shutting down, jobs have ", absl::FormatDuration(grace), " to end");
  LogInfo(ends);
  service_manager_.Stopping(ends);
  monitoring_.SetEnding();
  const bool workers_done = EndJobs(grace);
  streams_.InterruptSenders();
  streams_.WaitForNone(absl::Now() + kFlushLimit);
  monitoring_.Detach();
  if (rpc_ != nullptr) rpc_->Shutdown(absl::Now() + kLastCallsLimit);
  manager_->StopWorkers();
  // The thread of a worker that does not answer cannot be joined. Its job has failed, so nothing is lost.
  if (!workers_done) std::_Exit(EXIT_SUCCESS);
  return !failed;
}

// Waits until no job waits or runs. False if `limit` passes first, or on a signal or the supervisor's end. Ignores
// SIGHUP.
bool Server::WaitUntilIdle(absl::Duration limit) {
  const absl::Time end = absl::Now() + limit;
  Wake wake = events_.Wait(limit);
  while (wake == Wake::kReload) wake = events_.Wait(end - absl::Now());
  return wake == Wake::kIdle;
}

// Returns when every job has ended or, if the store outlives this process, was left to another server. False if workers
// did not answer and still run.
bool Server::EndJobs(absl::Duration grace) {
  const ServerFlags& flags = config_.flags;
  manager_->Drain([this] { events_.NotifyIdle(); });
  const bool idle = WaitUntilIdle(grace);
  // In a farm the jobs go on at other servers, and callers that watch them here continue there.
  if (idle && !flags.store.is_farm()) return true;
  if (flags.store.is_durable()) {
    if (!idle) LogInfo("leaving the jobs that are left to another server");
    manager_->Suspend();
    return true;
  }
  LogInfo("cancelling the jobs that are left");
  manager_->CancelAll();
  const absl::Time limit = absl::Now() + kCancelLimit;
  while (absl::Now() < limit) {
    if (WaitUntilIdle(limit - absl::Now())) return true;
  }
  LogWarn("giving up workers that did not answer");
  manager_->CloseLinks();
  WaitUntilIdle(kCloseLimit);
  return false;
}

}  // namespace planish
