// `planish jobs watch`.
#pragma once

#include <string>

#include "client/cli/arguments.h"
#include "client/cli/delivery.h"

namespace planish::cli {

class Interrupts;

// `output` and `texcoord` go with `input`.
struct JobsWatchArguments : DeliveryArguments {
  std::string job;    // "jobs/..."
  std::string input;  // the mesh that was sent; empty: the UV are not fetched
};

void AddFlags(CLI::App& app, JobsWatchArguments& arguments);
std::string Check(JobsWatchArguments& arguments);
int Run(const JobsWatchArguments& arguments, Interrupts& interrupts);

}  // namespace planish::cli
