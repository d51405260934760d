// `planish unwrap`, for one mesh or a batch of files.
#pragma once

#include <map>
#include <string>

#include "client/cli/arguments.h"
#include "client/cli/delivery.h"
#include "client/cli/unwrap_files.h"

namespace planish::cli {

class Interrupts;

struct UnwrapArguments : DeliveryArguments {
  InputArguments inputs;
  // The inputs are several files, or a directory, and each file becomes a job and an output (batch_plan.h). `format`
  // and `again` are only for a batch.
  bool batch = false;
  std::string format;      // output format, a file extension: "glb"; empty: the format of each input
  bool again = false;      // redo files that are up to date
  bool one_atlas = false;  // the files are one mesh and share the atlas

  MapArguments map;

  std::string picture;                            // a PNG of the map; empty: none
  double view_azimuth = 35, view_elevation = 17;  // of the picture, degrees
  std::string report;  // an HTML page about the map (report_page.h); for a batch a contact sheet; empty: none

  bool detach = false;
  Scheduling scheduling;
  std::map<std::string, std::string> labels;
};

void AddFlags(CLI::App& app, UnwrapArguments& arguments);
// Returns what is wrong with the flags, or an empty string. Also sets `arguments.batch`, which depends on several flags
// and on whether inputs are directories.
std::string Check(UnwrapArguments& arguments);
int Run(const UnwrapArguments& arguments, Interrupts& interrupts);  // unwrap_command.cc

// Unwraps several files; Run() calls it (batch_command.cc).
int RunBatch(const UnwrapArguments& arguments, Interrupts& interrupts);

}  // namespace planish::cli
