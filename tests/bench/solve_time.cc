// planish_solve_time MESH [RUNS [THREADS]]: seconds of each stage for a mesh file, one JSON object per run.
#include <cstdio>
#include <cstdlib>

#include "core/io/mesh_file.h"
#include "core/unwrap/unwrap.h"
#include "nlohmann/json.hpp"

int main(int argc, char** argv) {
  if (argc < 2) {
    std::fprintf(stderr, "usage: planish_solve_time MESH [RUNS [THREADS]]\n");
    return 2;
  }
  const auto file = planish::ReadMeshFile(argv[1]);
  if (!file.ok()) {
    std::fprintf(stderr, "%s\n", std::string(file.status().message()).c_str());
    return 2;
  }
  const planish::Mesh mesh = planish::Triangulate(file->mesh).mesh;
  const int runs = argc > 2 ? std::atoi(argv[2]) : 1;
  planish::UnwrapOptions options;
  options.threads = argc > 3 ? std::atoi(argv[3]) : 1;
  for (int i = 0; i < runs; ++i) {
    const auto result = planish::Unwrap(mesh, options, {});
    if (!result.ok()) {
      std::fprintf(stderr, "%s\n", std::string(result.status().message()).c_str());
      return 1;
    }
    const planish::FlattenSummary& summary = result->charts.at(0).flatten;
    const nlohmann::json line = {{"triangles", mesh.num_faces()},
                                 {"threads", options.threads},
                                 {"converged", summary.converged},
                                 {"newton_iterations", summary.newton_iterations},
                                 {"linear_iterations", summary.linear_iterations},
                                 {"abf_energy", result->quality.abf_energy},
                                 {"flipped", result->quality.flipped},
                                 {"charts_seconds", result->seconds.charts},
                                 {"solve_seconds", result->seconds.solve},
                                 {"layout_seconds", result->seconds.layout},
                                 {"pack_seconds", result->seconds.pack},
                                 {"verify_seconds", result->seconds.verify},
                                 {"solve_and_layout_seconds", result->seconds.solve + result->seconds.layout}};
    std::printf("%s\n", line.dump().c_str());
  }
  return 0;
}
