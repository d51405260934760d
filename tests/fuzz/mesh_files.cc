// Files that a person gives the client. The first byte chooses the format.
#include <memory>
#include <string>
#include <vector>

#include "client/files/gltf_mesh.h"
#include "client/files/mesh_output.h"
#include "client/files/readers.h"
#include "core/base/error.h"
#include "tests/fuzz/check.h"
#include "tests/fuzz/memory_budget.h"

namespace planish::fuzz::mesh_files {
namespace {

// Readers promise memory in proportion to the bytes, and libFuzzer's inputs are small; but Draco may lie inside a glTF.
constexpr std::int64_t kMemory = std::int64_t{256} << 20;
// Nothing beside it can be read.
constexpr char kPath[] = "/no such directory/in";

constexpr MeshFormat kFormats[] = {MeshFormat::kObj, MeshFormat::kPly, MeshFormat::kOff,
                                   MeshFormat::kStl, MeshFormat::kGlb, MeshFormat::kGltf};

absl::StatusOr<PolygonMesh> Read(MeshFormat format, std::string_view bytes, std::shared_ptr<const GltfMesh>* gltf) {
  switch (format) {
    case MeshFormat::kPly:
      return ReadPly(kPath, bytes);
    case MeshFormat::kOff:
      return ReadOff(kPath, bytes);
    case MeshFormat::kStl:
      return ReadStl(kPath, bytes);
    case MeshFormat::kGltf:
    case MeshFormat::kGlb:
      return ReadGltf(kPath, bytes, 0, gltf);
    case MeshFormat::kObj:
    case MeshFormat::kDraco:
      break;
  }
  return ReadObj(kPath, bytes);
}

template <typename Id>
void CheckIds(const std::vector<Id>& ids, std::size_t expected, std::size_t below, bool none_allowed) {
  Require(ids.empty() || ids.size() == expected, "as many ids as there are elements");
  for (const Id id : ids) {
    Require((none_allowed && id == -1) || (id >= 0 && static_cast<std::size_t>(id) < below), "ids in range");
  }
}

void CheckMesh(const PolygonMesh& mesh) {
  const auto polygons = static_cast<std::size_t>(mesh.num_polygons());
  const std::size_t corners = mesh.corner_vertex.size();
  Require(polygons > 0, "there are polygons");
  Require(mesh.polygon_begin.front() == 0, "polygons begin with the first corner");
  Require(mesh.polygon_begin.back() == static_cast<std::int64_t>(corners), "polygons end with the last corner");
  for (std::size_t p = 0; p < polygons; ++p) {
    Require(mesh.polygon_begin[p + 1] - mesh.polygon_begin[p] >= 3, "polygons have three corners");
  }
  CheckIds(mesh.corner_vertex, corners, mesh.positions.size(), false);
  CheckIds(mesh.corner_file_vertex, corners, mesh.positions.size(), false);
  CheckIds(mesh.corner_texcoord, corners, mesh.texcoords.size(), true);
  CheckIds(mesh.polygon_material, polygons, mesh.material_names.size(), true);
  CheckIds(mesh.polygon_group, polygons, mesh.group_names.size(), true);
  Require(mesh.vertex_line.empty() || mesh.vertex_line.size() == mesh.positions.size(), "a line per vertex");
  Require(mesh.polygon_line.empty() || mesh.polygon_line.size() == polygons, "a line per polygon");
  const Triangulation triangles = Triangulate(mesh);
  Require(triangles.mesh.faces.size() == corners - 2 * polygons, "a polygon of n corners gives n - 2 triangles");
}

// What the reader takes the writer keeps.
void CheckRoundTrip(MeshFile file) {
  OutputOptions output;
  output.format = file.format;
  const PolygonMesh mesh = file.mesh;
  const std::vector<double> uv(2 * mesh.corner_vertex.size());
  const auto written = WriteMeshWithUv(file, uv, output);
  if (!written.ok()) return RequireReason(written.status(), {"OUTPUT_UNSUPPORTED", "OUT_OF_MEMORY"});
  const auto again = Read(file.format, written->files.back().bytes, &file.gltf);
  Require(again.ok(), "what was written here can be read: " + again.status().ToString());
  Require(again->corner_vertex.size() == mesh.corner_vertex.size(), "writing keeps corners");
  if (file.format == MeshFormat::kGlb) return;  // vertices without a face may give way to copies of others
  Require(again->corner_vertex == mesh.corner_vertex, "writing keeps the vertices of corners");
  Require(again->corner_file_vertex == mesh.corner_file_vertex, "writing keeps the file's vertices of corners");
  Require(again->polygon_begin == mesh.polygon_begin, "writing keeps polygons");
}

}  // namespace

FUZZ_TARGET(mesh_files, bytes) {
  const MemoryBudget budget(kMemory);
  Bytes input(bytes);
  MeshFile file;
  file.path = kPath;
  file.format = kFormats[input.Below(std::size(kFormats))];
  file.bytes = std::string(input.Rest());
  auto mesh = Read(file.format, file.bytes, &file.gltf);
  if (!mesh.ok()) {
    RequireReason(mesh.status(), {"FILE_MALFORMED", "FILE_UNSUPPORTED", "FILE_UNREADABLE", "OUT_OF_MEMORY"});
    return;
  }
  CheckMesh(*mesh);
  file.mesh = *std::move(mesh);
  // A .gltf is written with a buffer in a file of its own, which nobody can read back here.
  if (file.format == MeshFormat::kGltf) file.format = MeshFormat::kGlb;
  if (file.format != MeshFormat::kStl) CheckRoundTrip(std::move(file));
}

}  // namespace planish::fuzz::mesh_files
