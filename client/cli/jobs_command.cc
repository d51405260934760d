#include <algorithm>
#include <cstdio>
#include <ctime>
#include <iostream>
#include <vector>

#include "client/cli/commands.h"
#include "client/cli/exit_codes.h"
#include "client/cli/json.h"
#include "client/cli/numbers.h"
#include "client/cli/server_choice.h"
#include "client/cli/summary.h"
#include "client/cli/terminal.h"
#include "client/cli/text_width.h"

namespace planish::cli {
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
  if (job.error)
    std::cout << "error    " << Printable(job.error->what() + (" [" + job.error->reason() + "]"), true) << "\n";
  if (job.report) {
    Report report = *job.report;
    if (job.create_time && job.end_time) {
      report.times.total = *job.end_time - *job.create_time;
    }
    std::cout << "\n" << Summary(report, "", Terminal());
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

}  // namespace planish::cli
