#include "client/files/mesh_file.h"

#include <unistd.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <filesystem>
#include <new>
#include <optional>
#include <stdexcept>
#include <string>
#include <string_view>

#include "absl/strings/ascii.h"
#include "client/files/file_io.h"
#include "client/files/gltf_mesh.h"
#include "client/files/readers.h"
#include "client/texture/image.h"
#include "core/base/error.h"
#include "core/base/status_macros.h"

namespace planish {
namespace {

absl::Status Parse(const ReadOptions& options, MeshFile* file) {
  absl::StatusOr<PolygonMesh> mesh;
  switch (file->format) {
    case MeshFormat::kObj:
      mesh = ReadObj(file->path, file->bytes);
      break;
    case MeshFormat::kPly:
      mesh = ReadPly(file->path, file->bytes);
      break;
    case MeshFormat::kOff:
      mesh = ReadOff(file->path, file->bytes);
      break;
    case MeshFormat::kStl:
      mesh = ReadStl(file->path, file->bytes);
      break;
    case MeshFormat::kGltf:
    case MeshFormat::kGlb:
      mesh = ReadGltf(file->path, file->bytes, options.texcoord, &file->gltf);
      if (file->format == MeshFormat::kGlb) file->bytes = std::string();  // images make such files large
      break;
    case MeshFormat::kDraco:
      mesh = ReadDracoFile(file->path, file->bytes);
      break;
  }
  if (!mesh.ok()) return mesh.status();
  file->mesh = *std::move(mesh);
  return absl::OkStatus();
}

// Checks the promises of readers.h, so that a bug there cannot cause an out-of-bounds access here.
absl::Status CheckPolygons(const PolygonMesh& mesh) {
  const std::int64_t vertices = static_cast<std::int64_t>(mesh.positions.size());
  bool sound = mesh.polygon_begin.front() == 0 &&
               mesh.polygon_begin.back() == static_cast<std::int64_t>(mesh.corner_vertex.size());
  for (std::int64_t polygon = 0; polygon < mesh.num_polygons(); ++polygon) {
    sound &= mesh.polygon_begin[polygon + 1] - mesh.polygon_begin[polygon] >= 3;
  }
  for (const std::int32_t vertex : mesh.corner_vertex) sound &= vertex >= 0 && vertex < vertices;
  return sound ? absl::OkStatus() : InternalError("a mesh file was read into polygons that are not valid");
}

absl::StatusOr<MeshFile> Parsed(const ReadOptions& options, MeshFile file) {
  PLANISH_RETURN_IF_ERROR(Parse(options, &file));
  PLANISH_RETURN_IF_ERROR(CheckPolygons(file.mesh));
  return file;
}

absl::StatusOr<MeshFile> ReadMeshFileOrThrow(const std::string& path, const ReadOptions& options) {
  MeshFile file;
  file.path = path == "-" ? kStandardInput : path;
  if (path == "-" && isatty(STDIN_FILENO) == 1) {
    return MakeError(absl::StatusCode::kUnavailable, "FILE_UNREADABLE",
                     file.path + ": is a terminal; pipe a mesh into it, or name a file", {{"path", file.path}});
  }
  std::optional<MeshFormat> format = FormatOfPath(path);
  // Opens a file of unknown format too: if it is missing, that is reported, since a wrong name is the likelier mistake.
  const bool is_stream = !format && IsStream(path);
  PLANISH_ASSIGN_OR_RETURN(file.bytes, format || is_stream ? ReadWholeFile(path) : ReadFileStart(path, 0));
  if (is_stream) format = FormatOfBytes(file.bytes);
  if (!format) {
    return MakeError(absl::StatusCode::kInvalidArgument, "FILE_FORMAT_UNKNOWN",
                     file.path + ": unknown file format: " +
                         (is_stream ? "it begins like no OBJ, PLY, OFF, STL, glTF, GLB or Draco file"
                                    : "the name must end in .obj, .ply, .off, .stl, .gltf, .glb or .drc"),
                     {{"path", file.path}});
  }
  file.format = *format;
  if (is_stream && options.texcoord > 0 && file.format != MeshFormat::kGltf && file.format != MeshFormat::kGlb) {
    return MakeError(absl::StatusCode::kInvalidArgument, "FILE_UNSUPPORTED",
                     file.path + ": no glTF, so it has one set of UV, number 0, and none with number " +
                         std::to_string(options.texcoord),
                     {{"path", file.path}});
  }
  return Parsed(options, std::move(file));
}

absl::Status OutOfMemory(const std::string& path) {
  return MakeError(absl::StatusCode::kResourceExhausted, "OUT_OF_MEMORY", path + ": not enough memory to read the file",
                   {{"path", path}});
}

}  // namespace

std::optional<MeshFormat> FormatOfPath(const std::string& path) {
  const std::string extension = absl::AsciiStrToLower(std::filesystem::path(path).extension().string());
  if (extension == ".obj") return MeshFormat::kObj;
  if (extension == ".ply") return MeshFormat::kPly;
  if (extension == ".off") return MeshFormat::kOff;
  if (extension == ".stl") return MeshFormat::kStl;
  if (extension == ".gltf") return MeshFormat::kGltf;
  if (extension == ".glb") return MeshFormat::kGlb;
  if (extension == ".drc") return MeshFormat::kDraco;
  return std::nullopt;
}

bool IsStream(const std::string& path) {
  return path == "-" || path.starts_with("/dev/") || path.starts_with("/proc/self/fd/");
}

std::optional<MeshFormat> FormatOfBytes(std::string_view bytes) {
  if (bytes.starts_with("glTF")) return MeshFormat::kGlb;
  if (bytes.starts_with("DRACO")) return MeshFormat::kDraco;
  // A binary STL may begin with anything, even "solid", so its size decides: 80 bytes, the number of triangles, and 50
  // bytes for each.
  std::uint32_t triangles = 0;
  if (bytes.size() >= 84) std::memcpy(&triangles, bytes.data() + 80, sizeof triangles);
  if (bytes.size() >= 84 && bytes.size() == 84 + std::uint64_t{50} * triangles) return MeshFormat::kStl;
  if (bytes.starts_with("\xEF\xBB\xBF")) bytes.remove_prefix(3);  // the byte order mark of UTF-8
  // OFF may have comments before its keyword ("OFF", "STOFF", "COFF"), and OBJ before its elements.
  for (std::size_t at = 0, end; at < bytes.size(); at = end) {
    end = std::min(bytes.find_first_of("\r\n", at), bytes.size());
    std::string_view line = bytes.substr(at, end - at);
    end += end < bytes.size() ? 1 : 0;
    line.remove_prefix(std::min(line.find_first_not_of(" \t"), line.size()));
    if (line.empty() || line.starts_with("#")) continue;
    const std::string_view word = line.substr(0, line.find_first_of(" \t"));
    if (word == "ply") return MeshFormat::kPly;
    if (line.starts_with("{")) return MeshFormat::kGltf;
    if (word == "solid") return MeshFormat::kStl;
    if (word.ends_with("OFF")) return MeshFormat::kOff;
    static constexpr std::array<std::string_view, 12> kElements = {"v", "vt", "vn", "vp", "f",      "l",
                                                                   "p", "o",  "g",  "s",  "usemtl", "mtllib"};
    if (std::find(kElements.begin(), kElements.end(), word) != kElements.end()) return MeshFormat::kObj;
    return std::nullopt;
  }
  return std::nullopt;
}

namespace {

// Returns the result of read(), or its exception as an error.
template <typename Read>
absl::StatusOr<MeshFile> Caught(const std::string& path, const Read& read) {
  try {
    return read();
  } catch (const std::bad_alloc&) {
    return OutOfMemory(path);
  } catch (const std::length_error&) {
    return OutOfMemory(path);
  } catch (const Json::exception& error) {
    return InternalError(path + ": " + error.what());
  }
}

}  // namespace

absl::StatusOr<MeshFile> ReadMeshFile(const std::string& path, const ReadOptions& options) {
  return Caught(path, [&] { return ReadMeshFileOrThrow(path, options); });
}

absl::StatusOr<MeshFile> ReadMeshBytes(const std::string& path, MeshFormat format, std::string bytes,
                                       const ReadOptions& options) {
  return Caught(path, [&] { return Parsed(options, {path, format, std::move(bytes), {}, {}}); });
}

std::vector<int> UvSets(const MeshFile& file) {
  if (!file.gltf) return file.mesh.corner_texcoord.empty() ? std::vector<int>() : std::vector<int>{0};
  std::vector<int> sets;
  for (int n = 0; n <= kLargestTexcoord; ++n) {
    const std::string name = "TEXCOORD_" + std::to_string(n);
    const bool has_it = std::any_of(file.gltf->primitives.begin(), file.gltf->primitives.end(), [&](const auto& p) {
      return PrimitiveJson(file.gltf->document.json, p)["attributes"].contains(name);
    });
    if (has_it) sets.push_back(n);
  }
  return sets;
}

std::vector<std::array<double, 3>> MaterialColors(const MeshFile& file) {
  std::vector<std::array<double, 3>> colors;
  if (!file.gltf) return colors;
  for (std::size_t i = 0; i < file.mesh.material_names.size(); ++i) {
    std::array<double, 3> color = {1, 1, 1};  // glTF's default
    const Json& material = file.gltf->document.json["materials"][i];
    const Json* const surface = GltfObject(material, "pbrMetallicRoughness");
    const auto factor = surface != nullptr ? surface->find("baseColorFactor") : material.end();
    if (surface != nullptr && factor != surface->end() && factor->is_array() && factor->size() == 4) {
      for (std::size_t k = 0; k < 3; ++k) {
        if ((*factor)[k].is_number()) color[k] = (*factor)[k].get<double>();
      }
    }
    for (double& x : color) x = SrgbOfLinear(std::clamp(x, 0.0, 1.0));
    colors.push_back(color);
  }
  return colors;
}

}  // namespace planish
