#include "client/cli/batch_plan.h"

#include <algorithm>
#include <filesystem>
#include <optional>
#include <set>
#include <system_error>
#include <utility>

#include "client/cli/numbers.h"
#include "client/files/mesh_file.h"

namespace planish::cli {
namespace {

namespace fs = std::filesystem;

Error Conflict(const std::string& message) {
  return Error(ErrorCode::kInvalidArgument, "BATCH_OUTPUT_CONFLICT", message);
}

// The path that all names of a file share, as far as it exists.
fs::path Canonical(const fs::path& path) {
  std::error_code error;
  const fs::path canonical = fs::weakly_canonical(path, error);
  return error ? fs::absolute(path).lexically_normal() : canonical;
}

class Planner {
 public:
  explicit Planner(const Arguments& arguments) : arguments_(arguments), output_(Canonical(arguments.output)) {}

  BatchPlan Plan() {
    std::error_code ignored;
    if (fs::exists(arguments_.output, ignored) && !fs::is_directory(arguments_.output, ignored)) {
      throw Error(ErrorCode::kInvalidArgument, "BATCH_OUTPUT_UNSUPPORTED",
                  "-o " + arguments_.output + " is no directory; a batch needs one");
    }
    Add(arguments_.input);
    for (const std::string& input : arguments_.more_inputs) Add(input);
    if (plan_.items.empty()) {
      throw Error(ErrorCode::kInvalidArgument, "BATCH_EMPTY",
                  "there is no mesh file (.obj, .ply, .off, .stl, .gltf, .glb or .drc) in " + arguments_.input +
                      (arguments_.more_inputs.empty() ? "" : " and what else was named"));
    }
    CheckConflicts();
    return std::move(plan_);
  }

 private:
  void Add(const std::string& input) {
    std::error_code ignored;
    if (!fs::is_directory(input, ignored)) return AddFile(input, fs::path(input).filename());
    if (Canonical(input) == output_) {
      throw Conflict(arguments_.output + " is searched for inputs as well; give -o another directory");
    }
    std::vector<std::pair<fs::path, fs::path>> files;  // path, place below `input`
    Walk(input, "", &files);
    std::sort(files.begin(), files.end(), [](const auto& a, const auto& b) { return a.second < b.second; });
    for (const auto& [path, place] : files) AddFile(path, place);
  }

  void Walk(const fs::path& directory, const fs::path& place, std::vector<std::pair<fs::path, fs::path>>* files) {
    std::error_code error;
    fs::directory_iterator entry(directory, error);
    for (; !error && entry != fs::directory_iterator(); entry.increment(error)) {
      const fs::path path = entry->path(), name = path.filename();
      std::error_code ignored;
      const bool is_directory = entry->is_directory(ignored);
      if (name.native().front() == '.') {
        ++plan_.skipped["hidden"];
      } else if (is_directory && Canonical(path) == output_) {
        ++plan_.skipped["output directory"];
      } else if (is_directory && entry->is_symlink(ignored)) {
        ++plan_.skipped["link to a directory"];  // which may lead back to where we are
      } else if (is_directory) {
        Walk(path, place / name, files);
      } else if (FormatOfPath(name.string())) {
        files->emplace_back(path, place / name);
      } else {
        ++plan_.skipped[name.has_extension() ? name.extension().string() : "without extension"];
      }
    }
    if (!error) return;
    BatchItem item;
    item.name = (place.empty() ? directory : place).generic_string() + "/";
    item.input = directory.string();
    item.problem.emplace(ErrorCode::kPermissionDenied, "FILE_UNREADABLE",
                         directory.string() + ": cannot be searched: " + error.message());
    plan_.items.push_back(item);
  }

  void AddFile(const fs::path& path, const fs::path& place) {
    BatchItem item;
    item.name = place.generic_string();
    item.input = path.string();
    const std::optional<MeshFormat> format = FormatOfPath(item.input);
    fs::path target = place;
    std::error_code error;
    if (!format && !fs::exists(path, error)) {
      item.name = item.input;
      item.problem.emplace(ErrorCode::kNotFound, "FILE_UNREADABLE", item.input + ": there is no such file");
    } else if (!format) {
      item.problem.emplace(ErrorCode::kInvalidArgument, "FILE_FORMAT_UNKNOWN",
                           item.input + ": the name does not end in .obj, .ply, .off, .stl, .gltf, .glb or .drc");
    } else if (!arguments_.format.empty() && FormatOfPath("x." + arguments_.format) != format) {
      target.replace_extension(arguments_.format);
    } else if (format == MeshFormat::kStl) {
      target.replace_extension("obj");
    }
    item.key = target.generic_string();
    item.output = (fs::path(arguments_.output) / target).string();
    if (format == MeshFormat::kGltf || format == MeshFormat::kGlb) item.texcoord = arguments_.texcoord;
    const std::uintmax_t bytes = fs::file_size(path, error);
    if (!error) item.bytes = static_cast<std::int64_t>(bytes);
    plan_.items.push_back(item);
  }

  void CheckConflicts() const {
    std::map<fs::path, const BatchItem*> inputs;
    for (const BatchItem& item : plan_.items) {
      if (!item.problem) inputs.emplace(Canonical(item.input), &item);
    }
    std::map<std::string, const BatchItem*> outputs;
    for (const BatchItem& item : plan_.items) {
      if (item.problem) continue;
      const auto [other, is_new] = outputs.emplace(item.key, &item);
      if (!is_new) {
        throw Conflict(other->second->input + " and " + item.input + " would both become " + item.output +
                       "; give them different names, or run them into different directories");
      }
      if (inputs.contains(Canonical(item.output))) {
        throw Conflict(item.output + " is an input as well; give -o another directory");
      }
    }
  }

  const Arguments& arguments_;
  const fs::path output_;
  BatchPlan plan_;
};

}  // namespace

BatchPlan PlanBatch(const Arguments& arguments) {
  return Planner(arguments).Plan();
}

std::string SkippedText(const BatchPlan& plan) {
  std::string text;
  for (const auto& [kind, count] : plan.skipped) text += (text.empty() ? "" : ", ") + WithCommas(count) + " " + kind;
  return text.empty() ? "" : "Skipped in directories: " + text + ".\n";
}

}  // namespace planish::cli
