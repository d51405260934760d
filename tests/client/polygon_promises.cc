#include "tests/client/polygon_promises.h"

#include <algorithm>
#include <set>
#include <utility>

#include "client/cli/check.h"
#include "client/cli/mesh_input.h"
#include "client/files/mesh_output.h"
#include "core/mesh/angles.h"
#include "tests/testing/unwrap_in_process.h"

namespace planish::testing {
namespace {

std::string Numbers(const std::set<std::int64_t>& ids) {
  std::string text;
  for (const std::int64_t id : ids) text += " " + std::to_string(id);
  return text;
}

}  // namespace

std::vector<std::string> BrokenPolygonPromises(const std::string& obj, MeshFormat format, bool for_texture) {
  const absl::StatusOr<MeshFile> file = ReadMeshBytes("in.obj", MeshFormat::kObj, obj);
  if (!file.ok()) return {"cannot be read: " + file.status().ToString()};
  const Triangulation triangles = Triangulate(file->mesh);
  const InProcessMap result = UnwrapInProcess(triangles.mesh, triangles.piece, IsFloatByNature(format), for_texture);
  if (result.is_refused) return {};
  if (!result.error.empty()) return {result.error};
  const PolygonUv uv = UvOfPolygons(file->mesh, triangles, result.uv.data());
  const auto written = WriteMeshWithUv(*file, uv, {format, "out", result.is_float, 0, {}});
  if (!written.ok()) return {"cannot be written: " + written.status().ToString()};
  absl::StatusOr<MeshFile> again = ReadMeshBytes("out", format, written->files.back().bytes);
  if (!again.ok()) return {"cannot be read again: " + again.status().ToString()};

  std::vector<std::string> broken;
  std::set<std::int64_t> named, torn;
  for (const auto& [polygon, fault] : triangles.faulty) named.insert(polygon);
  for (const std::int32_t f : result.torn_faces) named.insert(triangles.source_polygon[static_cast<std::size_t>(f)]);
  std::int64_t added = 0;
  for (const TornPolygon& each : uv.torn) {
    added += static_cast<std::int64_t>(each.faces.size()) - 1;
    if (named.count(each.polygon) == 0) torn.insert(each.polygon);
  }
  if (!torn.empty()) broken.push_back("torn without a word:" + Numbers(torn));
  const bool has_polygons = format == MeshFormat::kObj || format == MeshFormat::kPly || format == MeshFormat::kOff;
  if (has_polygons && again->mesh.num_polygons() != file->mesh.num_polygons() + added) {
    broken.push_back(std::to_string(file->mesh.num_polygons()) + " polygons became " +
                     std::to_string(again->mesh.num_polygons()));
  }
  std::vector<MeshFile> files;
  files.push_back(*std::move(again));
  const cli::MeshInput input(std::move(files));
  MapCheckOptions check;
  check.with_spacing = false;
  const cli::CheckedMap map = cli::CheckMapOf(input, check, {});
  if (!map.without_uv.empty() || !map.not_finite.empty()) broken.push_back("faces without UV");
  // Faces without area on the surface get UV, but no promise holds for them.
  const auto is_degenerate = [](const Mesh& mesh, std::size_t f) {
    const auto [p, q, r] = TriangleOf(mesh.positions, mesh.faces[f]);
    return IsDegenerateTriangle(p, q, r);
  };
  // A face without area may get some when a format rounds its positions to float.
  const bool has_the_same_faces = map.mesh.faces.size() == triangles.mesh.faces.size();
  const auto has_area = [&](std::size_t f) {
    return !is_degenerate(map.mesh, f) && !(has_the_same_faces && is_degenerate(triangles.mesh, f));
  };
  std::int64_t overlaps = 0, flipped = 0, degenerate = 0;
  const std::vector<std::int32_t>& pairs = map.check.overlapping_pairs;
  for (std::size_t i = 0; i + 1 < pairs.size(); i += 2) {
    overlaps += has_area(static_cast<std::size_t>(pairs[i])) && has_area(static_cast<std::size_t>(pairs[i + 1]));
  }
  if (overlaps > 0) broken.push_back(std::to_string(overlaps) + " overlaps");
  for (std::size_t f = 0; f < map.check.faults.size(); ++f) {
    if (!has_area(f)) continue;
    flipped += (map.check.faults[f] & kFlippedFace) != 0;
    degenerate += (map.check.faults[f] & kDegenerateFace) != 0;
  }
  if (flipped > 0) broken.push_back(std::to_string(flipped) + " flips");
  if (degenerate > 0) broken.push_back(std::to_string(degenerate) + " faces without area in the map");
  return broken;
}

}  // namespace planish::testing
