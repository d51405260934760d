#include "server/flags.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <iostream>
#include <optional>
#include <thread>
#include <utility>

#include "CLI/CLI.hpp"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"
#include "absl/strings/str_split.h"
#include "core/base/command_pages.h"
#include "core/base/status_macros.h"
#include "core/base/target.h"
#include "server/config/choice.h"
#include "server/man_page.h"
#include "server/memory_limit.h"

namespace planish {
namespace {

constexpr int kBadUsage = 2;
constexpr int kMaxThreads = 256;

void DefineKeeping(CLI::App* app, ServerFlags* flags) {
  app->add_option("--store-mb", flags->store_mb, "Capacity for meshes and UV, MiB")
      ->capture_default_str()
      ->check(CLI::Range(1, 100'000'000));
  app->add_option("--headroom-mb", flags->headroom_mb,
                  "MiB of the disk of --data-dir that new meshes leave free for results; at most an eighth of the disk")
      ->capture_default_str()
      ->check(CLI::Range(0, 100'000'000));
  app->add_option("--retain-mb", flags->retain_mb,
                  "UV of ended jobs to keep for each tenant, MiB; those of the last job are always kept")
      ->capture_default_str()
      ->check(CLI::Range(0, 100'000'000));
  app->add_option("--retain-hours", flags->retain_hours, "Hours to keep the UV of ended jobs")
      ->capture_default_str()
      ->check(CLI::Range(1e-6, 1e6));
  app->add_option("--retain-records-mb", flags->retain_records_mb,
                  "Ended jobs to keep for each tenant, MiB of records, reports and events; the last job is always "
                  "kept. A job with one chart takes about 3 KB")
      ->capture_default_str()
      ->check(CLI::Range(1, 100'000'000));
  app->add_option("--retain-records-hours", flags->retain_records_hours,
                  "Hours to keep ended jobs; a dropped job's UV are dropped too")
      ->capture_default_str()
      ->check(CLI::Range(1e-6, 1e6));
  app->add_option("--uploads-mb", flags->max_uploads_mb, "Uploads under way of all tenants, MiB as announced")
      ->capture_default_str()
      ->check(CLI::Range(1, 100'000'000));
}

void DefineWorkers(CLI::App* app, ServerFlags* flags) {
  app->add_option("--workers", flags->workers, "Jobs that run concurrently")
      ->capture_default_str()
      ->check(CLI::Range(1, 1024));
  app->add_option("--short-workers", flags->short_workers,
                  "Workers reserved for jobs expected to take at most --short-seconds")
      ->capture_default_str()
      ->check(CLI::Range(0, 1023));
  app->add_option("--short-seconds", flags->short_seconds, "Longest expected time of a short job, seconds")
      ->capture_default_str()
      ->check(CLI::Range(1e-3, 1e6));
  app->add_option("--threads", flags->threads, "Most threads of a job [cores / workers]")
      ->check(CLI::Range(1, kMaxThreads));
  AddChoice<bool>(app, "--isolation", &flags->isolated, {{"process", true}, {"thread", false}},
                  "Run jobs in separate processes, or in threads of the server");
  AddChoice<SandboxMode>(
      app, "--sandbox", &flags->sandbox,
      {{"auto", SandboxMode::kAuto}, {"require", SandboxMode::kRequire}, {"off", SandboxMode::kOff}},
      "Deny worker processes files and the network: if the kernel supports it, or else start none, or never");
  app->add_option("--recycle-after", flags->recycle_after, "Jobs after which a worker process is replaced")
      ->capture_default_str()
      ->check(CLI::Range(1, 1'000'000'000));
  app->add_option("--job-hours", flags->job_hours, "Hours after which a worker with one job counts as hung")
      ->capture_default_str()
      ->check(CLI::Range(1e-6, 1e6));
  app->add_option("--memory-mb", flags->memory_mb,
                  "Memory of all running jobs together, MiB [three quarters of the machine's or the container's]")
      ->check(CLI::Range(1, 100'000'000));
}

// The flags about the configuration itself.
struct ConfigFlags {
  std::string file;  // empty: none
  bool print = false;
  bool check = false;
};

void DefineConfig(CLI::App* app, ConfigFlags* config) {
  app->add_option("--config", config->file,
                  "YAML file with settings: keys are names of flags without dashes. Flags, and variables like "
                  "PLANISHD_QUEUE, override it")
      ->type_name("FILE")
      ->configurable(false);
  app->add_flag("--print-config", config->print,
                "Print the settings in effect as a configuration file, with the source of each")
      ->configurable(false);
  app->add_flag("--check-config", config->check, "Print all errors in flags, environment and file, or ok")
      ->configurable(false);
}

void DefineLog(CLI::App* app, ServerFlags* flags) {
  AddChoice<LogLevel>(app, "--log-level", &flags->log_level,
                      {{"debug", LogLevel::kDebug},
                       {"info", LogLevel::kInfo},
                       {"warn", LogLevel::kWarn},
                       {"error", LogLevel::kError},
                       {"off", LogLevel::kOff}},
                      "Least important level that is logged to stderr");
  AddChoice<LogFormat>(app, "--log-format", &flags->log_format,
                       {{"human", LogFormat::kHuman}, {"json", LogFormat::kJson}},
                       "Format of the log: text for people, or a JSON object on each line");
}

std::string CheckAddress(const std::string& text) {
  return std::string(ParseListenAddress(text).status().message());
}

std::string CheckHttpAddress(const std::string& text) {
  return std::string(ParseHttpAddress(text).status().message());
}

void Define(CLI::App* app, ServerFlags* flags, std::vector<std::string>* listen, std::string* metrics_listen) {
  app->set_version_flag("--version", "planishd " PLANISH_VERSION);
  app->add_option("--listen", *listen, "Address to listen on: HOST:PORT or unix:PATH; may be given several times")
      ->capture_default_str()
      ->type_name("ADDR")
      ->check(CLI::Validator(CheckAddress, ""))
      ->allow_extra_args(false);
  app->add_option("--metrics-listen", *metrics_listen,
                  "Address for /metrics (Prometheus), /livez and /readyz over plain HTTP: HOST:PORT [off]")
      ->type_name("ADDR")
      ->check(CLI::Validator(CheckHttpAddress, ""));
  DefineSecurity(app, &flags->security);
  DefineStore(app, &flags->store);
  DefineKeeping(app, flags);
  DefineWorkers(app, flags);
  app->add_option("--queue", flags->queue, "Waiting jobs of each tenant")
      ->capture_default_str()
      ->check(CLI::Range(0, 100'000));
  app->add_option("--queue-total", flags->queue_total,
                  "Waiting jobs of all tenants; beyond it a tenant may only have an equal part")
      ->capture_default_str()
      ->check(CLI::Range(1, 1'000'000));
  app->add_option("--max-mesh-mb", flags->max_mesh_mb, "Largest accepted mesh, MiB of Draco data")
      ->capture_default_str()
      ->check(CLI::Range(1, 2000));
  app->add_option("--max-triangles", flags->max_triangles, "Largest accepted mesh, triangles")
      ->capture_default_str()
      ->check(CLI::Range(std::int64_t{1}, std::int64_t{1} << 40));
  app->add_option("--reattach-grace", flags->reattach_seconds,
                  "Seconds that a job waits for its disconnected caller to come back before it is cancelled")
      ->capture_default_str()
      ->check(CLI::Range(0.0, 86'400.0));
  app->add_option("--grace", flags->grace_seconds,
                  "Seconds that accepted jobs may continue after SIGTERM or SIGINT. Then they are cancelled, or, with "
                  "--data-dir or --store, left to another server")
      ->capture_default_str()
      ->check(CLI::Range(0.0, 86'400.0));
  DefineLog(app, flags);
  app->add_option("--supervisor-fd", flags->supervisor_fd,
                  "Inherited socket: the server writes \"ready\\n\" to it once it serves all addresses, and ends, "
                  "without grace, when the other side closes it")
      ->check(CLI::Range(0, 1 << 20))
      ->configurable(false);
  // For planish's own tests: callers may inject faults into their jobs.
  app->add_flag("--failpoints", flags->failpoints)->group("")->configurable(false);
  app->add_option("--worker-program", flags->worker_program)->group("")->configurable(false);
}

// Makes all options refuse "nan", which CLI11 accepts as a number within every range.
void RefuseNan(CLI::App* app) {
  const auto is_number = [](const std::string& text) {
    double number = 0;
    const bool is_nan = CLI::detail::lexical_cast(text, number) && std::isnan(number);
    return is_nan ? absl::StrCat("Value ", text, " is not a number") : std::string();
  };
  for (CLI::Option* option : app->get_options()) {
    if (option->get_type_name().find("FLOAT") != std::string::npos) option->check(CLI::Validator(is_number, ""));
  }
}

// The options of planishd, and the configuration that a command line gives.
class CommandLine {
 public:
  CommandLine() {
    AddHelp(app_);
    flags_.workers = std::clamp(Cores(), 1, 1024);
    DefineConfig(&app_, &config_);
    Define(&app_, &flags_, &listen_, &metrics_listen_);
    RefuseNan(&app_);
    AddGenerate(app_, PLANISH_VERSION, ManPage());
    settings_.emplace(&app_, kEnvironmentPrefix);
  }

  CLI::App& app() { return app_; }
  const ConfigFlags& config() const { return config_; }

  // The whole configuration. Call it after app().parse().
  absl::StatusOr<ServerConfig> Complete(const Environment& environment) {
    std::vector<std::string> errors = settings_->AddEnvironment(environment);
    const auto named = environment.find(absl::StrCat(kEnvironmentPrefix, "CONFIG"));
    if (config_.file.empty() && named != environment.end()) config_.file = named->second;
    if (!config_.file.empty()) {
      const std::vector<std::string> more = settings_->AddFile(config_.file);
      errors.insert(errors.end(), more.begin(), more.end());
    }
    if (!errors.empty()) return absl::InvalidArgumentError(absl::StrJoin(errors, "\n"));
    Derive();
    PLANISH_RETURN_IF_ERROR(CheckStore(flags_.store));
    if (flags_.short_workers > 0 && flags_.workers > 0 && flags_.short_workers >= flags_.workers) {
      return absl::InvalidArgumentError(
          absl::StrCat("--short-workers: ", flags_.short_workers, " of ", flags_.workers,
                       " workers would be reserved for short jobs, so that no worker is left for other jobs"));
    }
    if (!AnswersCallers(flags_.store.role)) flags_.listen.clear();
    PLANISH_RETURN_IF_ERROR(CheckSecurity(flags_.listen, &flags_.security));
    std::vector<std::string> warnings =
        settings_->UnknownVariables(environment, {absl::StrCat(kEnvironmentPrefix, "CONFIG")});
    if (!metrics_listen_.empty() && !IsWithinThisMachine(metrics_listen_)) {
      warnings.push_back(absl::StrCat("--metrics-listen=", metrics_listen_,
                                      " shows the names of tenants and their activity to everybody who connects, "
                                      "without encryption: listen on 127.0.0.1, or on a private network"));
    }
    return ServerConfig{flags_, settings_->InEffect(), std::move(warnings)};
  }

 private:
  static int Cores() { return static_cast<int>(std::thread::hardware_concurrency()); }

  // Derives values from other settings, or from the machine if they are not set.
  void Derive() {
    if (app_.count("--memory-mb") == 0) flags_.memory_mb = std::max<std::int64_t>(MemoryLimit() / 4 * 3 >> 20, 1);
    if (app_.count("--threads") == 0) flags_.threads = std::clamp(Cores() / flags_.workers, 1, kMaxThreads);
    if (!RunsJobs(flags_.store.role)) flags_.workers = 0;
    for (const std::string& text : listen_) flags_.listen.push_back(*ParseListenAddress(text));
    if (!metrics_listen_.empty()) flags_.metrics_listen = *ParseHttpAddress(metrics_listen_);
  }

  CLI::App app_{"Flattens triangle meshes for callers over gRPC", "planishd"};
  ServerFlags flags_;
  ConfigFlags config_;
  std::vector<std::string> listen_ = {"127.0.0.1:7741"};
  std::string metrics_listen_;
  std::optional<Settings> settings_;
};

// Prints each line of the message after the program's name. Returns exit code 2.
int Refuse(const absl::Status& status) {
  for (const auto& line : absl::StrSplit(status.message(), '\n')) std::cerr << "planishd: " << line << "\n";
  return kBadUsage;
}

}  // namespace

absl::StatusOr<ServerConfig> ReadConfig(const std::vector<std::string>& arguments, const Environment& environment) {
  CommandLine line;
  try {
    line.app().parse(std::vector<std::string>(arguments.rbegin(), arguments.rend()));
  } catch (const CLI::ParseError& error) {
    return absl::InvalidArgumentError(error.what());
  }
  return line.Complete(environment);
}

std::variant<ServerConfig, int> ParseFlags(int argc, char** argv) {
  CommandLine line;
  try {
    line.app().parse(argc, argv);
  } catch (const CLI::ParseError& error) {
    return line.app().exit(error) == 0 ? 0 : kBadUsage;
  }
  absl::StatusOr<ServerConfig> config = line.Complete(ReadEnvironment(kEnvironmentPrefix));
  if (!config.ok()) return Refuse(config.status());
  if (!line.config().print && !line.config().check) return *std::move(config);
  for (const std::string& warning : config->warnings) std::cerr << "planishd: " << warning << "\n";
  std::cout << (line.config().print ? ToYaml(config->settings) : std::string("ok\n"));
  return 0;
}

}  // namespace planish
