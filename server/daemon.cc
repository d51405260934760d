#include "server/daemon.h"

#include <sys/resource.h>
#include <unistd.h>

#include <cerrno>
#include <csignal>
#include <cstdlib>
#include <cstring>
#include <iostream>
#include <optional>
#include <string>
#include <utility>
#include <variant>
#include <vector>

#include "core/base/heap.h"
#include "core/base/program_path.h"
#include "google/protobuf/stubs/logging.h"
#include "grpc/grpc.h"
#include "grpc/support/log.h"
#include "server/flags.h"
#include "server/log/log.h"
#include "server/server.h"
#include "server/service_manager.h"
#include "server/shutdown_events.h"
#include "server/worker_main.h"

namespace planish {
namespace {

constexpr int kCannotServe = 2;

void SetUpLogging(const ServerFlags& flags) {
  SetUpLog(flags.log_format, flags.log_level);
  // gRPC's log becomes debug output, since real errors are returned as statuses.
  gpr_set_log_function([](gpr_log_func_args* args) { LogDebug(args->message, {{"source", "grpc"}}); });
  // Protobuf's log is mostly about callers' texts that are not UTF-8, for which the callers get an error.
  google::protobuf::SetLogHandler([](google::protobuf::LogLevel level, const char*, int, const std::string& message) {
    Log(level == google::protobuf::LOGLEVEL_FATAL ? LogLevel::kError : LogLevel::kDebug, message,
        {{"source", "protobuf"}});
  });
}

// Raises the limit of descriptors as far as possible: every connection needs one, and stored and waiting jobs may.
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

// Replaces this process by planishd-farm, which is in the same directory. Returns only if that fails.
int BecomeFarmServer(char** argv) {
  const std::string program = SelfPath() + "-farm";
  execv(program.c_str(), argv);
  std::cerr << "planishd: --store: cannot run " << program << ": " << std::strerror(errno) << "\n";
  return kCannotServe;
}

int Serve(const ServerConfig& config, std::vector<std::string> arguments, const FarmOpener& open_farm) {
  const ServerFlags& flags = config.flags;
  const ServiceManager service_manager;        // before any thread: it changes the environment
  ShutdownEvents events(flags.supervisor_fd);  // before any thread: it blocks the signals for all of them
  // grpc_shutdown() is not called: it would join gRPC's own threads, one of which may be in a poll for 10 s.
  grpc_init();
  SetUpLogging(flags);
  for (const std::string& warning : config.warnings) LogWarn(warning);
  AllowManyDescriptors();
  std::signal(SIGXFSZ, SIG_IGN);  // a file at its size limit is handled like a full disk
  // If jobs run in this process, freed memory is kept until a job ends (worker.cc). Other servers return it to the
  // kernel after a burst of large requests.
  if (!flags.isolated) KeepFreedMemory();
  bool had_workers = false;
  {
    Server server(config, std::move(arguments), &service_manager, &events);
    if (const absl::Status status = server.Start(open_farm); !status.ok()) return Refuse(flags, status);
    had_workers = server.Run();
  }
  LogInfo("bye");
  // gRPC's threads may outlive the logger.
  gpr_set_log_function(nullptr);
  google::protobuf::SetLogHandler(nullptr);
  return had_workers ? EXIT_SUCCESS : kCannotServe;
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
