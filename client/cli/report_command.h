// `planish report`, which needs no server.
#pragma once

#include <string>

#include "client/cli/arguments.h"
#include "client/cli/report.h"

namespace planish::cli {

class Interrupts;

struct ReportArguments {
  InputArguments inputs;
  std::string output;
  bool sheet = false;      // a page per file, and an index of them (report.h)
  std::string job_report;  // a file with what `unwrap --json` printed; empty: none
  PageTiles tiles;
  int texcoord = 0;
};

void AddFlags(CLI::App& app, ReportArguments& arguments);
// Also decides whether it makes a sheet, which depends on whether inputs are directories.
std::string Check(ReportArguments& arguments);
int Run(const ReportArguments& arguments, Interrupts& interrupts);

}  // namespace planish::cli
