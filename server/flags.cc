#include "server/flags.h"

#include <algorithm>
#include <cstdint>
#include <iostream>
#include <map>
#include <thread>

#include "CLI/CLI.hpp"
#include "server/jobs/ids.h"
#include "server/memory_limit.h"

namespace planish {
namespace {

constexpr int kBadUsage = 2;
constexpr int kMaxThreads = 256;

void DefineKeeping(CLI::App* app, ServerFlags* flags) {
  app->add_option("--data-dir", flags->data_dir,
                  "Directory for jobs, meshes and results: they outlive the server. Without it all is kept in memory")
      ->type_name("DIR");
  app->add_option("--store-mb", flags->store_mb, "Meshes and UV that are kept or wait, MiB")
      ->capture_default_str()
      ->check(CLI::Range(1, 100'000'000));
  app->add_option("--retain-jobs", flags->retain_jobs, "Ended jobs that are kept for later calls")
      ->capture_default_str()
      ->check(CLI::Range(1, 1'000'000));
  app->add_option("--retain-mb", flags->retain_mb, "UV of ended jobs that are kept, MiB (the last one always is)")
      ->capture_default_str()
      ->check(CLI::Range(0, 100'000'000));
  app->add_option("--retain-hours", flags->retain_hours, "Hours that UV of ended jobs are kept")
      ->capture_default_str()
      ->check(CLI::Range(1e-6, 1e6));
  app->add_option("--uploads-mb", flags->max_uploads_mb, "Uploads under way, MiB as announced")
      ->capture_default_str()
      ->check(CLI::Range(1, 100'000'000));
}

void DefineWorkers(CLI::App* app, ServerFlags* flags) {
  app->add_option("--workers", flags->workers, "Jobs that run at a time")
      ->capture_default_str()
      ->check(CLI::Range(1, 1024));
  app->add_option("--threads", flags->threads, "Threads a job may use at most [cores / workers]")
      ->check(CLI::Range(1, kMaxThreads));
  app->add_option("--isolation", flags->isolated,
                  "Where jobs run: in processes of their own, or in threads of the server")
      ->transform(CLI::CheckedTransformer(std::map<std::string, bool>{{"process", true}, {"thread", false}}))
      ->default_str("process");
  app->add_option("--sandbox", flags->sandbox,
                  "Whether worker processes give up files and the network: where the kernel allows it, or they do not "
                  "start, or not")
      ->transform(CLI::CheckedTransformer(std::map<std::string, SandboxMode>{
          {"auto", SandboxMode::kAuto}, {"require", SandboxMode::kRequire}, {"off", SandboxMode::kOff}}))
      ->default_str("auto");
  app->add_option("--recycle-after", flags->recycle_after, "Jobs after which a worker process is replaced by a new one")
      ->capture_default_str()
      ->check(CLI::Range(1, 1'000'000'000));
  app->add_option("--job-hours", flags->job_hours, "Hours after which a worker at one job counts as hung")
      ->capture_default_str()
      ->check(CLI::Range(1e-6, 1e6));
  app->add_option("--memory-mb", flags->memory_mb,
                  "Memory that jobs may use together, MiB [three quarters of the machine's or the container's]")
      ->check(CLI::Range(1, 100'000'000));
}

void Define(CLI::App* app, ServerFlags* flags, std::vector<std::string>* listen) {
  app->set_version_flag("--version", "planishd " PLANISH_VERSION);
  app->add_option("--listen", *listen, "HOST:PORT or unix:PATH; may be given several times")
      ->capture_default_str()
      ->type_name("ADDR")
      ->allow_extra_args(false);
  app->add_option("--instance", flags->instance,
                  "Name of this server among others behind a proxy: its jobs are called jobs/NAME.ID, and callers say "
                  "NAME in the metadata planish-route")
      ->type_name("NAME")
      ->check(CLI::Validator(
          [](const std::string& name) {
            return IsInstanceName(name) ? "" : "a name has 1 to 63 of the characters a to z, 0 to 9 and -";
          },
          ""));
  DefineKeeping(app, flags);
  DefineWorkers(app, flags);
  app->add_option("--queue", flags->queue, "Jobs that may wait beside those that run")
      ->capture_default_str()
      ->check(CLI::Range(0, 100'000));
  app->add_option("--max-mesh-mb", flags->max_mesh_mb, "Largest mesh that is accepted, MiB of Draco")
      ->capture_default_str()
      ->check(CLI::Range(1, 2000));
  app->add_option("--max-triangles", flags->max_triangles, "Largest mesh that is accepted, triangles")
      ->capture_default_str()
      ->check(CLI::Range(std::int64_t{1}, std::int64_t{1} << 40));
  app->add_option("--reattach-grace", flags->reattach_seconds,
                  "Seconds that the job of a caller that went away waits for it to come back; then it is cancelled")
      ->capture_default_str()
      ->check(CLI::Range(0.0, 86'400.0));
  app->add_option("--grace", flags->grace_seconds,
                  "Seconds that accepted jobs may go on after SIGTERM or SIGINT; then they are cancelled, or with "
                  "--data-dir left to the next server")
      ->capture_default_str()
      ->check(CLI::Range(0.0, 86'400.0));
  app->add_option("--log-level", flags->log_level, "What goes to stderr")
      ->capture_default_str()
      ->check(CLI::IsMember({"debug", "info", "warn", "error", "off"}));
  app->add_option("--supervisor-fd", flags->supervisor_fd,
                  "Inherited socket: gets \"ready\\n\" once all addresses are served; the server ends, without grace, "
                  "when the other side closes it")
      ->check(CLI::Range(0, 1 << 20));
  // For the tests of planish itself: callers may make their jobs go wrong.
  app->add_flag("--failpoints", flags->failpoints)->group("");
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
  if (app.count("--memory-mb") == 0) flags.memory_mb = std::max<std::int64_t>(MemoryLimit() / 4 * 3 >> 20, 1);
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
