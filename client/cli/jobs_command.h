// `planish jobs`: list, show, stop, cancel and delete; watch is in jobs_watch_command.h.
#pragma once

#include <map>
#include <optional>
#include <string>

#include "client/cli/arguments.h"

namespace planish::cli {

class Interrupts;

struct JobsListArguments {
  int limit = 50;                             // 0: all
  std::map<std::string, std::string> labels;  // that a job must have; a value may end in "*"
  std::string filter;                         // a further condition, as in planish.v1.ListJobsRequest.filter
  std::optional<JobState> state;
  ServerArguments server;
  bool json = false;
  TerminalArguments terminal;
};

struct JobArguments {
  std::string job;  // "jobs/..."
  ServerArguments server;
  TerminalArguments terminal;
};
struct JobsShowArguments : JobArguments {
  bool json = false;
};
struct JobsStopArguments : JobArguments {
  bool json = false;
};
struct JobsCancelArguments : JobArguments {
  bool json = false;
};
struct JobsDeleteArguments : JobArguments {};

void AddFlags(CLI::App& app, JobsListArguments& arguments);
void AddFlags(CLI::App& app, JobsShowArguments& arguments);
void AddFlags(CLI::App& app, JobsStopArguments& arguments);
void AddFlags(CLI::App& app, JobsCancelArguments& arguments);
void AddFlags(CLI::App& app, JobsDeleteArguments& arguments);
std::string Check(JobsListArguments& arguments);
std::string Check(JobArguments& arguments);
int Run(const JobsListArguments& arguments, Interrupts& interrupts);
int Run(const JobsShowArguments& arguments, Interrupts& interrupts);
int Run(const JobsStopArguments& arguments, Interrupts& interrupts);
int Run(const JobsCancelArguments& arguments, Interrupts& interrupts);
int Run(const JobsDeleteArguments& arguments, Interrupts& interrupts);

// Adds the argument JOB of commands about one job.
void AddJob(CLI::App& app, std::string& job);
// Adds "jobs/" to the name if it was left out. Returns a message if no server was given, otherwise an empty string.
std::string CheckJob(std::string& job, const ServerArguments& server);

}  // namespace planish::cli
