#include "client/cli/arguments_check.h"

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
std::string CheckAtlas(const UnwrapOptions& options) {
  if (options.max_stretch != 0 && options.seams != Seams::kAuto) {
    return std::string("--max-stretch is what --seams=auto cuts by; with the policy ") + ToString(options.seams) +
           " no seam is added for stretch (name auto beside the sources, as in --seams=auto,uv)";
  }
  if (!options.pack &&
      (options.texture_size != 0 || options.padding || options.tiles != 0 || options.effort != Effort::kNormal)) {
    return "--pack=off leaves charts as they are, so --texture-size, --padding, --tiles and --effort have no effect";
  }
  return "";
}

// "For example: planish unwrap in.stl -o in_uv.obj (or -o - for stdout)"
std::string OutputExample(const std::string& command, const std::string& input) {
  const std::size_t dot = std::min(input.rfind('.'), input.size());
  const std::string extension = input.substr(dot);
  return "For example: planish " + command + " " + input + " -o " + input.substr(0, dot) + "_uv" +
         (extension == ".stl" || extension.empty() ? ".obj" : extension) + " (or -o - for stdout)";
}

bool IsDirectory(const std::string& path) {
  std::error_code ignored;
  return std::filesystem::is_directory(path, ignored);
}

// What a batch cannot do; empty if all is well.
std::string CheckBatch(const Arguments& arguments) {
  if (arguments.output.empty()) return "where should the results go? A batch needs -o DIRECTORY/";
  if (arguments.output == "-") return "-o - takes one mesh; a batch needs -o DIRECTORY/";
  if (!arguments.picture.empty() || !arguments.preview.empty() || !arguments.report.empty()) {
    return "--picture, --preview and --report draw one mesh; in a batch there is no telling which";
  }
  if (!arguments.seams.edge_files.empty() || !arguments.seams.uncut_files.empty()) {
    return "--seams=edges:FILE and uncut:FILE list the vertices of one mesh; a batch cannot use them";
  }
  return "";
}

// What has to do with several files.
std::string CheckInputs(Arguments& arguments) {
  std::vector<std::string> inputs = {arguments.input};
  inputs.insert(inputs.end(), arguments.more_inputs.begin(), arguments.more_inputs.end());
  const auto directory = std::find_if(inputs.begin(), inputs.end(), IsDirectory);
  if (arguments.one_atlas) {
    if (directory != inputs.end()) return "--one-atlas takes files; " + *directory + " is a directory";
    if (inputs.size() > 1 && arguments.output.empty() && !arguments.detach) {
      return "where should the results go? Several files need -o DIRECTORY/";
    }
  }
  arguments.batch = !arguments.one_atlas && (inputs.size() > 1 || directory != inputs.end());
  if (arguments.batch) return CheckBatch(arguments);
  if (!arguments.format.empty()) return "--format is for batches; the name after -o says the format of one file";
  if (arguments.again) return "--again is for batches; one file is always done again";
  return "";
}

}  // namespace

std::string CheckTogether(Arguments& arguments) {
  if (arguments.command == Command::kUnwrap) {
    if (const std::string problem = CheckInputs(arguments); !problem.empty()) return problem;
  }
  const bool judges_several = arguments.command == Command::kCheck && !arguments.more_inputs.empty();
  if (arguments.texcoord > 0 && !judges_several && !arguments.batch && !arguments.input.empty() &&
      !IsGltf(arguments.input)) {
    return "--texcoord=" + std::to_string(arguments.texcoord) + ": " + arguments.input +
           " is no glTF; other formats have one set of UV, number 0";
  }
  if (!arguments.preview.empty() && !arguments.preview.ends_with(".png") && !arguments.preview.ends_with(".svg")) {
    return "--preview=" + arguments.preview + ": the name must end in .png or .svg";
  }
  if (!arguments.job.empty() && arguments.job.rfind("jobs/", 0) != 0) arguments.job = "jobs/" + arguments.job;
  const bool to_stdout = arguments.output == "-";
  if (to_stdout && arguments.json) {
    return "-o - and --json both want stdout; write the mesh to a file, or leave --json out";
  }
  switch (arguments.command) {
    case Command::kUnwrap:
      if (const std::string problem = CheckAtlas(arguments.options); !problem.empty()) return problem;
      if (arguments.detach && arguments.server.empty()) {
        return "--detach needs --server (or PLANISH_SERVER): a private server ends with this command, and the job "
               "with it";
      }
      if (arguments.batch) return "";
      if (arguments.detach && !arguments.more_inputs.empty()) {
        return "--detach with --one-atlas takes one file: jobs watch could not write the UV of several";
      }
      if (arguments.detach && !(arguments.preview.empty() && arguments.picture.empty() && arguments.report.empty())) {
        return "--detach does not wait for UV, so there is nothing to draw; jobs watch JOB --mesh IN -o OUT takes "
               "--preview too";
      }
      if (arguments.detach && !arguments.output.empty()) {
        return "--detach does not wait for UV, so there is nothing for -o; fetch them later with: planish jobs watch "
               "JOB --mesh " +
               arguments.input + " -o " + arguments.output;
      }
      if (!arguments.detach && arguments.output.empty()) {
        return "where should the result go? " + OutputExample("unwrap", arguments.input);
      }
      return "";
    case Command::kPack: {
      if (arguments.output.empty()) return "where should the result go? " + OutputExample("pack", arguments.input);
      const int size = arguments.options.texture_size != 0 ? arguments.options.texture_size : 1024;
      const int padding = arguments.options.padding.value_or(2);
      if (2 * ((padding + 1) / 2) >= size) {
        return "--padding=" + std::to_string(padding) + " leaves no room in a tile of " + std::to_string(size) +
               " texels";
      }
      return "";
    }
    case Command::kEstimate:
      if (arguments.input.empty() == (arguments.triangles == 0)) {
        return "estimate what? Give a mesh file, or --triangles=N";
      }
      return "";
    case Command::kHealth:
      if (!arguments.health_url.starts_with("http://") || arguments.health_url.find('/', 7) == std::string::npos) {
        return "health asks an URL such as http://127.0.0.1:9741/readyz, not " + arguments.health_url;
      }
      return "";
    case Command::kAdminDrain:
    case Command::kAdminUndrain:
    case Command::kAdminStats:
    case Command::kAdminConfig:
      return arguments.server.empty() ? "admin is about a server: give --server=ADDR or set PLANISH_SERVER" : "";
    case Command::kReport:
      if (arguments.output.empty())
        return "where should the page go? planish report " + arguments.input + " -o report.html";
      if (arguments.more_inputs.size() > 1) return "report compares two files at most";
      return "";
    case Command::kCheck:
    case Command::kInspect:
    case Command::kVersion:
      return "";
    case Command::kJobsWatch:
      if (arguments.input.empty() != arguments.output.empty()) {
        return "--mesh and -o go together: the UV go into a copy of the file that was sent";
      }
      if (!arguments.preview.empty() && arguments.input.empty()) {
        return "--preview draws the UV on the file that was sent: name it with --mesh, and -o for the result";
      }
      [[fallthrough]];
    default:
      if (arguments.server.empty()) return "jobs live on a server: give --server=ADDR or set PLANISH_SERVER";
      return "";
  }
}

}  // namespace planish::cli
