// planish_solve_time MESH [RUNS]: seconds of each stage for a mesh file, one JSON object per run.
#include <cstdio>
#include <cstdlib>

#include "core/io/mesh_file.h"
#include "core/unwrap/unwrap.h"
#include "nlohmann/json.hpp"

int main(int argc, char** argv) {
  if (argc < 2) {
    std::fprintf(stderr, "usage: planish_solve_time MESH [RUNS]\n");
    return 2;
  }
  const auto file = planish::ReadMeshFile(argv[1]);
  if (!file.ok()) {
    std::fprintf(stderr, "%s\n", std::string(file.status().message()).c_str());
    return 2;
  }
  const planish::Mesh mesh = planish::Triangulate(file->mesh).mesh;
  const int runs = argc > 2 ? std::atoi(argv[2]) : 1;
  for (int i = 0; i < runs; ++i) {
    planish::UnwrapOptions options;
    if (std::getenv("CONVEX")) options.flatten.boundary = planish::BoundaryType::kConvex;
    if (std::getenv("MAXN")) options.flatten.max_newton_iterations = std::atoi(std::getenv("MAXN"));
    if (std::getenv("HEXACT")) options.flatten.hessian = planish::HessianType::kExact;
    if (std::getenv("DIRECT")) options.flatten.solver = planish::SolverType::kDirect;
    if (std::getenv("CHOL")) options.flatten.preconditioner = planish::PreconditionerType::kCholesky;
    if (std::getenv("HCONVEX")) options.flatten.hessian = planish::HessianType::kConvex;
    planish::UnwrapControl ctl;
    if (std::getenv("PROG"))
      ctl.on_progress = [](const planish::UnwrapProgress& p) {
        if (p.flatten.linear_residual == 0)
          std::fprintf(stderr, "  it %d lin %d step %g tri %.1e ver %.1e wh %.1e gr %.1e en %.10g\n",
                       p.flatten.newton_iteration, static_cast<int>(p.flatten.linear_iterations), p.flatten.step_length,
                       p.flatten.residual.triangle, p.flatten.residual.vertex, p.flatten.residual.wheel,
                       p.flatten.residual.gradient, p.flatten.energy);
      };
    const auto result = planish::Unwrap(mesh, options, ctl);
    if (!result.ok()) {
      std::fprintf(stderr, "%s\n", std::string(result.status().message()).c_str());
      return 1;
    }
    const planish::FlattenSummary& summary = result->charts.at(0).flatten;
    const nlohmann::json line = {
        {"triangles", mesh.num_faces()},
        {"converged", summary.converged},
        {"newton_iterations", summary.newton_iterations},
        {"linear_iterations", summary.linear_iterations},
        {"abf_energy", result->quality.abf_energy},
        {"flipped", result->quality.flipped},
        {"degenerate", result->quality.degenerate},
        {"overlapping", result->quality.overlapping},
        {"barrier", summary.barrier},
        {"precision", result->precision == planish::Precision::kDouble ? "double" : "float"},
        {"stop", summary.stop_message},
        {"boundary",
         {summary.boundary.vertices, summary.boundary.active, summary.boundary.set_changes, summary.boundary.settled}},
        {"charts_seconds", result->seconds.charts},
        {"solve_seconds", result->seconds.solve},
        {"layout_seconds", result->seconds.layout},
        {"solve_and_layout_seconds", result->seconds.solve + result->seconds.layout}};
    std::printf("%s\n", line.dump().c_str());
  }
  return 0;
}
