// What is about servers and their jobs: estimate, jobs, health, admin, version.
#include <cstdint>
#include <string>
#include <vector>

#include "client/cli/flags.h"

namespace planish::cli {
namespace {

void DefineEstimate(CLI::App& app, Arguments& arguments) {
  CLI::App& estimate = *app.add_subcommand("estimate", "Say what unwrap would need on a server, without doing it");
  estimate.parse_complete_callback([&arguments] { arguments.command = Command::kEstimate; });
  estimate.footer(
      "Memory while the job runs, run time on one core, time in the queue; rough, from the mesh's counts. Exit codes: "
      "0 the server\nwould accept the job now, 1 it would not, 2 bad usage or unreadable file, 3 server unreachable.");
  estimate.add_option("IN", arguments.input, "Mesh file, as for unwrap")->type_name("");
  estimate.add_option("--triangles", arguments.triangles, "In place of a file: that many triangles")
      ->check(CLI::Range(std::int64_t{1}, std::int64_t{1} << 40).description(""))
      ->type_name("N");
  AddServer(estimate, arguments, "without it a private server is started");
  AddJson(estimate, arguments);
  AddTerminal(estimate, arguments);
}

CLI::App& AddJobCommand(CLI::App& jobs, Arguments& arguments, Command command, const std::string& name,
                        const std::string& description) {
  CLI::App& app = *jobs.add_subcommand(name, description);
  app.parse_complete_callback([&arguments, command] { arguments.command = command; });
  if (command != Command::kJobsList) {
    app.add_option("JOB", arguments.job, "Name of the job: jobs/... (jobs/ may be left out)")
        ->required()
        ->type_name("");
  }
  AddServer(app, arguments, "required here");
  if (command != Command::kJobsDelete) AddJson(app, arguments);
  if (command != Command::kJobsWatch) AddTerminal(app, arguments);
  return app;
}

void DefineJobs(CLI::App& app, Arguments& arguments) {
  CLI::App& jobs = *app.add_subcommand("jobs", "Look after the jobs of a server");
  jobs.require_subcommand(1);
  CLI::App& list = AddJobCommand(jobs, arguments, Command::kJobsList, "list", "Jobs, newest first");
  list.add_option("--limit", arguments.limit, "At most so many; 0: all [50]")
      ->check(CLI::Validator(CLI::NonNegativeNumber).description(""))
      ->type_name("N");
  AddLabels(list, arguments, "Only jobs with this label; VALUE may end in *; may be repeated");
  list.add_option("--filter", arguments.filter,
                  "Only jobs that this is true of, e.g. 'create_time >= \"2026-01-31T08:00:00Z\"'; see ListJobs in "
                  "API.md")
      ->type_name("TEXT");
  const Choices<JobState> states{{JobState::kQueued, JobState::kRunning, JobState::kStopping, JobState::kSucceeded,
                                  JobState::kFailed, JobState::kCancelled, JobState::kExpired}};
  list.add_option_function<std::string>(
          "--state",
          [&arguments, states](const std::string& name) {
            for (const JobState state : states.values) {
              if (name == ToString(state)) arguments.state = state;
            }
          },
          "QUEUED, RUNNING, STOPPING, SUCCEEDED, FAILED, CANCELLED or EXPIRED only")
      ->check(CLI::IsMember(states.Names()).description(""))
      ->type_name("STATE");
  AddJobCommand(jobs, arguments, Command::kJobsShow, "show", "One job with its report");
  CLI::App& watch = AddJobCommand(jobs, arguments, Command::kJobsWatch, "watch",
                                  "Follow a job to its end; with --mesh and -o, write its UV");
  watch.add_option("--mesh", arguments.input, "The file that was sent; the UV go into a copy of it")->type_name("IN");
  AddOutput(watch, arguments);
  AddPreview(watch, arguments);
  AddTexcoord(watch, arguments);
  AddOutputTexcoord(watch, arguments);
  AddTimeout(watch, arguments, "Stop watching after so long; the job goes on");
  AddTerminal(watch, arguments);
  AddProgress(watch, arguments);
  AddJobCommand(jobs, arguments, Command::kJobsStop, "stop", "End a job soon, with the best map that it has then");
  AddJobCommand(jobs, arguments, Command::kJobsCancel, "cancel", "End a job and discard what it has");
  AddJobCommand(jobs, arguments, Command::kJobsDelete, "delete", "Forget a job that ended");
}

void DefineHealth(CLI::App& app, Arguments& arguments) {
  CLI::App& health = *app.add_subcommand("health", "Ask a server by HTTP whether it is ready for jobs");
  health.parse_complete_callback([&arguments] { arguments.command = Command::kHealth; });
  health.footer(
      "For probes, beside planishd --metrics-listen; needs no credentials. /livez in place of /readyz asks whether it "
      "serves at all.\nExit codes: 0 yes, 1 no, 3 nobody answers.");
  health.add_option("URL", arguments.health_url, "What to ask [http://127.0.0.1:9741/readyz]")->type_name("");
}

CLI::App& AddAdminCommand(CLI::App& admin, Arguments& arguments, Command command, const std::string& name,
                          const std::string& description) {
  CLI::App& app = *admin.add_subcommand(name, description);
  app.parse_complete_callback([&arguments, command] { arguments.command = command; });
  AddServer(app, arguments, "required here");
  return app;
}

void DefineAdmin(CLI::App& app, Arguments& arguments) {
  CLI::App& admin = *app.add_subcommand("admin", "Run a server: for callers with the right \"admin\"");
  admin.require_subcommand(1);
  AddAdminCommand(admin, arguments, Command::kAdminDrain, "drain",
                  "Take no new jobs and say so to load balancers; those that were accepted go on")
      .add_flag("--wait", arguments.wait, "Return when no job is left");
  AddAdminCommand(admin, arguments, Command::kAdminUndrain, "undrain", "Take new jobs again");
  AddJson(AddAdminCommand(admin, arguments, Command::kAdminStats, "stats", "What the server is doing"), arguments);
  AddAdminCommand(admin, arguments, Command::kAdminConfig, "config",
                  "The settings it runs with, and where they come from, as its configuration file");
}

void DefineVersion(CLI::App& app, Arguments& arguments) {
  CLI::App& version = *app.add_subcommand("version", "Versions of this command and of the server");
  version.parse_complete_callback([&arguments] { arguments.command = Command::kVersion; });
  AddServer(version, arguments, "without it the private one");
  AddJson(version, arguments);
  AddTerminal(version, arguments);
}

}  // namespace

void DefineServerCommands(CLI::App& app, Arguments& arguments) {
  DefineEstimate(app, arguments);
  DefineJobs(app, arguments);
  DefineHealth(app, arguments);
  DefineAdmin(app, arguments);
  DefineVersion(app, arguments);
}

}  // namespace planish::cli
