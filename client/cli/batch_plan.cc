#include "client/cli/batch_plan.h"

#include <fcntl.h>
#include <sys/file.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <charconv>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <optional>
#include <set>
#include <sstream>
#include <system_error>
#include <utility>
#include <vector>

#include "absl/strings/escaping.h"
#include "client/cli/field_json.h"
#include "client/cli/results.h"
#include "client/cli/text.h"
#include "client/cli/unwrap_arguments.h"
#include "client/files/file_io.h"
#include "client/files/mesh_file.h"
#include "client/files/mesh_output.h"
#include "client/src/errors.h"
#include "core/base/sha256.h"
#include "planish/error.h"

namespace planish::cli {
namespace {

namespace fs = std::filesystem;

Error Conflict(const std::string& message) {
  return Error(ErrorCode::kInvalidArgument, "BATCH_OUTPUT_CONFLICT", message);
}

// The absolute path, with symbolic links resolved as far as the path exists.
fs::path Canonical(const fs::path& path) {
  std::error_code error;
  const fs::path canonical = fs::weakly_canonical(path, error);
  return error ? fs::absolute(path).lexically_normal() : canonical;
}

class Planner {
 public:
  explicit Planner(const BatchFiles& files) : files_(files), output_(Canonical(files.output)) {}

  BatchPlan Plan() {
    std::error_code ignored;
    if (fs::exists(files_.output, ignored) && !fs::is_directory(files_.output, ignored)) {
      throw Error(ErrorCode::kInvalidArgument, "BATCH_OUTPUT_UNSUPPORTED",
                  "-o " + files_.output + " is no directory; a batch needs one");
    }
    for (const std::string& input : files_.inputs) Add(input);
    if (plan_.items.empty()) {
      throw Error(ErrorCode::kInvalidArgument, "BATCH_EMPTY",
                  "there is no mesh file (.obj, .ply, .off, .stl, .gltf, .glb or .drc) in " + files_.inputs.front() +
                      (files_.inputs.size() == 1 ? "" : " and what else was named"));
    }
    CheckConflicts();
    return std::move(plan_);
  }

