// planish_uv_quality MESH.obj MAP.obj: judges the UV of MAP.obj on MESH.obj as planish judges its own, whoever made
// them; one JSON object on stdout. MAP.obj has the same triangles in the same order, with a vt at every corner.
// Distortion is measured over all triangles (abf_energy, only of discs, and conformal_distortion_mean) or over those
// that have area in the map (stretch_l2, angle_error_mean_deg); triangles without area on the surface never count.
#include <array>
#include <cmath>
#include <cstdio>
#include <fstream>
#include <numeric>
#include <optional>
#include <string>
#include <vector>

#include "CLI/CLI.hpp"
#include "client/files/mesh_file.h"
#include "core/abf/target_angles.h"
#include "core/abf/topology.h"
#include "core/mesh/angles.h"
#include "core/mesh/predicates.h"
#include "core/unwrap/distortion.h"
#include "core/unwrap/verify.h"
#include "nlohmann/json.hpp"
#include "tests/bench/uv_islands.h"
#include "tests/testing/discs.h"

namespace planish::bench {
namespace {

int Fail(const std::string& message) {
  std::fprintf(stderr, "%s\n", message.c_str());
  return 2;
}

// The UV of every corner; nothing if the triangles are not those of `mesh`.
std::optional<CornerUv> ReadCornerUv(const std::string& path, const Mesh& mesh) {
  std::ifstream file(path);
  std::vector<std::array<double, 2>> points;
  CornerUv uv;
  std::size_t f = 0;
  for (std::string line; std::getline(file, line);) {
    std::array<double, 2> p;
    std::array<int, 3> v;
    std::array<int, 3> t;
    if (std::sscanf(line.c_str(), "vt %lf %lf", &p[0], &p[1]) == 2) {
      points.push_back(p);
    } else if (std::sscanf(line.c_str(), "f %d/%d %d/%d %d/%d", &v[0], &t[0], &v[1], &t[1], &v[2], &t[2]) == 6) {
      if (f >= mesh.faces.size()) return std::nullopt;
      for (int k = 0; k < 3; ++k) {
        if (v[k] != mesh.faces[f][k] + 1 || t[k] < 1 || t[k] > static_cast<int>(points.size())) return std::nullopt;
        uv.insert(uv.end(), points[t[k] - 1].begin(), points[t[k] - 1].end());
      }
      ++f;
    }
  }
  return f == mesh.faces.size() ? std::optional(uv) : std::nullopt;
}

nlohmann::json Finite(double value) {
  return std::isfinite(value) ? nlohmann::json(value) : nlohmann::json(nullptr);
}

struct Flags {
  std::string mesh, map;
  std::array<double, 2> tile = {1, 1};
  double padding = 0;
};

int Judge(const Flags& flags) {
  const auto file = ReadMeshFile(flags.mesh);
  if (!file.ok()) return Fail(std::string(file.status().message()));
  const Mesh mesh = Triangulate(file->mesh).mesh;
  for (const Face& f : mesh.faces) {
    if (f[0] == f[1] || f[1] == f[2] || f[2] == f[0]) return Fail(flags.mesh + ": a face names a vertex twice");
  }
  const std::optional<CornerUv> uv = ReadCornerUv(flags.map, mesh);
  if (!uv) return Fail(flags.map + " has no UV for the triangles of " + flags.mesh);

  // Triangles without area on the surface owe nothing; those without area in the map alone are counted.
  std::vector<char> flat_surface(mesh.faces.size()), flat_map(mesh.faces.size()), flat(mesh.faces.size());
  for (std::size_t f = 0; f < mesh.faces.size(); ++f) {
    const Face& v = mesh.faces[f];
    Vec2 p[3];
    for (int k = 0; k < 3; ++k) p[k] = Vec2((*uv)[6 * f + 2 * k], (*uv)[6 * f + 2 * k + 1]);
    flat_surface[f] = IsDegenerateTriangle(mesh.positions[v[0]], mesh.positions[v[1]], mesh.positions[v[2]]);
    flat_map[f] = Orientation(p[0], p[1], p[2]) == 0;
    flat[f] = flat_surface[f] || flat_map[f];
  }
  const Eigen::VectorXd measured = MeasuredAngles(mesh);
  const auto topology = DiscTopology(mesh);
  const TargetAngles target = topology.ok() ? MakeTargetAngles(*topology, measured)
                                            : TargetAngles{measured, Eigen::VectorXd::Zero(measured.size())};
  Quality quality, of_area;
  std::vector<std::int32_t> all(mesh.faces.size());
  std::iota(all.begin(), all.end(), 0);
  MeasureDistortion(mesh, all, measured, target, *uv, flat_surface).Fill(&quality);
  MeasureDistortion(mesh, all, measured, target, *uv, flat).Fill(&of_area);
  const OrientationFaults faults = CheckOrientations(*uv, {}, flat_surface);
  // A triangle that has area in the map alone still joins its neighbours into one chart.
  const UvIslands islands = FindUvIslands(mesh, *uv, flat_map);
  const Overlaps overlaps = CheckOverlaps(islands.opposite, *uv, faults, {}, flat);
  const nlohmann::json line = {{"triangles", mesh.num_faces()},
                               {"abf_energy", topology.ok() ? Finite(quality.abf_energy) : nlohmann::json(nullptr)},
                               {"conformal_distortion_mean", Finite(quality.conformal_distortion_mean)},
                               {"stretch_l2", Finite(of_area.stretch_l2)},
                               {"angle_error_mean_deg", Finite(of_area.angle_error_mean_deg)},
                               {"packing_efficiency", of_area.packing_efficiency / (flags.tile[0] * flags.tile[1])},
                               {"charts", islands.count},
                               {"flipped", faults.flipped},
                               {"degenerate", faults.degenerate},
                               {"overlapping", overlaps.pairs},
                               {"too_near", flags.padding > 0 ? CountTooNear(islands, *uv, flags.padding) : 0}};
  std::printf("%s\n", line.dump().c_str());
  return 0;
}

}  // namespace
}  // namespace planish::bench

int main(int argc, char** argv) {
  planish::bench::Flags flags;
  CLI::App app("Judges the UV of one file on the mesh of another as planish judges its own");
  app.add_option("mesh", flags.mesh, "Mesh file")->required();
  app.add_option("map", flags.map, "OBJ with the same triangles in the same order and UV at every corner")->required();
  app.add_option("--tile", flags.tile, "Width and height of the texture in units of UV [1 1]");
  app.add_option("--padding", flags.padding, "Distance that charts should keep, in units of UV; 0: not looked at");
  CLI11_PARSE(app, argc, argv);
  return planish::bench::Judge(flags);
}
