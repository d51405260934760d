// planishd: puts jobs, workers and RPC together and takes them down again in order (server/README.md).
#include <cstdlib>
#include <iostream>
#include <memory>
#include <utility>
#include <variant>

#include "absl/strings/str_join.h"
#include "absl/time/clock.h"
#include "core/base/heap.h"
#include "grpc/grpc.h"
#include "grpc/support/log.h"
#include "server/flags.h"
#include "server/job_log.h"
#include "server/jobs/job_manager.h"
#include "server/jobs/worker_pool.h"
#include "server/link/in_process_link.h"
#include "server/rpc/rpc_server.h"
#include "server/rpc/service.h"
#include "server/shutdown_events.h"
#include "server/worker/options.h"
#include "server/worker/worker.h"
#include "spdlog/sinks/stdout_color_sinks.h"
#include "spdlog/spdlog.h"

namespace planish {
namespace {

constexpr int kCannotListen = 2;
constexpr std::int64_t kMiB = std::int64_t{1} << 20;

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
  options.max_mesh_bytes = flags.max_mesh_mb * kMiB;
  options.retained_jobs = flags.retain_jobs;
  options.retained_bytes = flags.retain_mb * kMiB;
  options.validate_options = ValidateOptions;
  options.on_transition = LogTransition;
  return options;
}

v1::Capabilities Capabilities(const ServerFlags& flags) {
  v1::Capabilities capabilities;
  capabilities.set_version(PLANISH_VERSION);
  capabilities.set_max_mesh_bytes(flags.max_mesh_mb * kMiB);
  capabilities.set_workers(flags.workers);
  capabilities.set_threads(flags.threads);
  capabilities.set_queue_capacity(flags.queue);
  for (const v1::Seams seams : SeamPolicies()) capabilities.add_seams(seams);
  for (const v1::SolverCombination& combination : SolverCombinations()) *capabilities.add_solvers() = combination;
  return capabilities;
}

// Waits for idleness. False if `limit` passes first, or a signal or the supervisor's end cuts it short.
bool WaitUntilIdle(absl::Duration limit, ShutdownEvents* events) {
  return events->Wait(limit) == Wake::kIdle;
}

// Returns when every job has ended. False if workers did not answer, and still run.
bool EndJobs(absl::Duration grace, JobManager* manager, ShutdownEvents* events) {
  manager->Drain([events] { events->NotifyIdle(); });
  if (WaitUntilIdle(grace, events)) return true;
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

int Serve(const ServerFlags& flags) {
  ShutdownEvents events(flags.supervisor_fd);  // before any thread: it blocks the signals for all of them
  // Never taken back: the last grpc_shutdown() joins gRPC's own threads, one of which may sit in a poll for 10 s.
  grpc_init();
  SetUpLogging(flags);
  KeepFreedMemory();  // until the job ends (worker.cc)
  JobManager manager(ManagerOptions(flags), NewMemoryJobStore());
  StreamCounter streams;
  const std::unique_ptr<grpc::Service> service = NewPlanishService(&manager, Capabilities(flags), &streams);
  absl::StatusOr<std::unique_ptr<RpcServer>> rpc =
      RpcServer::Start({flags.listen, flags.max_mesh_mb * kMiB}, service.get());
  if (!rpc.ok()) {
    std::cerr << "planishd: " << rpc.status().message() << "\n";
    return kCannotListen;
  }
  auto pool = std::make_unique<WorkerPool>(
      &manager, [] { return StartInProcessWorker(RunWorker); }, flags.workers);

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
  const bool workers_done = EndJobs(grace, &manager, &events);
  streams.WaitForNone(absl::Now() + kFlushLimit);
  (*rpc)->Shutdown(absl::Now() + kLastCallsLimit);
  manager.Stop();
  // A worker that is deaf cannot be joined; its job has failed, so nothing is lost with it.
  if (!workers_done) std::_Exit(EXIT_SUCCESS);
  pool.reset();
  spdlog::info("bye");
  // gRPC's threads may outlive the logger.
  gpr_set_log_function(nullptr);
  return EXIT_SUCCESS;
}

}  // namespace
}  // namespace planish

int main(int argc, char** argv) {
  const std::variant<planish::ServerFlags, int> flags = planish::ParseFlags(argc, argv);
  if (const int* code = std::get_if<int>(&flags)) return *code;
  return planish::Serve(std::get<planish::ServerFlags>(flags));
}
