#include "tests/house/include_rules.h"

#include <algorithm>
#include <optional>
#include <regex>
#include <set>

namespace planish::house {
namespace {

struct Include {
  std::string target;
  bool quoted = false;
};

// What a file of `folder` may include from this repository. The longest folder that contains the file counts.
struct Layer {
  std::string folder;
  std::vector<std::string> may_include;
};

const std::vector<Layer>& Layers() {
  static const auto* layers = new std::vector<Layer>{
      {"core/base", {"core/base"}},
      {"core/mesh", {"core/base", "core/mesh"}},
      {"core/linalg", {"core/base", "core/linalg"}},
      {"core/abf", {"core/base", "core/mesh", "core/linalg", "core/abf"}},
      {"core/charts", {"core/base", "core/mesh", "core/charts"}},
      {"core/pack", {"core/base", "core/mesh", "core/pack"}},
      {"core/unwrap", {"core/base", "core/mesh", "core/linalg", "core/abf", "core/charts", "core/pack", "core/unwrap"}},
      {"core/draco", {"core/base", "core/mesh", "core/draco"}},
      {"server/config", {"server/config"}},
      {"server/log", {"server/log"}},
      {"server/link", {"core/base", "proto", "server/link"}},
      {"server/access", {"core/base", "proto", "server/access"}},
      {"server/blobs", {"core/base", "server/link", "server/access", "server/blobs"}},
      {"server/store", {"core/base", "proto", "server/link", "server/access", "server/blobs", "server/store"}},
      {"server/jobs",
       {"core/base", "proto", "server/link", "server/access", "server/blobs", "server/store", "server/jobs"}},
      {"server/worker", {"core", "proto", "server/link", "server/worker"}},
      {"server/rpc",
       {"core/base", "proto", "server/link", "server/access", "server/blobs", "server/store", "server/jobs",
        "server/rpc"}},
      {"server/metrics",
       {"core/base", "proto", "server/link", "server/access", "server/blobs", "server/store", "server/jobs",
        "server/metrics"}},
      {"server", {"core/base", "proto", "server"}},
      {"client/include/planish", {"client/include/planish"}},
      {"client/texture", {"core/base", "core/mesh", "client/texture"}},
      {"client/files", {"core/base", "core/mesh", "core/draco", "client/texture", "client/files"}},
      {"client/pictures", {"core/base", "core/mesh", "client/files", "client/pictures"}},
      {"client/src", {"core/base", "core/mesh", "core/draco", "proto", "client/include/planish", "client/src"}},
      // The command stands on the public headers; of the library's inside it shares only helpers that know no server.
      // `planish pack` solves nothing and asks no server, so the packer is its own; nor does `planish check`,
      // which has the judge of maps.
      {"client/cli",
       {"core/base", "core/mesh", "core/pack", "core/unwrap/chart_spacing.h", "core/unwrap/map_check.h",
        "core/unwrap/verify.h", "client/texture", "client/files", "client/pictures", "client/include/planish", "client/cli",
        "client/src/errors.h"}},
      {"proto", {"proto"}},
      {"deploy/packages", {}},
      {"tests", {"core", "proto", "server", "client", "tests"}},
  };
  return *layers;
}

// Headers from elsewhere that only some folders may include.
struct External {
  std::regex header;
  std::string what;
  std::vector<std::string> only_in;
};

const std::vector<External>& Externals() {
  static const auto* externals = new std::vector<External>{
      {std::regex(R"(^(grpc|grpcpp|grpc\+\+)/.*|.*\.grpc\.pb\.h$)"),
       "gRPC",
       {"server/rpc", "server/daemon.cc", "client/src", "tests"}},
      {std::regex(R"(^google/protobuf/.*)"), "protobuf", {"server", "client/src", "proto", "tests"}},
      {std::regex(R"(^draco/.*)"), "Draco", {"core/draco", "tests"}},
      {std::regex(R"(^meshoptimizer\.h$)"), "meshoptimizer", {"core/mesh/near_symmetry.cc", "client/files", "tests"}},
      {std::regex(R"(^(jpeglib\.h|jerror\.h|webp/.*)$)"), "libjpeg and libwebp", {"client/texture", "tests/texture"}},
      {std::regex(R"(^utf8proc\.h$)"), "utf8proc", {"client/cli/text.cc"}},
      {std::regex(R"(^OpenMesh/.*)"), "OpenMesh", {"core/mesh/tri_mesh.h"}},
      {std::regex(R"(^(suitesparse/.*|cholmod.*\.h|cblas.*\.h|omp\.h)$)"), "BLAS, CHOLMOD and OpenMP", {}},
      {std::regex(R"(^spdlog/.*)"), "spdlog", {"server/log"}},
      {std::regex(R"(^yaml-cpp/.*)"), "yaml-cpp", {"server", "tests"}},
      {std::regex(R"(^seccomp\.h$)"), "libseccomp", {"server/worker"}},
      {std::regex(R"(^(sqlite3|libpq-fe|libpq/.*)\.h$)"), "SQLite and libpq", {"server/store"}},
      {std::regex(R"(^(curl/.*|expat\.h)$)"), "libcurl and Expat", {"server/blobs"}},
      {std::regex(R"(^(httplib\.h|prometheus/.*)$)"),
       "HTTP and Prometheus",
       {"server/metrics", "client/cli/health_command.cc", "tests"}},
      // The library but for its private server is bound to no system.
      {std::regex(R"(^((sys|linux|netinet|arpa)/.*|(dlfcn|fcntl|netdb|poll|pthread|signal|spawn|unistd)\.h)$)"),
       "headers of the system",
       {"core", "server", "client/src/private_server.cc", "client/cli", "client/files",
        "deploy", "tests"}},
      {std::regex(R"(^(sys/(socket|un)\.h|netinet/.*|arpa/.*|netdb\.h)$)"), "sockets", {"server", "client", "tests"}},
  };
  return *externals;
}

bool IsWithin(const std::string& path, const std::string& folder) {
  return path == folder || path.starts_with(folder + "/");
}

bool IsWithinAny(const std::string& path, const std::vector<std::string>& folders) {
  return std::any_of(folders.begin(), folders.end(), [&](const std::string& f) { return IsWithin(path, f); });
}

const Layer* LayerOf(const std::string& path) {
  const Layer* best = nullptr;
  for (const Layer& layer : Layers()) {
    if (IsWithin(path, layer.folder) && (best == nullptr || layer.folder.size() > best->folder.size())) best = &layer;
  }
  return best;
}

// Path within the repository of what an #include names: a source, "proto" and more for a generated header, or nothing
// for headers from elsewhere.
std::optional<std::string> ProjectPath(const std::string& target) {
  for (const char* top : {"core", "server", "client", "tests"}) {
    if (IsWithin(target, top)) return target;
  }
  for (const char* generated : {"planish/v1", "planish/admin", "planish/store", "planish/worker", "google/rpc"}) {
    if (IsWithin(target, generated)) return "proto/" + target;
  }
  if (IsWithin(target, "planish")) return "client/include/" + target;
  return std::nullopt;
}

std::optional<Include> ParseInclude(const std::string& line) {
  static const auto* pattern = new std::regex(R"(^\s*#\s*include\s*([<"])([^>"]+)[>"].*)");
  std::smatch match;
  if (!std::regex_match(line, match, *pattern)) return std::nullopt;
  return Include{match[2], match[1] == "\""};
}

// The public headers see the standard library and each other, nothing else: a standard header has no '/' and no '.'.
bool IsStandardHeader(const Include& include) {
  return !include.quoted && include.target.find_first_of("/.") == std::string::npos;
}

std::optional<std::string> BrokenRule(const std::string& file, const Include& include,
                                      const std::set<std::string>& existing) {
  const Layer* layer = LayerOf(file);
  if (layer == nullptr) return "no rule says what this folder may include: add it to tests/house/include_rules.cc";
  for (const External& external : Externals()) {
    if (std::regex_match(include.target, external.header) && !IsWithinAny(file, external.only_in)) {
      return layer->folder + " must not include " + external.what + " (" + include.target + ")";
    }
  }
  const std::optional<std::string> target = ProjectPath(include.target);
  if (target) {
    if (!IsWithinAny(*target, layer->may_include)) return layer->folder + " must not include " + include.target;
    if (!IsWithin(*target, "proto") && !existing.contains(*target)) return "there is no " + include.target;
    return std::nullopt;
  }
  if (layer->folder == "client/include/planish" && !IsStandardHeader(include)) {
    return layer->folder + " may include the standard library only, not " + include.target;
  }
  if (include.quoted && include.target.find('/') == std::string::npos) {
    return include.target + ": paths start at the root of the repository";
  }
  return std::nullopt;
}

}  // namespace

std::vector<std::string> FindBrokenRules(const std::vector<SourceFile>& files, const std::vector<SourceFile>& all) {
  std::set<std::string> existing;
  for (const SourceFile& file : all) existing.insert(file.path);
  std::vector<std::string> broken;
  for (const SourceFile& file : files) {
    const std::vector<std::string> lines = Lines(file.text);
    for (std::size_t i = 0; i < lines.size(); ++i) {
      const std::optional<Include> include = ParseInclude(lines[i]);
      if (!include) continue;
      if (const std::optional<std::string> rule = BrokenRule(file.path, *include, existing)) {
        broken.push_back(file.path + ":" + std::to_string(i + 1) + ": " + *rule);
      }
    }
  }
  return broken;
}

}  // namespace planish::house
