// The command line as data.
#pragma once

#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "client/cli/check_flags.h"
#include "client/cli/seam_list.h"
#include "client/cli/server_flags.h"
#include "planish/types.h"

namespace planish::cli {

enum class Command {
  kUnwrap,
  kPack,
  kCheck,
  kReport,
  kInspect,
  kEstimate,
  kJobsList,
  kJobsShow,
  kJobsWatch,
  kJobsStop,
  kJobsCancel,
  kJobsDelete,
  kHealth,
  kAdminDrain,
  kAdminUndrain,
  kAdminStats,
  kAdminConfig,
  kVersion
};
enum class ProgressMode { kAuto, kBar, kPlain, kJson, kNone };

struct Arguments {
  Command command = Command::kUnwrap;
  std::string server;  // empty: a private one
  ServerFlags server_flags;
  bool json = false;
  ProgressMode progress = ProgressMode::kAuto;

  // unwrap, pack and inspect; jobs watch has the mesh in `input` if it was given.
  std::string input;
  std::vector<std::string> more_inputs;  // further files
  bool one_atlas = false;                // the files are one mesh and share the atlas
  // Several files, or a directory, that become a job and an output each (batch_plan.h). The next two are for it only.
  bool batch = false;
  std::string format;                  // of the outputs, as the end of a name: "glb"; empty: that of each input
  bool again = false;                  // redo files that are up to date
  std::string output;                  // a file, "-", or a directory
  int texcoord = 0;                    // glTF: UV are read from TEXCOORD_n, in [0, 7]
  std::optional<int> output_texcoord;  // and become this one; without a value the one they are read from
  std::string picture;                 // a PNG of the map; empty: none
  std::string preview;                 // a PNG or SVG of the UV layout; empty: none
  std::string report;                  // unwrap: an HTML page about the map (report_page.h); empty: none
  std::string job_report;              // report: what `unwrap --json` printed, a file; empty: none
  double view_azimuth = 35, view_elevation = 17;  // of the picture, degrees
  UnwrapOptions options;                          // seams and hard_edge_degrees as in `seams`
  SeamList seams;
  bool keep_density = false;                       // pack; texture_size, padding and tiles are those of `options`
  std::map<std::string, double> material_weights;  // pack: times the texels per length, in [0.01, 100]
  CheckArguments check;
  bool detach = false;
  Scheduling scheduling;
  std::map<std::string, std::string> labels;  // jobs list: what those of a job must be; a value may end in "*"
  double timeout_seconds = 0;                 // 0: none

  std::int64_t triangles = 0;  // estimate, in place of `input`

  // jobs
  std::string job;  // "jobs/..."
  std::optional<JobState> state;
  std::string filter;  // planish.v1.ListJobsRequest.filter, beside `labels` and `state`
  int limit = 50;

  std::string health_url = "http://127.0.0.1:9741/readyz";  // health: what to ask
  bool wait = false;                                        // admin drain

  int OutputTexcoord() const { return output_texcoord.value_or(texcoord); }
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
