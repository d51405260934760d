#include "server/flags.h"

#include <algorithm>
#include <iostream>
#include <thread>

#include "CLI/CLI.hpp"

namespace planish {
namespace {

constexpr int kBadUsage = 2;
constexpr int kMaxThreads = 256;

void Define(CLI::App* app, ServerFlags* flags, std::vector<std::string>* listen) {
  app->set_version_flag("--version", "planishd " PLANISH_VERSION);
  app->add_option("--listen", *listen, "HOST:PORT or unix:PATH; may be given several times")
      ->capture_default_str()
      ->type_name("ADDR")
      ->allow_extra_args(false);
  app->add_option("--workers", flags->workers, "Jobs that run at a time")
      ->capture_default_str()
      ->check(CLI::Range(1, 1024));
  app->add_option("--threads", flags->threads, "Threads a job may use at most [cores / workers]")
      ->check(CLI::Range(1, kMaxThreads));
  app->add_option("--queue", flags->queue, "Jobs that may wait beside those that run")
      ->capture_default_str()
      ->check(CLI::Range(0, 100'000));
  app->add_option("--max-mesh-mb", flags->max_mesh_mb, "Largest mesh that is accepted, MiB of Draco")
      ->capture_default_str()
      ->check(CLI::Range(1, 2000));
  app->add_option("--retain-jobs", flags->retain_jobs, "Ended jobs that are kept for later calls")
      ->capture_default_str()
      ->check(CLI::Range(1, 1'000'000));
  app->add_option("--retain-mb", flags->retain_mb, "UV of ended jobs that are kept, MiB (the last one always is)")
      ->capture_default_str()
      ->check(CLI::Range(0, 1'000'000));
  app->add_option("--grace", flags->grace_seconds,
                  "Seconds that accepted jobs may go on after SIGTERM or SIGINT; then they are cancelled")
      ->capture_default_str()
      ->check(CLI::Range(0.0, 86'400.0));
  app->add_option("--log-level", flags->log_level, "What goes to stderr")
      ->capture_default_str()
      ->check(CLI::IsMember({"debug", "info", "warn", "error", "off"}));
  app->add_option("--supervisor-fd", flags->supervisor_fd,
                  "Inherited socket: gets \"ready\\n\" once all addresses are served; the server ends, without grace, "
                  "when the other side closes it")
      ->check(CLI::Range(0, 1 << 20));
}

}  // namespace

std::variant<ServerFlags, int> ParseFlags(int argc, char** argv) {
  CLI::App app("planishd: flattens triangle meshes for callers over gRPC", "planishd");
  ServerFlags flags;
  const int cores = static_cast<int>(std::thread::hardware_concurrency());
  flags.workers = std::clamp(cores, 1, 1024);
  std::vector<std::string> listen = {"127.0.0.1:7741"};
  Define(&app, &flags, &listen);
  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& error) {
    return app.exit(error) == 0 ? 0 : kBadUsage;
  }
  if (app.count("--threads") == 0) flags.threads = std::clamp(cores / flags.workers, 1, kMaxThreads);
  for (const std::string& text : listen) {
    const absl::StatusOr<ListenAddress> address = ParseListenAddress(text);
    if (!address.ok()) {
      std::cerr << "planishd: --listen=" << address.status().message() << "\n";
      return kBadUsage;
    }
    flags.listen.push_back(*address);
  }
  return flags;
}

}  // namespace planish
