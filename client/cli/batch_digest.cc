#include "client/cli/batch_digest.h"

#include <charconv>
#include <filesystem>
#include <vector>

#include "absl/strings/escaping.h"
#include "client/cli/json.h"
#include "client/files/file_io.h"
#include "client/files/mesh_file.h"
#include "client/src/errors.h"
#include "core/base/sha256.h"

namespace planish::cli {
namespace {

std::string Hexadecimal(const std::string& bytes) {
  return absl::BytesToHexString(Sha256(bytes));
}

// "a%20b.bin" as "a b.bin".
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

// The files that the buffers of a glTF lie in, as it spells them.
std::vector<std::string> BufferFiles(const std::string& gltf) {
  std::vector<std::string> files;
  const Json json = Json::parse(gltf, nullptr, false);
  if (!json.is_object() || !json.contains("buffers") || !json["buffers"].is_array()) return files;
  for (const Json& buffer : json["buffers"]) {
    if (!buffer.is_object() || !buffer.contains("uri") || !buffer["uri"].is_string()) continue;
    const std::string uri = buffer["uri"].get<std::string>();
    if (!uri.starts_with("data:")) files.push_back(uri);
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
  if (FormatOfPath(path) != MeshFormat::kGltf) return digest;
  std::string all = digest;
  for (const std::string& uri : BufferFiles(*bytes)) {
    all += " " + FileDigest((std::filesystem::path(path).parent_path() / PercentDecoded(uri)).string());
  }
  return all == digest ? digest : Hexadecimal(all);
}

std::string SettingsDigest(const Arguments& arguments) {
  const UnwrapOptions& options = arguments.options;
  const SeamList& seams = arguments.seams;
  const Json json = {{"seams", ToString(options.seams)},
                     {"hard", options.hard_edge_degrees},
                     {"sources", {seams.uv, seams.materials, seams.groups}},
                     {"max_stretch", options.max_stretch},
                     {"pack", options.pack},
                     {"texture_size", options.texture_size},
                     {"padding", options.padding.value_or(-1)},
                     {"tiles", options.tiles},
                     {"effort", ToString(options.effort)},
                     {"solver", ToString(options.solver.method)},
                     {"system", ToString(options.solver.system)},
                     {"preconditioner", ToString(options.solver.preconditioner)},
                     {"hessian", ToString(options.solver.hessian)},
                     {"boundary", ToString(options.boundary)},
                     {"precision", ToString(options.precision)},
                     {"tolerance", options.solver.tolerance},
                     {"max_newton_iterations", options.solver.max_newton_iterations},
                     {"texcoord", arguments.texcoord},
                     {"output_texcoord", arguments.OutputTexcoord()}};
  return Hexadecimal(ToLine(json));
}

}  // namespace planish::cli
