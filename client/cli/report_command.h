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
  bool sheet = false;      // make a contact sheet: a page per file, and an index of these pages (report.h)
  std::string job_report;  // a file with what `unwrap --json` printed; empty: none
  PageTiles tiles;
  int texcoord = 0;
};

void AddFlags(CLI::App& app, ReportArguments& arguments);
// Returns what is wrong with the flags, or an empty string. Also sets `arguments.sheet`, which depends on the number of
// inputs and on whether inputs or output are directories.
std::string Check(ReportArguments& arguments);
int Run(const ReportArguments& arguments, Interrupts& interrupts);

}  // namespace planish::cli
