// planish_kkt_nonzeros MESH [SPY]: figure 2 of the paper. The size and the nonzeros of the matrix of eq. 5 with every
// form of the wheel condition, as one JSON object on stdout. With SPY, "row column" of each nonzero goes to SPY.log
// (eq. 6) and SPY.product (the difference of products, which the paper draws), after one Newton step.
#include <cstdio>
#include <string>

#include "core/abf/topology.h"
#include "core/mesh/angles.h"
#include "nlohmann/json.hpp"
#include "tests/bench/bench_meshes.h"
#include "tests/core/kkt.h"
#include "tests/testing/discs.h"

namespace planish::bench {
namespace {

int Fail(const std::string& message) {
  std::fprintf(stderr, "%s\n", message.c_str());
  return 2;
}

bool WriteSpy(const SparseMatrix& matrix, const std::string& path) {
  std::FILE* file = std::fopen(path.c_str(), "w");
  if (file == nullptr) return false;
  for (int column = 0; column < matrix.cols(); ++column) {
    for (SparseMatrix::InnerIterator it(matrix, column); it; ++it) {
      std::fprintf(file, "%d %d\n", static_cast<int>(it.row()), column);
    }
  }
  return std::fclose(file) == 0;
}

int Main(int argc, char** argv) {
  if (argc < 2 || argc > 3) return Fail("usage: planish_kkt_nonzeros MESH [SPY]");
  const auto mesh = LoadMesh(argv[1]);
  if (!mesh.ok()) return Fail(std::string(mesh.status().message()));
  const auto topology = DiscTopology(*mesh);
  if (!topology.ok()) return Fail(std::string(topology.status().message()));
  const nlohmann::json line = {{"mesh", LabelOf(argv[1])},
                               {"step", "figure 2"},
                               {"triangles", mesh->num_faces()},
                               {"interior_vertices", topology->num_interior},
                               {"rows", 4 * mesh->num_faces() + 2 * topology->num_interior},
                               {"logarithm", CountKktNonzeros(*topology, WheelForm::kLogarithm)},
                               {"difference", CountKktNonzeros(*topology, WheelForm::kDifference)},
                               {"product", CountKktNonzeros(*topology, WheelForm::kProduct)}};
  std::printf("%s\n", line.dump().c_str());
  if (argc == 2) return 0;

  const TargetAngles target = MakeTargetAngles(*topology, MeasuredAngles(*mesh));
  const Objective objective(target);
  for (const WheelForm form : {WheelForm::kLogarithm, WheelForm::kDifference}) {
    const auto at = SolveByKkt(*topology, target, {.form = form, .max_newton_iterations = 1});
    if (!at.ok()) return Fail(std::string(at.status().message()));
    const SparseMatrix kkt = KktMatrix(LagrangianHessianMatrix(*topology, objective, at->x, at->mu, form),
                                       ConstraintJacobian(*topology, at->x, form));
    const std::string path = std::string(argv[2]) + (form == WheelForm::kLogarithm ? ".log" : ".product");
    if (!WriteSpy(kkt, path)) return Fail("cannot write " + path);
  }
  return 0;
}

}  // namespace
}  // namespace planish::bench

int main(int argc, char** argv) {
  return planish::bench::Main(argc, argv);
}
