// planish_uv_quality MESH.obj MAP.obj: judges the UV of MAP.obj on MESH.obj as planish judges its own, whoever made
// them; one JSON object on stdout. MAP.obj has the same triangles in the same order, with a vt at every corner.
#include <array>
#include <cmath>
#include <cstdio>
#include <fstream>
#include <optional>
#include <string>
#include <vector>

#include "core/abf/target_angles.h"
#include "core/io/mesh_file.h"
#include "core/mesh/angles.h"
#include "core/mesh/disc_check.h"
#include "core/unwrap/distortion.h"
#include "core/unwrap/verify.h"
#include "nlohmann/json.hpp"

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

int Main(int argc, char** argv) {
  if (argc != 3) return Fail("usage: planish_uv_quality MESH.obj MAP.obj");
  const auto file = ReadMeshFile(argv[1]);
  if (!file.ok()) return Fail(std::string(file.status().message()));
  const Mesh mesh = Triangulate(file->mesh).mesh;
  const auto topology = CheckDisc(mesh);
  if (!topology.ok()) return Fail(std::string(topology.status().message()));
  const std::optional<CornerUv> uv = ReadCornerUv(argv[2], mesh);
  if (!uv) return Fail(std::string(argv[2]) + " has no UV for the triangles of " + argv[1]);

  const Eigen::VectorXd measured = MeasuredAngles(mesh);
  Quality quality;
  MeasureDistortion(mesh, measured, MakeTargetAngles(*topology, measured), *uv, {}, &quality);
  const OrientationFaults faults = CheckOrientations(*uv);
  const nlohmann::json line = {{"triangles", mesh.num_faces()},
                               {"abf_energy", Finite(quality.abf_energy)},
                               {"conformal_distortion_mean", Finite(quality.conformal_distortion_mean)},
                               {"flipped", faults.flipped},
                               {"degenerate", faults.degenerate}};
  std::printf("%s\n", line.dump().c_str());
  return 0;
}

}  // namespace
}  // namespace planish::bench

int main(int argc, char** argv) {
  return planish::bench::Main(argc, argv);
}
