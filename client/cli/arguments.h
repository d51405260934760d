// The command line as data.
#pragma once

#include <cstdint>
#include <map>
#include <optional>
#include <set>
#include <string>
#include <vector>

#include "client/cli/seams.h"
#include "client/cli/text.h"
#include "planish/client.h"
#include "planish/types.h"

namespace planish::cli {

enum class Command {
  kUnwrap,
  kPack,
  kTransfer,
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

// Of ClientOptions, under the names that they have there.
struct ServerFlags {
  bool tls = false;
  std::string tls_ca_file, tls_cert_file, tls_key_file, tls_server_name;
  std::string token_file;
  bool token_over_plaintext = false;
};
// `options` with what the flags say, and with the token in PLANISH_TOKEN if they name no file. A token has no flag:
// everybody on the machine sees the arguments of a command.
ClientOptions WithServerFlags(ClientOptions options, const ServerFlags& flags);

// What becomes of the images that a model's materials read with the UV that are replaced.
enum class Textures { kTransfer, kKeep, kDrop };
const char* ToString(Textures textures);  // "transfer", ...

struct TextureArguments {
  Textures textures = Textures::kTransfer;
  std::int64_t memory_mb = 0;  // most that one image may take; 0: half of the machine's
  bool allow_outside = false;
  bool merge_materials = false;
  bool bake_colors = false;
};

enum class Requirement { kUv, kNoOverlap, kNoFlip, kNoMirror, kNoDegenerate, kInTile };
const char* ToString(Requirement requirement);  // "no-overlap", ...

// Of `planish check`.
struct CheckArguments {
  std::set<Requirement> required;
  double max_stretch = 0;      // L2 stretch of any chart, above 1; 0: any
  double min_padding = 0;      // texels between any two charts; 0: any
  bool all_texcoords = false;  // every set of UV that the file has; otherwise Arguments::texcoord
};

// Of `planish unwrap`: what gets an atlas of its own.
enum class AtlasPer { kFile, kMesh, kMaterial, kGroup };
const char* ToString(AtlasPer per);  // "file", ...

struct Arguments {
  Command command = Command::kUnwrap;
  std::string server;  // empty: a private one
  ServerFlags server_flags;
  bool json = false;
  ProgressMode progress = ProgressMode::kAuto;
  bool quiet = false;    // `progress` is kNone then, unless the caller chose one
  bool verbose = false;  // not with `quiet`
  ColorMode color = ColorMode::kAuto;

  // unwrap, pack and inspect; jobs watch has the mesh in `input` if it was given.
  std::string input;
  std::vector<std::string> more_inputs;  // further files
  bool one_atlas = false;                // the files are one mesh and share the atlas
  std::optional<AtlasPer> atlas_per;     // with kFile the files are one mesh, too; not with one_atlas
  // Several files, or a directory, that become a job and an output each (batch_plan.h). The next two are for it only.
  bool batch = false;
  std::string format;                  // of the outputs, as the end of a name: "glb"; empty: that of each input
  bool again = false;                  // redo files that are up to date
  std::string output;                  // a file, "-", or a directory
  int texcoord = 0;                    // glTF: UV are read from TEXCOORD_n, in [0, 7]
  std::optional<int> output_texcoord;  // and become this one; without a value the one they are read from
  TextureArguments textures;
  std::string picture;                 // a PNG of the map; empty: none
  std::string preview;                 // a PNG or SVG of the UV layout; empty: none
  std::string report;      // unwrap: an HTML page about the map (report_page.h); of a batch a sheet; empty: none
  bool sheet = false;      // report: a page per file, and an index of them (report.h)
  std::string job_report;  // report: what `unwrap --json` printed, a file; empty: none
  double view_azimuth = 35, view_elevation = 17;  // of the picture, degrees
  UnwrapOptions options;                          // seams and hard_edge_degrees as in `seams`
  SeamList seams;
  bool keep_density = false;                       // pack; texture_size, padding and tiles are those of `options`
  std::map<std::string, double> material_weights;  // unwrap and pack: times the texels per length, in [0.01, 100]
  CheckArguments check;
  bool project = false;     // transfer: between surfaces that only lie close
  double cage_percent = 1;  // of that, in hundredths of TO's diagonal
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

// Flags go over the environment, and that over the configuration file: the one that PLANISH_CONFIG names, otherwise
// planish.toml in $XDG_CONFIG_HOME or ~/.config. It is TOML: the names of flags without dashes, for every command that
// has such a flag, or in the section of a command for that one ([unwrap], [jobs.list]).
ParsedArguments ParseArguments(int argc, const char* const* argv);

}  // namespace planish::cli
