// The command line as data.
#pragma once

#include <optional>
#include <string>

#include "client/cli/seam_list.h"
#include "planish/types.h"

namespace planish::cli {

enum class Command { kUnwrap, kInspect, kJobsList, kJobsShow, kJobsWatch, kJobsCancel, kJobsDelete, kVersion };
enum class ProgressMode { kAuto, kBar, kPlain, kJson, kNone };

struct Arguments {
  Command command = Command::kUnwrap;
  std::string server;  // empty: a private one
  bool json = false;
  ProgressMode progress = ProgressMode::kAuto;

  // unwrap and inspect; jobs watch has the mesh in `input` if it was given.
  std::string input;
  std::string output;
  std::string picture;                            // a PNG of the map; empty: none
  double view_azimuth = 35, view_elevation = 17;  // of the picture, degrees
  int texcoord = 0;                               // which of the file's sets of UV, for glTF
  UnwrapOptions options;                          // seams and hard_edge_degrees as in `seams`
  SeamList seams;
  bool detach = false;
  std::string label;
  double timeout_seconds = 0;  // 0: none

  // jobs
  std::string job;  // "jobs/..."
  std::optional<JobState> state;
  int limit = 50;
};

// Either arguments, or what to print and the code to exit with.
struct ParsedArguments {
  std::optional<Arguments> arguments;
  int exit_code = 0;
  std::string out;  // for stdout: help
  std::string err;  // for stderr: what is wrong
};

ParsedArguments ParseArguments(int argc, const char* const* argv);

}  // namespace planish::cli
