// What is about servers and their jobs: estimate, jobs, health, admin, version.
#include "client/cli/flags.h"

#include <cstddef>
#include <cstdint>
#include <cstdlib>
#include <string>
#include <vector>

namespace planish::cli {
namespace {

void AddServerFlags(CLI::App& app, ServerFlags& flags) {
  app.add_flag("--tls", flags.tls, "Encrypt, and ask the server for a certificate that this system trusts")
      ->envname("PLANISH_TLS");
  app.add_option("--tls-ca", flags.tls_ca_file, "The same, signed by one of these")
      ->envname("PLANISH_TLS_CA")
      ->type_name("PEM");
  app.add_option("--tls-cert", flags.tls_cert_file, "Certificate of your own, for servers that ask for one")
      ->envname("PLANISH_TLS_CERT")
      ->type_name("PEM");
  app.add_option("--tls-key", flags.tls_key_file, "Its key")->envname("PLANISH_TLS_KEY")->type_name("PEM");
  app.add_option("--tls-server-name", flags.tls_server_name, "What the server's certificate is for [the host]")
      ->envname("PLANISH_TLS_SERVER_NAME")
      ->type_name("NAME");
  app.add_option("--token-file", flags.token_file, "Token that says who you are; or the token itself in PLANISH_TOKEN")
      ->envname("PLANISH_TOKEN_FILE")
      ->type_name("FILE");
  app.add_flag("--token-over-plaintext", flags.token_over_plaintext,
               "Send it to another machine even without TLS, for everybody on the way to read");
}

}  // namespace

const char* ToString(ColorMode mode) {
  switch (mode) {
    case ColorMode::kAuto:
      return "auto";
    case ColorMode::kAlways:
      return "always";
    case ColorMode::kNever:
      return "never";
  }
  return "";
}

const char* ToString(ProgressMode mode) {
  switch (mode) {
    case ProgressMode::kAuto:
      return "auto";
    case ProgressMode::kBar:
      return "bar";
    case ProgressMode::kPlain:
      return "plain";
    case ProgressMode::kJson:
      return "json";
    case ProgressMode::kNone:
      return "none";
  }
  return "";
}

void AddLabels(CLI::App& app, Arguments& arguments, const std::string& description) {
  app.add_option_function<std::vector<std::string>>(
         "--label",
         [&arguments](const std::vector<std::string>& texts) {
           for (const std::string& text : texts) {
             const std::size_t equals = text.find('=');
             if (equals == std::string::npos || equals == 0) {
               throw CLI::ValidationError("--label", text + " is not of the form KEY=VALUE");
             }
             arguments.labels[text.substr(0, equals)] = text.substr(equals + 1);
           }
         },
         description)
      ->type_name("KEY=VALUE")
      ->allow_extra_args(false);
}

void AddServer(CLI::App& app, Arguments& arguments, const std::string& otherwise) {
  app.add_option("--server", arguments.server, "host:port or unix:/path; " + otherwise)
      ->envname("PLANISH_SERVER")
      ->type_name("ADDR");
  const std::string group = app.option_defaults()->get_group();
  app.option_defaults()->group("Security");
  AddServerFlags(app, arguments.server_flags);
  app.option_defaults()->group(group);
}

void AddJson(CLI::App& app, Arguments& arguments) {
  app.add_flag("--json", arguments.json, "Print one JSON object on stdout");
}

void AddTerminal(CLI::App& app, Arguments& arguments) {
  app.option_defaults()->group("Terminal");
  app.add_flag("-q,--quiet", arguments.quiet, "Say nothing on stderr but what went wrong; the exit code says the rest");
  Choices<ColorMode>{{ColorMode::kAuto, ColorMode::kAlways, ColorMode::kNever}}.AddTo(
      app, "--color", arguments.color, "Colours on stderr; auto: on a terminal, unless NO_COLOR is set [auto]");
}

void AddProgress(CLI::App& app, Arguments& arguments) {
  Choices<ProgressMode>{
      {ProgressMode::kAuto, ProgressMode::kBar, ProgressMode::kPlain, ProgressMode::kJson, ProgressMode::kNone}}
      .AddTo(app, "--progress", arguments.progress,
             "What stderr shows of a running job and of images that are drawn; auto: a bar on a terminal, else nothing (of a batch a line per file; "
             "with "
             "--verbose as plain)");
  app.add_flag("-v,--verbose", arguments.verbose,
               "Say on stderr which server answers and what is sent, and of the result also the seconds of each stage, "
               "memory, charts and every warning")
      ->excludes("--quiet");
}

void AddOutput(CLI::App& app, Arguments& arguments, bool takes_batch) {
  app.add_option("-o,--output", arguments.output,
                 std::string("Where the mesh with UV goes, in the format of the name: .obj, .ply, .off, .gltf, .glb or "
                             ".drc; - is stdout; a directory keeps the name") +
                     (takes_batch ? ", and takes a batch" : ""))
      ->type_name("OUT");
}

void AddPreview(CLI::App& app, Arguments& arguments) {
  app.add_option(
         "--preview", arguments.preview,
         "Draw the layout alone, tile by tile, blue where the map shrinks the surface and red where it enlarges it")
      ->type_name("PNG|SVG");
}

void AddTimeout(CLI::App& app, Arguments& arguments, const std::string& description) {
  app.add_option("--timeout", arguments.timeout_seconds, description)
      ->check(CLI::Validator(CLI::PositiveNumber).description(""))
      ->type_name("SECONDS");
}

void AddTexcoord(CLI::App& app, Arguments& arguments) {
  app.add_option("--texcoord", arguments.texcoord, "Which set of UV of a glTF is read, TEXCOORD_N, up to 7 [0]")
      ->check(CLI::Range(0, 7).description(""))
      ->type_name("N");
}

void AddOutputTexcoord(CLI::App& app, Arguments& arguments) {
  app.add_option_function<int>(
         "--output-texcoord", [&arguments](const int& n) { arguments.output_texcoord = n; },
         "Which set the new UV become; others stay as they are [that of --texcoord]")
      ->check(CLI::Range(0, 7).description(""))
      ->type_name("N");
}

void AddTextures(CLI::App& app, Arguments& arguments) {
  Choices<Textures>{{Textures::kTransfer, Textures::kKeep, Textures::kDrop}}.AddTo(
      app, "--textures", arguments.textures.textures,
      "Images of glTF and OBJ whose UV are replaced: transfer, draw them into the new map; keep, leave them and their "
      "UV, and put the new UV into the next free set; drop, remove the references [transfer]");
  AddImageFlags(app, arguments);
}

void AddImageFlags(CLI::App& app, Arguments& arguments) {
  app.add_flag("--merge-materials", arguments.textures.merge_materials,
               "glTF: materials that differ only in images and factors become one, with one set of images and one "
               "primitive a mesh");
  app.add_option_function<std::string>(
         "--bake", [&arguments](const std::string&) { arguments.textures.bake_colors = true; },
         "Paint this into an image of base colours: colors, those of the vertices [nothing]")
      ->check(CLI::IsMember({"colors"}).description(""))
      ->type_name("colors");
  app.add_option("--memory", arguments.textures.memory_mb,
                 "Megabytes that moving one image may take at most [half of the machine's]")
      ->check(CLI::Range(1, 1 << 24).description(""))
      ->type_name("MB");
  app.add_flag("--allow-outside", arguments.textures.allow_outside,
               "Read images that do not lie in the folder of the model as well");
}

void AddScheduling(CLI::App& app, Scheduling& scheduling) {
  app.add_option_function<std::string>(
         "--priority",
         [&scheduling](const std::string& name) {
           for (const Priority priority : {Priority::kLow, Priority::kNormal, Priority::kHigh}) {
             if (name == ToString(priority)) scheduling.priority = priority;
           }
         },
         "Which waiting job is next: high counts as 10 minutes older, low as 10 minutes younger [normal]")
      ->check(CLI::IsMember({"low", "normal", "high"}).description(""))
      ->type_name("low|normal|high");
  app.add_option_function<double>(
         "--deadline", [&scheduling](const double& seconds) { scheduling.timeout = Seconds(seconds); },
         "The server fails the job if it has not ended so long after it was accepted, time in the queue included")
      ->check(CLI::Validator(CLI::PositiveNumber).description(""))
      ->type_name("SECONDS");
  app.add_option_function<double>(
         "--budget", [&scheduling](const double& seconds) { scheduling.compute_budget = Seconds(seconds); },
         "The server stops the job when it has run for so long, and delivers the best map that there is then")
      ->check(CLI::Validator(CLI::PositiveNumber).description(""))
      ->type_name("SECONDS");
  app.add_flag("--fresh", scheduling.fresh,
               "The server computes anew even if it has kept the result for this mesh and these options");
}

ClientOptions WithServerFlags(ClientOptions options, const ServerFlags& flags) {
  options.tls = flags.tls;
  options.tls_ca_file = flags.tls_ca_file;
  options.tls_cert_file = flags.tls_cert_file;
  options.tls_key_file = flags.tls_key_file;
  options.tls_server_name = flags.tls_server_name;
  options.token_file = flags.token_file;
  options.token_over_plaintext = flags.token_over_plaintext;
  const char* token = std::getenv("PLANISH_TOKEN");
  if (token != nullptr && flags.token_file.empty()) options.token = token;
  return options;
}

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
  Choices<JobState>{{JobState::kQueued, JobState::kRunning, JobState::kStopping, JobState::kSucceeded,
                     JobState::kFailed, JobState::kCancelled, JobState::kExpired}}
      .AddTo(list, "--state", arguments.state,
             "QUEUED, RUNNING, STOPPING, SUCCEEDED, FAILED, CANCELLED or EXPIRED only")
      ->type_name("STATE");
  AddJobCommand(jobs, arguments, Command::kJobsShow, "show", "One job with its report");
  CLI::App& watch = AddJobCommand(jobs, arguments, Command::kJobsWatch, "watch",
                                  "Follow a job to its end; with --mesh and -o, write its UV");
  watch.add_option("--mesh", arguments.input, "The file that was sent; the UV go into a copy of it")->type_name("IN");
  AddOutput(watch, arguments, /*takes_batch=*/false);
  AddPreview(watch, arguments);
  AddTexcoord(watch, arguments);
  AddOutputTexcoord(watch, arguments);
  AddTextures(watch, arguments);
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
