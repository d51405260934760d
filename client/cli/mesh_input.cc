#include "client/cli/mesh_input.h"

#include <unistd.h>

#include <charconv>
#include <filesystem>
#include <numbers>
#include <vector>

#include "client/src/errors.h"
#include "core/io/map_picture.h"

namespace planish::cli {
namespace {

constexpr std::size_t kMaxPlaces = 4;

// "12,40" and "3-7,7-9" alike, as numbers in order.
std::vector<std::int64_t> IdsIn(const std::string& text) {
  std::vector<std::int64_t> found;
  for (const char* at = text.data(); at < text.data() + text.size();) {
    std::int64_t id = 0;
    const auto [end, error] = std::from_chars(*at == '-' ? at + 1 : at, text.data() + text.size(), id);
    if (error == std::errc()) found.push_back(id);
    at = error == std::errc() ? end : at + 1;
  }
  return found;
}

}  // namespace

MeshInput::MeshInput(const std::string& path, const ReadOptions& options) {
  absl::StatusOr<MeshFile> file = ReadMeshFile(path, options);
  if (!file.ok()) throw ErrorFrom(file.status());
  file_ = *std::move(file);
  triangulation_ = Triangulate(file_.mesh);
}

MeshView MeshInput::view() const {
  const Mesh& mesh = triangulation_.mesh;
  if (mesh.positions.empty() || mesh.faces.empty()) {
    return MeshView(std::span<const double>(), std::span<const std::int32_t>());
  }
  static_assert(sizeof(Vec3) == 3 * sizeof(double) && sizeof(Face) == 3 * sizeof(std::int32_t));
  return MeshView(std::span(mesh.positions.front().data(), 3 * mesh.positions.size()),
                  std::span(mesh.faces.front().data(), 3 * mesh.faces.size()));
}

ids::Renumbering MeshInput::ToFile() const {
  const auto through = [](const auto& table) {
    return [&table](std::int64_t id) -> std::int64_t {
      return id < static_cast<std::int64_t>(table.size())
                 ? static_cast<std::int64_t>(table[static_cast<std::size_t>(id)])
                 : -1;
    };
  };
  return {through(triangulation_.source_vertex), through(triangulation_.source_polygon)};
}

Error MeshInput::InFileIds(const Error& error) const {
  return Renumbered(error, ToFile());
}

Warning MeshInput::InFileIds(const Warning& warning) const {
  return {warning.reason, ids::RenumberMessage(warning.message, ToFile()),
          ids::RenumberMetadata(warning.metadata, ToFile())};
}

std::string MeshInput::Places(const std::map<std::string, std::string>& metadata) const {
  const std::string file_name = std::filesystem::path(file_.path).filename();
  std::string text;
  std::size_t count = 0;
  const auto add = [&](const char* element, std::int64_t id, const std::vector<std::int64_t>& lines) {
    if (id >= static_cast<std::int64_t>(lines.size()) || ++count > kMaxPlaces) return;
    text += (text.empty() ? "" : ", ") + std::string(element) + " " + std::to_string(id) + " (" + file_name + ":" +
            std::to_string(lines[static_cast<std::size_t>(id)]) + ")";
  };
  // Where faces are named, the vertices of the edges between them add nothing.
  for (const auto& [key, value] : metadata) {
    if (key != "face" && key != "faces") continue;
    for (const std::int64_t id : IdsIn(value)) add("face", id, file_.mesh.polygon_line);
  }
  for (const auto& [key, value] : metadata) {
    const bool is_edge = key == "edge" || key == "edges";
    if (key != "vertex" && key != "vertices" && !(is_edge && count == 0)) continue;
    for (const std::int64_t id : IdsIn(value)) add("vertex", id, file_.mesh.vertex_line);
  }
  // The server names only the first few as well, so there is no telling how many more.
  return count > kMaxPlaces ? text + ", ..." : text;
}

std::string MeshInput::WithUv(const Uv& uv) const {
  const std::vector<double> by_triangle = uv.AsDouble();
  std::vector<double> by_corner(2 * file_.mesh.corner_vertex.size(), 0.0);
  for (std::size_t i = 0; i < triangulation_.corner_of_triangle.size(); ++i) {
    const auto corner = static_cast<std::size_t>(triangulation_.corner_of_triangle[i]);
    by_corner[2 * corner] = by_triangle[2 * i];
    by_corner[2 * corner + 1] = by_triangle[2 * i + 1];
  }
  return WriteObjWithUv(file_, by_corner, uv.precision == Precision::kFloat);
}

std::string MeshInput::Picture(const Uv& uv, double azimuth, double elevation) const {
  constexpr double kRadians = std::numbers::pi / 180;
  MapPictureOptions options;
  options.azimuth = azimuth * kRadians;
  options.elevation = elevation * kRadians;
  absl::StatusOr<std::string> png = EncodePng(DrawMap(triangulation_.mesh, uv.AsDouble(), options));
  if (!png.ok()) throw ErrorFrom(png.status());
  return *std::move(png);
}

void WriteOutput(const std::string& path, const std::string& bytes) {
  const absl::Status status = WriteFile(path, bytes);
  if (!status.ok()) throw ErrorFrom(status);
}

void CheckOutput(const std::string& path) {
  if (path == "-") return;
  const std::filesystem::path directory = std::filesystem::absolute(path).parent_path();
  if (access(directory.c_str(), W_OK) == 0) return;
  throw Error(ErrorCode::kPermissionDenied, "FILE_UNWRITABLE",
              path + ": cannot write to directory " + directory.string() +
                  (access(directory.c_str(), F_OK) == 0 ? "" : ": it does not exist"));
}

}  // namespace planish::cli
