// What is about servers and their jobs: estimate, jobs (watch is in unwrap_command.cc), admin, version.
#include <algorithm>
#include <chrono>
#include <cstdio>
#include <ctime>
#include <iostream>
#include <optional>
#include <string>
#include <thread>
#include <vector>

#include "client/cli/arguments.h"
#include "client/cli/commands.h"
#include "client/cli/mesh_input.h"
#include "client/cli/results.h"
#include "client/cli/session.h"
#include "client/cli/text.h"
#include "planish/admin.h"
#include "planish/error.h"

namespace planish::cli {
namespace {

void Print(const JobEstimate& estimate) {
  std::cout << "size     " << Counted(estimate.triangles, "triangle", "triangles") << ", "
            << Counted(estimate.vertices, "vertex", "vertices") << "\n"
            << "memory   " << Megabytes(estimate.memory_bytes) << " while it runs\n"
            << "run      about " << Duration(estimate.run_time.count()) << " on one core\n"
            << "wait     "
            << (estimate.queue_time.count() > 0 ? "about " + Duration(estimate.queue_time.count()) + " in the queue"
                                                : "none")
            << "\n";
  if (estimate.refusal) {
    std::cout << "refused  " << Printable(ErrorLine(*estimate.refusal), true) << "\n";
  } else {
    std::cout << "accepted if sent now\n";
  }
  std::cout << std::flush;
}

}  // namespace

int RunEstimate(const Arguments& arguments, Interrupts& interrupts) {
  std::optional<MeshInput> input;
  if (!arguments.input.empty()) input.emplace(std::vector<std::string>{arguments.input}, arguments.texcoord);
  ServerChoice server(arguments.server, arguments.server_flags, interrupts);
  const JobEstimate estimate = input ? server.client().Estimate(input->view(), arguments.options)
                                     : server.client().Estimate(arguments.triangles, 0, arguments.options);
  if (arguments.json) {
    std::cout << ToText(ToJson(estimate)) << std::flush;
  } else {
    Print(estimate);
  }
  return estimate.refusal ? kFailed : kOk;
}

namespace {

std::string LocalTime(const std::optional<Job::Time>& time) {
  if (!time) return "-";
  const std::time_t seconds = Job::Time::clock::to_time_t(*time);
  std::tm parts = {};
  localtime_r(&seconds, &parts);
  char text[32];
  std::strftime(text, sizeof text, "%Y-%m-%d %H:%M:%S", &parts);
  return text;
}

// How long it ran, or has run so far.
std::string RunTime(const Job& job) {
  if (!job.start_time) return "-";
  const Job::Time end = job.end_time.value_or(Job::Time::clock::now());
  return Duration(std::max(0.0, std::chrono::duration<double>(end - *job.start_time).count()));
}

void PrintTable(const std::vector<std::vector<std::string>>& rows) {
  std::vector<int> widths;
  for (const auto& row : rows) {
    widths.resize(std::max(widths.size(), row.size()), 0);
    for (std::size_t c = 0; c < row.size(); ++c) {
      widths[c] = std::max(widths[c], DisplayWidth(Printable(row[c], true)));
    }
  }
  for (const auto& row : rows) {
    std::string line;
    for (std::size_t c = 0; c < row.size(); ++c) {
      const std::string text = Printable(row[c], true);
      line += c + 1 < row.size() ? Padded(text, widths[c] + 2) : text;
    }
    std::cout << line << "\n";
  }
  std::cout << std::flush;
}

// "build=1234 file=spot.obj"
std::string LabelsText(const Job& job) {
  std::string text;
  for (const auto& [key, value] : job.labels) text += (text.empty() ? "" : " ") + key + "=" + value;
  return text;
}

std::string Quoted(const std::string& text) {
  std::string quoted = "\"";
  for (const char c : text) {
    if (c == '"' || c == '\\') quoted += '\\';
    quoted += c;
  }
  return quoted + "\"";
}

std::string FilterOf(const Arguments& arguments) {
  std::vector<std::string> conditions;
  if (arguments.state) conditions.push_back(std::string("state = ") + ToString(*arguments.state));
  for (const auto& [key, value] : arguments.labels) {
    conditions.push_back("labels." + key + " = " + Quoted(ValidUtf8(value)));
  }
  if (!arguments.filter.empty()) conditions.push_back(ValidUtf8(arguments.filter));
  std::string filter;
  for (const std::string& condition : conditions) filter += (filter.empty() ? "" : " AND ") + condition;
  return filter;
}

int List(const Arguments& arguments, Client& client) {
  const std::vector<Job> jobs = client.ListJobs(arguments.limit, FilterOf(arguments));
  if (arguments.json) {
    Json array = Json::array();
    for (const Job& job : jobs) array.push_back(ToJson(job));
    std::cout << ToText({{"jobs", array}}) << std::flush;
    return kOk;
  }
  std::vector<std::vector<std::string>> rows = {{"JOB", "STATE", "CREATED", "TIME", "LABELS"}};
  for (const Job& job : jobs) {
    rows.push_back({job.name, ToString(job.state), LocalTime(job.create_time), RunTime(job), LabelsText(job)});
  }
  PrintTable(rows);
  return kOk;
}

// What most jobs do not have.
void PrintScheduling(const Job& job) {
  const Scheduling& scheduling = job.scheduling;
  if (scheduling.priority != Priority::kNormal) std::cout << "priority " << ToString(scheduling.priority) << "\n";
  if (scheduling.timeout.count() > 0) std::cout << "deadline " << Duration(scheduling.timeout.count()) << "\n";
  if (scheduling.compute_budget.count() > 0) {
    std::cout << "budget   " << Duration(scheduling.compute_budget.count()) << "\n";
  }
  if (job.memory_bytes > 0) std::cout << "memory   " << Megabytes(job.memory_bytes) << " while it runs\n";
  if (job.attempts > 1) std::cout << "attempts " << job.attempts << "\n";
  if (job.stop_requested) std::cout << "stopped  as asked for, or out of budget\n";
  if (job.cancel_requested && !IsTerminal(job.state)) std::cout << "cancel   asked for\n";
  if (!job.result_of.empty()) std::cout << "shares   the work of " << job.result_of << "\n";
  if (job.expire_time) std::cout << "expires  " << LocalTime(job.expire_time) << "\n";
}

void PrintJob(const Job& job) {
  PrintTable({{"job", job.name},
              {"state", ToString(job.state)},
              {"labels", LabelsText(job)},
              {"created", LocalTime(job.create_time)},
              {"started", LocalTime(job.start_time)},
              {"ended", LocalTime(job.end_time)},
              {"time", RunTime(job)},
              {"mesh", WithCommas(job.mesh_bytes) + " bytes as sent"}});
  PrintScheduling(job);
  if (job.state == JobState::kQueued) std::cout << "ahead    " << job.queue_position << "\n";
  if (job.progress) {
    std::cout << "at       " << ToString(job.progress->stage) << ", newton " << job.progress->newton_iteration
              << ", residual " << Scientific(job.progress->residual.Worst()) << "\n";
  }
  if (job.error) std::cout << "error    " << Printable(ErrorLine(*job.error), true) << "\n";
  if (job.report) {
    Report report = *job.report;
    if (job.create_time && job.end_time) {
      report.times.total = *job.end_time - *job.create_time;
    }
    std::cout << "\n" << Summary(report, {}, Terminal());
  }
  std::cout << std::flush;
}

}  // namespace

int RunJobs(const Arguments& arguments, Interrupts& interrupts) {
  ServerChoice server(arguments.server, arguments.server_flags, interrupts);
  Client& client = server.client();
  switch (arguments.command) {
    case Command::kJobsList:
      return List(arguments, client);
    case Command::kJobsDelete:
      client.DeleteJob(arguments.job);
      if (!arguments.quiet) std::cerr << "Deleted " << arguments.job << ".\n";
      return kOk;
    default:
      break;
  }
  const bool cancels = arguments.command == Command::kJobsCancel, stops = arguments.command == Command::kJobsStop;
  const Job job = cancels ? client.CancelJob(arguments.job)
                  : stops ? client.StopJob(arguments.job)
                          : client.GetJob(arguments.job);
  if (arguments.json) {
    std::cout << ToText(ToJson(job)) << std::flush;
  } else if (cancels || stops) {
    std::cout << job.name << " " << ToString(job.state) << "\n" << std::flush;
  } else {
    PrintJob(job);
  }
  return kOk;
}

namespace {

constexpr std::chrono::milliseconds kLookInterval(250);

std::string Jobs(const ServerStats& stats) {
  return Counted(stats.running, "job runs", "jobs run") + ", " + Counted(stats.queued, "waits", "wait");
}

double Uptime(const ServerStats& stats) {
  return std::chrono::duration<double>(std::chrono::system_clock::now() - stats.start_time).count();
}

Json StatsJson(const ServerStats& stats) {
  Json tenants = Json::array();
  for (const ServerStats::Tenant& tenant : stats.tenants) {
    tenants.push_back({{"tenant", tenant.name},
                       {"queued", tenant.queued},
                       {"running", tenant.running},
                       {"accepted", tenant.accepted},
                       {"refused", tenant.refused}});
  }
  return {{"version", stats.version},
          {"uptime_seconds", Uptime(stats)},
          {"draining", stats.draining},
          {"workers", stats.workers},
          {"workers_ready", stats.workers_ready},
          {"queued", stats.queued},
          {"running", stats.running},
          {"reserved_memory_bytes", stats.reserved_memory_bytes},
          {"memory_bytes", stats.memory_bytes},
          {"stored_bytes", stats.stored_bytes},
          {"store_bytes", stats.store_bytes},
          {"oldest_wait_seconds", stats.oldest_wait.count()},
          {"tenants", tenants}};
}

void Print(const ServerStats& stats) {
  std::cout << "planishd " << stats.version << ", up for " << Duration(Uptime(stats))
            << (stats.draining ? ", draining: takes no new jobs" : "") << "\n"
            << "jobs     " << Jobs(stats);
  if (stats.queued > 0) std::cout << ", the oldest for " << Duration(stats.oldest_wait.count());
  std::cout << "\n"
            << "workers  " << stats.workers_ready << " of " << stats.workers << " ready\n"
            << "memory   " << Megabytes(stats.reserved_memory_bytes) << " of " << Megabytes(stats.memory_bytes)
            << " reserved\n"
            << "store    " << Megabytes(stats.stored_bytes) << " of " << Megabytes(stats.store_bytes) << "\n";
  for (const ServerStats::Tenant& tenant : stats.tenants) {
    std::cout << "tenant   " << Printable(tenant.name, true) << ": " << tenant.running << " running, " << tenant.queued
              << " queued, " << tenant.accepted << " accepted and " << tenant.refused << " refused so far\n";
  }
  std::cout << std::flush;
}

// A line on stderr each time the numbers change.
void WaitUntilIdle(AdminClient& admin) {
  std::string said;
  for (ServerStats stats = admin.GetStats(); !stats.IsIdle(); stats = admin.GetStats()) {
    const std::string jobs = Jobs(stats);
    if (jobs != said) std::cerr << "Draining: " << jobs << ".\n";
    said = jobs;
    std::this_thread::sleep_for(kLookInterval);
  }
}

int Drain(AdminClient& admin, bool wait, Interrupts& interrupts) {
  admin.Drain();
  if (!wait) {
    std::cerr << "The server takes no new jobs.\n";
    return kOk;
  }
  interrupts.SetLastWords([] { std::cerr << "The server goes on draining; planish admin undrain takes that back.\n"; });
  WaitUntilIdle(admin);
  interrupts.SetLastWords({});
  std::cerr << "Drained: no job is left.\n";
  return kOk;
}

}  // namespace

int RunAdmin(const Arguments& arguments, Interrupts& interrupts) {
  AdminClient admin(arguments.server, WithServerFlags({}, arguments.server_flags));
  switch (arguments.command) {
    case Command::kAdminDrain:
      return Drain(admin, arguments.wait, interrupts);
    case Command::kAdminUndrain:
      admin.Undrain();
      std::cerr << "The server takes new jobs again.\n";
      return kOk;
    case Command::kAdminConfig:
      std::cout << admin.GetConfig().yaml << std::flush;
      return kOk;
    default:
      break;
  }
  const ServerStats stats = admin.GetStats();
  if (arguments.json) {
    std::cout << ToText(StatsJson(stats)) << std::flush;
  } else {
    Print(stats);
  }
  return kOk;
}

namespace {

void PrintServer(const Capabilities& capabilities, const std::string& where) {
  std::cout << "planishd " << capabilities.version << " (" << where << "; "
            << Counted(capabilities.workers, "worker", "workers") << ", queue of " << capabilities.queue_capacity
            << ", meshes up to " << WithCommas(capabilities.max_mesh_bytes / 1000000) << " MB)\n";
}

}  // namespace

int RunVersion(const Arguments& arguments, Interrupts& interrupts) {
  std::optional<Capabilities> capabilities;
  std::optional<Error> error;
  std::string where = arguments.server;
  try {
    ServerChoice server(arguments.server, arguments.server_flags, interrupts);
    if (server.private_server() != nullptr) where = server.private_server()->executable();
    capabilities = server.client().GetCapabilities();
  } catch (const Error& e) {
    error = e;
  }
  if (arguments.json) {
    Json json = {{"client", {{"version", Version()}}}};
    if (capabilities) {
      json["server"] = ToJson(*capabilities);
      json["server"]["address"] = where;
    }
    std::cout << ToText(json) << std::flush;
  } else {
    std::cout << "planish " << Version() << "\n";
    if (capabilities) PrintServer(*capabilities, where);
    std::cout << std::flush;
  }
  if (!error) return kOk;
  // Who named a server wants to know that it does not answer; a missing private one is no fault of the client.
  if (arguments.server.empty()) {
    std::cerr << "planish: no private server: " << error->what() << "\n";
    return kOk;
  }
  std::cerr << ErrorText(*error, "", StderrTerminal());
  return ExitCodeOf(*error);
}

}  // namespace planish::cli
