#include "client/cli/argument_checks.h"

#include <algorithm>
#include <filesystem>
#include <optional>
#include <system_error>
#include <vector>

#include "client/files/mesh_file.h"

namespace planish::cli {
namespace {

bool IsGltf(const std::string& path) {
  const std::optional<MeshFormat> format = FormatOfPath(path);
  return format == MeshFormat::kGltf || format == MeshFormat::kGlb;
}

// Options without effect beside each other.
std::string CheckAtlas(Arguments& arguments) {
  const UnwrapOptions& options = arguments.options;
  if (options.max_stretch != 0 && options.seams != Seams::kAuto) {
    return std::string("--max-stretch is what --seams=auto cuts by; with the policy ") + ToString(options.seams) +
           " no seam is added for stretch (name auto beside the sources, as in --seams=auto,uv)";
  }
  if (options.prefer != UnwrapOptions().prefer && options.seams != Seams::kAuto) {
    return std::string("--prefer is what --seams=auto cuts for; with the policy ") + ToString(options.seams) +
           " it has no effect (name auto beside the sources, as in --seams=auto,uv)";
  }
  if (!options.pack &&
      (options.texture_size != 0 || options.padding || options.tiles != 0 || options.effort != Effort::kNormal)) {
    return "--pack=off leaves charts as they are, so --texture-size, --padding, --tiles and --effort have no effect";
  }
  return "";
}

// What several atlases, or weights, do not go with.
std::string CheckParts(Arguments& arguments) {
  const UnwrapOptions& options = arguments.options;
  const bool is_stacked = options.atlas_layout == AtlasLayout::kStacked;
  if (is_stacked && !arguments.atlas_per) return "--atlas-layout says where the atlases of --atlas-per go; give both";
  if (is_stacked && !arguments.report.empty()) {
    return "--report shows one texture, and --atlas-layout=stacked makes several that lie one over the other; leave "
           "one "
           "of them out";
  }
  if (!arguments.atlas_per && arguments.material_weights.empty()) return "";
  const std::string flag = arguments.atlas_per ? "--atlas-per" : "--weight";
  if (!options.pack) return flag + " is about charts in an atlas; with --pack=off there is none";
  if (options.seams == Seams::kNone)
    return flag + " needs charts; with --seams=none the mesh is one that fills its tile";
  return "";
}

// "For example: planish unwrap in.stl -o in_uv.obj (or -o - for stdout)"
std::string OutputExample(const std::string& command, const std::string& input) {
  if (input == "-") return "For example: planish " + command + " - -o out.obj (or -o - for stdout)";
  const std::size_t dot = std::min(input.rfind('.'), input.size());
  const std::string extension = input.substr(dot);
  return "For example: planish " + command + " " + input + " -o " + input.substr(0, dot) + "_uv" +
         (extension == ".stl" || extension.empty() ? ".obj" : extension) + " (or -o - for stdout)";
}

bool IsDirectory(const std::string& path) {
  std::error_code ignored;
  return std::filesystem::is_directory(path, ignored);
}

// The names of all input files and directories.
std::vector<std::string> Inputs(const Arguments& arguments) {
  std::vector<std::string> inputs = {arguments.input};
  inputs.insert(inputs.end(), arguments.more_inputs.begin(), arguments.more_inputs.end());
  return inputs;
}

// What a batch cannot do; empty if all is well.
std::string CheckBatch(const Arguments& arguments) {
  if (arguments.output.empty()) return "where should the results go? A batch needs -o DIRECTORY/";
  if (arguments.output == "-") return "-o - takes one mesh; a batch needs -o DIRECTORY/";
  for (const std::string& input : Inputs(arguments)) {
    if (input == "-") return "- (standard input) is one mesh, and cannot be one of a batch";
  }
  if (!arguments.picture.empty() || !arguments.preview.empty()) {
    return "--picture and --preview draw one mesh; of a batch --report=DIR shows all";
  }
  if (!arguments.report.empty() && arguments.detach) {
    return "--detach does not wait for UV, so there is nothing to draw; --report goes with the run that fetches them";
  }
  if (!arguments.seams.edge_files.empty() || !arguments.seams.uncut_files.empty()) {
    return "--seams=edges:FILE and uncut:FILE list the vertices of one mesh; a batch cannot use them";
  }
  return "";
}

// What has to do with several files.
std::string CheckInputs(Arguments& arguments) {
  const std::vector<std::string> inputs = Inputs(arguments);
  const auto directory = std::find_if(inputs.begin(), inputs.end(), IsDirectory);
  const bool per_file = arguments.atlas_per == AtlasPer::kFile;
  if (arguments.one_atlas || per_file) {
    const std::string flag = per_file ? "--atlas-per=file" : "--one-atlas";
    if (directory != inputs.end()) return flag + " takes files; " + *directory + " is a directory";
    if (inputs.size() > 1 && arguments.output.empty() && !arguments.detach) {
      return "where should the results go? Several files need -o DIRECTORY/";
    }
  }
  arguments.batch = !arguments.one_atlas && !per_file && (inputs.size() > 1 || directory != inputs.end());
  if (arguments.batch) return CheckBatch(arguments);
  if (!arguments.format.empty()) return "--format is for batches; the name after -o says the format of one file";
  if (arguments.again) return "--again is for batches; one file is always done again";
  return "";
}

// Whether `report` makes a page of each file, and a sheet.
bool IsSheet(const Arguments& arguments) {
  const std::vector<std::string> inputs = Inputs(arguments);
  return inputs.size() > 2 || IsDirectory(arguments.output) || arguments.output.ends_with('/') ||
         std::any_of(inputs.begin(), inputs.end(), IsDirectory);
}

// What a sheet cannot be made of; empty if all is well.
std::string CheckSheet(const Arguments& arguments) {
  if (arguments.output == "-") return "-o - takes one page; those of many files need -o DIRECTORY/";
  if (!arguments.job_report.empty()) return "--job-report is about one file, and -o about many";
  const std::vector<std::string> inputs = Inputs(arguments);
  if (std::count(inputs.begin(), inputs.end(), "-") > 0) {
    return "- (standard input) is one mesh, and cannot be one of many";
  }
  return "";
}

// ---- What several commands have in common

std::string CheckStreams(Arguments& arguments) {
  const std::vector<std::string> inputs = Inputs(arguments);
  const auto streams = std::count(inputs.begin(), inputs.end(), "-");
  if (streams > 1) return "- (standard input) can be read once only";
  if (streams == 0 || !arguments.check.all_texcoords) return "";
  return "- (standard input) can be read once only; --texcoord=all reads a file once for each set of UV";
}

// Of one file.
std::string CheckTexcoord(Arguments& arguments) {
  if (arguments.texcoord == 0 || arguments.input.empty() || IsStream(arguments.input) || IsGltf(arguments.input)) {
    return "";
  }
  return "--texcoord=" + std::to_string(arguments.texcoord) + ": " + arguments.input +
         " is no glTF; other formats have one set of UV, number 0";
}

std::string CheckPreview(Arguments& arguments) {
  if (arguments.preview.empty() || arguments.preview.ends_with(".png") || arguments.preview.ends_with(".svg")) {
    return "";
  }
  return "--preview=" + arguments.preview + ": the name must end in .png or .svg";
}

std::string CheckStdout(Arguments& arguments) {
  if (arguments.output != "-" || !arguments.json) return "";
  return "-o - and --json both want stdout; write the mesh to a file, or leave --json out";
}

std::string CheckPainting(Arguments& arguments) {
  if (arguments.textures.textures == Textures::kTransfer) return "";
  const std::string given = std::string("--textures=") + ToString(arguments.textures.textures);
  if (arguments.textures.merge_materials) return "--merge-materials draws images anew, and " + given + " does not";
  if (arguments.textures.bake_colors) return "--bake draws an image, and " + given + " draws none";
  return "";
}

std::string CheckDestination(const Arguments& arguments, const std::string& command) {
  if (!arguments.output.empty()) return "";
  return "where should the result go? " + OutputExample(command, arguments.input);
}

// ---- A command each

std::string CheckDetach(Arguments& arguments) {
  if (arguments.detach && arguments.server.empty()) {
    return "--detach needs --server (or PLANISH_SERVER): a private server ends with this command, and the job with it";
  }
  if (arguments.batch) return "";
  if (!arguments.detach) return CheckDestination(arguments, "unwrap");
  if (!arguments.more_inputs.empty()) {
    return "--detach takes one file where several are one job (--one-atlas, --atlas-per=file): jobs watch could not "
           "write the UV of several";
  }
  if (!(arguments.preview.empty() && arguments.picture.empty() && arguments.report.empty())) {
    return "--detach does not wait for UV, so there is nothing to draw; jobs watch JOB --mesh IN -o OUT takes "
           "--preview too";
  }
  if (arguments.output.empty()) return "";
  return "--detach does not wait for UV, so there is nothing for -o; fetch them later with: planish jobs watch JOB "
         "--mesh " +
         arguments.input + " -o " + arguments.output;
}

std::string CheckTexcoordOfUnwrap(Arguments& arguments) {
  return arguments.batch ? "" : CheckTexcoord(arguments);
}

std::string CheckPack(Arguments& arguments) {
  if (const std::string problem = CheckDestination(arguments, "pack"); !problem.empty()) return problem;
  const int size = arguments.options.texture_size != 0 ? arguments.options.texture_size : 1024;
  const int padding = arguments.options.padding.value_or(2);
  if (2 * ((padding + 1) / 2) < size) return "";
  return "--padding=" + std::to_string(padding) + " leaves no room in a tile of " + std::to_string(size) + " texels";
}

std::string CheckTransfer(Arguments& arguments) {
  if (arguments.project && (arguments.textures.merge_materials || arguments.textures.bake_colors)) {
    return "--project makes one material with the colours of FROM; leave --merge-materials and --bake out";
  }
  return CheckDestination(arguments, "transfer");
}

std::string CheckTexcoordOfCheck(Arguments& arguments) {
  return arguments.more_inputs.empty() ? CheckTexcoord(arguments) : "";
}

std::string CheckReport(Arguments& arguments) {
  arguments.sheet = IsSheet(arguments);
  if (const std::string problem = CheckStreams(arguments); !problem.empty()) return problem;
  if (!arguments.sheet) {
    if (const std::string problem = CheckTexcoord(arguments); !problem.empty()) return problem;
  }
  if (arguments.output.empty()) {
    return "where should the page go? planish report " + arguments.input + " -o report.html";
  }
  return arguments.sheet ? CheckSheet(arguments) : "";
}

std::string CheckEstimate(Arguments& arguments) {
  if (arguments.input.empty() != (arguments.triangles == 0)) return "";
  return "estimate what? Give a mesh file, or --triangles=N";
}

std::string CheckHealth(Arguments& arguments) {
  const std::string& url = arguments.health_url;
  if (url.starts_with("http://") && url.find('/', 7) != std::string::npos) return "";
  return "health asks an URL such as http://127.0.0.1:9741/readyz, not " + url;
}

std::string CheckAdmin(Arguments& arguments) {
  return arguments.server.empty() ? "admin is about a server: give --server=ADDR or set PLANISH_SERVER" : "";
}

std::string CheckJobs(Arguments& arguments) {
  if (!arguments.job.empty() && arguments.job.rfind("jobs/", 0) != 0) arguments.job = "jobs/" + arguments.job;
  return arguments.server.empty() ? "jobs live on a server: give --server=ADDR or set PLANISH_SERVER" : "";
}

std::string CheckWatch(Arguments& arguments) {
  if (arguments.input.empty() != arguments.output.empty()) {
    return "--mesh and -o go together: the UV go into a copy of the file that was sent";
  }
  if (arguments.preview.empty() || !arguments.input.empty()) return "";
  return "--preview draws the UV on the file that was sent: name it with --mesh, and -o for the result";
}

using Check = std::string (*)(Arguments&);

// In the order in which problems are named.
std::vector<Check> ChecksOf(Command command) {
  switch (command) {
    case Command::kUnwrap:
      return {CheckInputs, CheckStreams, CheckTexcoordOfUnwrap, CheckPreview, CheckStdout, CheckPainting, CheckAtlas,
              CheckParts,  CheckDetach};
    case Command::kPack:
      return {CheckTexcoord, CheckPreview, CheckStdout, CheckPainting, CheckPack};
    case Command::kTransfer:
      return {CheckStreams, CheckStdout, CheckTransfer};
    case Command::kCheck:
      return {CheckStreams, CheckTexcoordOfCheck};
    case Command::kReport:
      return {CheckReport};
    case Command::kInspect:
      return {CheckTexcoord};
    case Command::kEstimate:
      return {CheckEstimate};
    case Command::kHealth:
      return {CheckHealth};
    case Command::kAdminDrain:
    case Command::kAdminUndrain:
    case Command::kAdminStats:
    case Command::kAdminConfig:
      return {CheckAdmin};
    case Command::kJobsWatch:
      return {CheckTexcoord, CheckPreview, CheckStdout, CheckPainting, CheckWatch, CheckJobs};
    case Command::kJobsList:
    case Command::kJobsShow:
    case Command::kJobsStop:
    case Command::kJobsCancel:
    case Command::kJobsDelete:
      return {CheckJobs};
    case Command::kVersion:
      return {};
  }
  return {};
}

}  // namespace

std::string CheckTogether(Arguments& arguments) {
  for (const Check check : ChecksOf(arguments.command)) {
    if (const std::string problem = check(arguments); !problem.empty()) return problem;
  }
  return "";
}

}  // namespace planish::cli
