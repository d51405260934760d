#include "client/cli/jobs_command.h"

#include <algorithm>
#include <chrono>
#include <cstdio>
#include <ctime>
#include <iostream>
#include <vector>

#include "client/cli/exit_codes.h"
#include "client/cli/flags.h"
#include "client/cli/mesh_input.h"
#include "client/cli/results.h"
#include "client/cli/session.h"
#include "client/cli/text.h"

namespace planish::cli {

void AddJob(CLI::App& app, std::string& job) {
  app.add_option("JOB", job, "Name of the job: jobs/... (jobs/ may be left out)")->required()->type_name("");
}

std::string CheckJob(std::string& job, const ServerArguments& server) {
  if (job.rfind("jobs/", 0) != 0) job = "jobs/" + job;
  return server.address.empty() ? "jobs live on a server: give --server=ADDR or set PLANISH_SERVER" : "";
}

namespace {

// Adds the flags of show, stop and cancel.
template <typename OneJobArguments>
void AddJobFlags(CLI::App& app, OneJobArguments& arguments) {
  AddJob(app, arguments.job);
  AddServer(app, arguments.server, "required here");
  AddJson(app, arguments.json);
  AddTerminal(app, arguments.terminal);
}

}  // namespace

void AddFlags(CLI::App& app, JobsListArguments& arguments) {
  AddServer(app, arguments.server, "required here");
  AddJson(app, arguments.json);
  AddTerminal(app, arguments.terminal);
  app.add_option("--limit", arguments.limit, "Most jobs to list; 0: all [50]")
      ->check(CLI::Validator(CLI::NonNegativeNumber).description(""))
      ->type_name("N");
  AddLabels(app, arguments.labels, "Only jobs with this label; VALUE may end in *; may be repeated");
  app.add_option("--filter", arguments.filter,
                 "Only jobs that match this filter, e.g. 'create_time >= \"2026-01-31T08:00:00Z\"'; see ListJobs in "
                 "API.md")
      ->type_name("TEXT");
  Choices<JobState>{{JobState::kQueued, JobState::kRunning, JobState::kStopping, JobState::kSucceeded,
                     JobState::kFailed, JobState::kCancelled, JobState::kExpired}}
      .AddTo(app, "--state", arguments.state,
             "Only jobs in this state: QUEUED, RUNNING, STOPPING, SUCCEEDED, FAILED, CANCELLED or EXPIRED")
      ->type_name("STATE");
}

void AddFlags(CLI::App& app, JobsShowArguments& arguments) {
  AddJobFlags(app, arguments);
}

void AddFlags(CLI::App& app, JobsStopArguments& arguments) {
  AddJobFlags(app, arguments);
}

void AddFlags(CLI::App& app, JobsCancelArguments& arguments) {
  AddJobFlags(app, arguments);
}

void AddFlags(CLI::App& app, JobsDeleteArguments& arguments) {
  AddJob(app, arguments.job);
  AddServer(app, arguments.server, "required here");
  AddTerminal(app, arguments.terminal);
}

std::string Check(JobsListArguments& arguments) {
  return arguments.server.address.empty() ? "jobs live on a server: give --server=ADDR or set PLANISH_SERVER" : "";
}

std::string Check(JobArguments& arguments) {
  return CheckJob(arguments.job, arguments.server);
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

// How long the job has run.
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

std::string FilterOf(const JobsListArguments& arguments) {
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

// Prints properties of a job that differ from the default, and its memory and expiry.
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

// Prints the answer of stop and cancel.
void Print(const Job& job, bool json) {
  if (json) {
    std::cout << ToText(ToJson(job)) << std::flush;
  } else {
    std::cout << job.name << " " << ToString(job.state) << "\n" << std::flush;
  }
}

}  // namespace

int Run(const JobsListArguments& arguments, Interrupts& interrupts) {
  ServerChoice server(arguments.server, interrupts);
  const std::vector<Job> jobs = server.client().ListJobs(arguments.limit, FilterOf(arguments));
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

int Run(const JobsShowArguments& arguments, Interrupts& interrupts) {
  const Job job = ServerChoice(arguments.server, interrupts).client().GetJob(arguments.job);
  if (arguments.json) {
    std::cout << ToText(ToJson(job)) << std::flush;
  } else {
    PrintJob(job);
  }
  return kOk;
}

int Run(const JobsStopArguments& arguments, Interrupts& interrupts) {
  Print(ServerChoice(arguments.server, interrupts).client().StopJob(arguments.job), arguments.json);
  return kOk;
}

int Run(const JobsCancelArguments& arguments, Interrupts& interrupts) {
  Print(ServerChoice(arguments.server, interrupts).client().CancelJob(arguments.job), arguments.json);
  return kOk;
}

int Run(const JobsDeleteArguments& arguments, Interrupts& interrupts) {
  ServerChoice(arguments.server, interrupts).client().DeleteJob(arguments.job);
  if (!arguments.terminal.quiet) std::cerr << "Deleted " << arguments.job << ".\n";
  return kOk;
}

}  // namespace planish::cli