 private:
  void Add(const std::string& input) {
    std::error_code ignored;
    if (!fs::is_directory(input, ignored)) return AddFile(input, fs::path(input).filename());
    if (Canonical(input) == output_) {
      throw Conflict(files_.output + " is searched for inputs as well; give -o another directory");
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
        ++plan_.skipped["link to a directory"];  // following it might never end
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
    } else if (!files_.format.empty() && FormatOfPath("x." + files_.format) != format) {
      target.replace_extension(files_.format);
    } else if (format == MeshFormat::kStl) {
      target.replace_extension("obj");
    }
    item.key = target.generic_string();
    item.output = (fs::path(files_.output) / target).string();
    if (format == MeshFormat::kGltf || format == MeshFormat::kGlb) item.texcoord = files_.texcoord;
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

  const BatchFiles& files_;
  const fs::path output_;
  BatchPlan plan_;
};

}  // namespace

BatchPlan PlanBatch(const BatchFiles& files) {
  return Planner(files).Plan();
}

std::string SkippedText(const BatchPlan& plan) {
  std::string text;
  for (const auto& [kind, count] : plan.skipped) text += (text.empty() ? "" : ", ") + WithCommas(count) + " " + kind;
  return text.empty() ? "" : "Skipped in directories: " + text + ".\n";
}

namespace {

std::string Hexadecimal(const std::string& bytes) {
  return absl::BytesToHexString(Sha256(bytes));
}

// Decodes "a%20b.bin" to "a b.bin".
std::string PercentDecoded(const std::string& uri) {
  std::string text;
  for (std::size_t i = 0; i < uri.size(); ++i) {
    unsigned char byte = 0;
    const char* const digits = uri.data() + i + 1;
    if (uri[i] == '%' && i + 2 < uri.size() && std::from_chars(digits, digits + 2, byte, 16).ptr == digits + 2) {
      text += static_cast<char>(byte);
      i += 2;
    } else {
      text += uri[i];
    }
  }
  return text;
}

// The JSON text of a .gltf or .glb file; empty if a .glb is too short.
std::string_view GltfText(std::string_view bytes) {
  if (!bytes.starts_with("glTF")) return bytes;
  if (bytes.size() < 20) return "";
  std::size_t size = 0;
  for (std::size_t i = 4; i-- > 0;) size = size << 8 | static_cast<unsigned char>(bytes[12 + i]);
  return bytes.substr(20, std::min(size, bytes.size() - 20));
}

// The external files of buffers and images of a glTF, relative to its folder.
std::vector<std::string> FilesOfGltf(const std::string& bytes) {
  std::vector<std::string> files;
  const std::string_view text = GltfText(bytes);
  const Json json = Json::parse(text.begin(), text.end(), nullptr, false);
  for (const char* list : {"buffers", "images"}) {
    if (!json.is_object() || !json.contains(list) || !json[list].is_array()) continue;
    for (const Json& element : json[list]) {
      if (!element.is_object() || !element.contains("uri") || !element["uri"].is_string()) continue;
      const std::string uri = element["uri"].get<std::string>();
      if (!uri.starts_with("data:")) files.push_back(PercentDecoded(uri));
    }
  }
  return files;
}

}  // namespace

std::string FileDigest(const std::string& path) {
  const absl::StatusOr<std::string> bytes = ReadWholeFile(path);
  return bytes.ok() ? Hexadecimal(*bytes) : "";
}

std::string InputDigest(const std::string& path) {
  const absl::StatusOr<std::string> bytes = ReadWholeFile(path);
  if (!bytes.ok()) throw ErrorFrom(bytes.status());
  std::string digest = Hexadecimal(*bytes);
  std::vector<std::string> files;
  const std::optional<MeshFormat> format = FormatOfPath(path);
  if (format == MeshFormat::kGltf || format == MeshFormat::kGlb) files = FilesOfGltf(*bytes);
  if (format == MeshFormat::kObj) files = FilesOfObj(path, *bytes);
  std::string all = digest;
  for (const std::string& file : files) {
    all += " " + FileDigest((std::filesystem::path(path).parent_path() / file).string());
  }
  return all == digest ? digest : Hexadecimal(all);
}

std::string SettingsDigest(const UnwrapArguments& arguments) {
  Json options = Json::object();
  EachField(arguments.map.options, [&](const Field& field, const auto& member) {
    if (!field.keeps_result) options[field.name] = FieldJson(field, member);
  });
  const SeamList& seams = arguments.map.seams;
  const Json json = {{"options", options},
                     {"sources", {seams.uv, seams.materials, seams.groups}},
                     {"atlas_per", arguments.map.atlas_per ? ToString(*arguments.map.atlas_per) : ""},
                     {"weights", arguments.map.material_weights},
                     {"texcoord", arguments.texcoord},
                     {"output_texcoord", arguments.output.texcoord.value_or(arguments.texcoord)},
                     {"textures", ToString(arguments.output.textures.textures)},
                     {"merge_materials", arguments.output.textures.merge_materials},
                     {"bake_colors", arguments.output.textures.bake_colors}};
  return Hexadecimal(ToLine(json));
}

namespace {

Error FileError(const char* reason, const std::string& path, const char* what) {
  return Error(ErrorCode::kPermissionDenied, reason,
               path + ": " + what + ": " + std::generic_category().message(errno));
}

const char* StateOf(const BatchRecord& record) {
  if (!record.request_id.empty()) return "asked for";
  if (record.queued) return "queued";
  return record.files.empty() ? "failed" : "done";
}

}  // namespace

std::string ToLine(const BatchRecord& record) {
  Json json = {{"output", record.key},        {"state", StateOf(record)},  {"input", record.input},
               {"settings", record.settings}, {"version", record.version}, {"job", record.job}};
  if (!record.request_id.empty()) {
    json["request_id"] = record.request_id;
    json["server"] = record.server;
  } else if (record.queued) {
    json["server"] = record.server;
  } else {
    json["usable"] = record.usable;
    if (!record.why.empty()) json["why"] = record.why;
    json["triangles"] = record.triangles;
    json["charts"] = record.charts;
    json["seconds"] = record.seconds;
    json["files"] = record.files;
  }
  return ToLine(json);
}

std::optional<BatchRecord> ParseRecord(const std::string& line) {
  const Json json = Json::parse(line, nullptr, false);
  if (!json.is_object()) return std::nullopt;
  BatchRecord record;
  try {
    record.key = json.at("output");
    record.queued = json.at("state") == "queued";
    record.input = json.at("input");
    record.settings = json.at("settings");
    record.version = json.at("version");
    record.job = json.at("job");
    record.request_id = json.value("request_id", "");
    if (record.queued || !record.request_id.empty()) {
      record.server = json.at("server");
      return record;
    }
    record.usable = json.at("usable");
    record.why = json.value("why", "");
    record.triangles = json.at("triangles");
    record.charts = json.at("charts");
    record.seconds = json.at("seconds");
    record.files = json.at("files").get<std::map<std::string, std::string>>();
  } catch (const Json::exception&) {
    return std::nullopt;
  }
  return record;
}

BatchState::BatchState(const std::string& directory)
    : directory_(directory), path_(directory + (directory.ends_with("/") ? "" : "/") + kBatchStateFile) {
  file_ = Descriptor(open(path_.c_str(), O_RDWR | O_CREAT | O_APPEND | O_CLOEXEC, 0666));
  if (file_.get() < 0) throw FileError("FILE_UNWRITABLE", path_, "cannot be opened");
  // Any other error means that the file system has no locks, and is ignored.
  if (flock(file_.get(), LOCK_EX | LOCK_NB) != 0 && errno == EWOULDBLOCK) {
    throw Error(ErrorCode::kFailedPrecondition, "BATCH_RUNNING",
                "another planish is writing into " + directory_ + "; wait for it, or give -o another directory");
  }
  std::ifstream in(path_, std::ios::binary);
  const std::string text{std::istreambuf_iterator<char>(in), {}};
  torn_ = !text.empty() && text.back() != '\n';
  std::istringstream lines(text);
  for (std::string line; std::getline(lines, line);) {
    if (const std::optional<BatchRecord> record = ParseRecord(line)) records_[record->key] = *record;
  }
}

std::optional<BatchRecord> BatchState::Find(const std::string& key) const {
  const std::lock_guard lock(mutex_);
  const auto found = records_.find(key);
  return found == records_.end() ? std::nullopt : std::optional(found->second);
}

void BatchState::Append(const BatchRecord& record) {
  const std::lock_guard lock(mutex_);
  const std::string line = (torn_ ? "\n" : "") + ToLine(record) + "\n";
  // A single write, so that a process that is killed leaves a whole line, the beginning of it, or nothing.
  ssize_t written;
  do {
    written = write(file_.get(), line.data(), line.size());
  } while (written < 0 && errno == EINTR);
  if (written != static_cast<ssize_t>(line.size())) {
    torn_ = torn_ || written > 0;
    if (written >= 0) errno = ENOSPC;
    throw FileError("FILE_UNWRITABLE", path_, "cannot write");
  }
  torn_ = false;
  records_[record.key] = record;
}

bool BatchState::IsIntact(const BatchRecord& record) const {
  if (record.queued || record.files.empty()) return false;
  for (const auto& [file, digest] : record.files) {
    if (FileDigest(directory_ + "/" + file) != digest) return false;
  }
  return true;
}

}  // namespace planish::cli
