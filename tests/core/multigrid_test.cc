#include "core/linalg/multigrid.h"

#include <random>

#include "core/abf/lagrangian.h"
#include "core/abf/reduced_system.h"
#include "core/linalg/aggregation.h"
#include "core/linalg/linear_solver.h"
#include "core/mesh/angles.h"
#include "core/mesh/disc_check.h"
#include "gtest/gtest.h"
#include "tests/core/shapes.h"

namespace planish {
namespace {

// The reduced system of the first Newton step.
struct FirstStep {
  explicit FirstStep(const Mesh& mesh)
      : topology(CheckDisc(mesh).value()),
        target(MakeTargetAngles(topology, MeasuredAngles(mesh))),
        system(topology, 2 * target.weight, Cotangents(target.angle)),
        reduced(topology),
        matrix(reduced.Assemble(system)) {}

  std::int64_t Iterations(const Preconditioner& preconditioner) const {
    Eigen::VectorXd f(3 * topology.num_faces());
    for (Eigen::Index i = 0; i < f.size(); ++i) f[i] = std::sin(static_cast<double>(i));
    LinearSolveOptions options;
    options.relative_tolerance = 1e-8;
    SaddlePointSolution solution;
    const LinearSummary summary = MakeUzawaSolver()->Solve(
        system, preconditioner, f, Eigen::VectorXd::Zero(2 * topology.num_interior), options, &solution);
    EXPECT_EQ(summary.termination, LinearTermination::kConverged);
    return summary.iterations;
  }

  Topology topology;
  TargetAngles target;
  ReducedSystem system;
  ReducedMatrix reduced;
  const BlockMatrix<double>& matrix;
};

Eigen::VectorXd RandomVector(Eigen::Index n, unsigned seed) {
  std::mt19937 random(seed);
  std::uniform_real_distribution<double> unit(-1, 1);
  Eigen::VectorXd v(n);
  for (double& entry : v) entry = unit(random);
  return v;
}

TEST(Multigrid, IsSymmetricAndPositive) {
  const FirstStep step(testing::Hills(40, 40, 1.5));
  Multigrid multigrid;
  ASSERT_TRUE(multigrid.Build(step.matrix).ok());
  EXPECT_GE(multigrid.num_levels(), 2);
  EXPECT_LT(multigrid.operator_complexity(), 1.6);
  const Eigen::Index n = 2 * step.topology.num_interior;
  for (unsigned seed = 0; seed < 4; ++seed) {
    const Eigen::VectorXd r = RandomVector(n, seed), s = RandomVector(n, seed + 100);
    Eigen::VectorXd kr, ks;
    multigrid.Apply(r, &kr);
    multigrid.Apply(s, &ks);
    EXPECT_NEAR(s.dot(kr) / r.dot(ks), 1, 1e-3);
    EXPECT_GT(r.dot(kr), 0);
  }
}

TEST(Multigrid, IterationsStayFlatInMeshSize) {
  std::vector<std::int64_t> iterations;
  for (const int n : {30, 60, 120}) {
    const FirstStep step(testing::Hills(n, n, 1.5));
    Multigrid multigrid;
    ASSERT_TRUE(multigrid.Build(step.matrix).ok());
    iterations.push_back(step.Iterations(MultigridPreconditioner(&multigrid)));
  }
  EXPECT_LT(iterations.back(), 40);
  EXPECT_LE(static_cast<double>(iterations.back()), 1.5 * static_cast<double>(iterations.front()))
      << iterations[0] << " " << iterations[1] << " " << iterations[2];
}

TEST(Multigrid, RefreshOnTheSameMatrixChangesNothing) {
  const FirstStep step(testing::Hills(40, 30));
  Multigrid built, refreshed;
  ASSERT_TRUE(built.Build(step.matrix).ok());
  ASSERT_TRUE(refreshed.Build(step.matrix).ok());
  ASSERT_TRUE(refreshed.Refresh(step.matrix).ok());
  const Eigen::VectorXd r = RandomVector(2 * step.topology.num_interior, 5);
  Eigen::VectorXd a, b;
  built.Apply(r, &a);
  refreshed.Apply(r, &b);
  EXPECT_EQ(a, b);
}

TEST(Multigrid, IsIndifferentToTheScaleOfTheRightHandSide) {
  const FirstStep step(testing::Hills(40, 30));
  Multigrid multigrid;
  ASSERT_TRUE(multigrid.Build(step.matrix).ok());
  const Eigen::VectorXd r = RandomVector(2 * step.topology.num_interior, 6);
  Eigen::VectorXd a, b;
  multigrid.Apply(r, &a);
  multigrid.Apply(1e-60 * r, &b);
  EXPECT_LT((1e60 * b - a).norm(), 1e-6 * a.norm());
}

TEST(Multigrid, RefusesAnIndefiniteMatrix) {
  const FirstStep step(testing::Hills(40, 30));
  BlockMatrix<double> negative = step.matrix;
  for (double& value : negative.value) value = -value;
  EXPECT_EQ(Multigrid().Build(negative).code(), absl::StatusCode::kFailedPrecondition);
}

TEST(Aggregate, CoversEveryCoupledRowWithSmallSets) {
  const FirstStep step(testing::Hills(40, 30));
  BlockMatrix<float> matrix;
  matrix.row_begin = step.matrix.row_begin;
  matrix.column = step.matrix.column;
  matrix.value.assign(step.matrix.value.begin(), step.matrix.value.end());
  const Aggregates aggregates = Aggregate(matrix, StrongCouplings(matrix, 0.08));
  std::vector<int> size(aggregates.count, 0);
  for (const std::int32_t a : aggregates.of_row) {
    ASSERT_GE(a, 0);
    ASSERT_LT(a, aggregates.count);
    ++size[a];
  }
  for (const int s : size) {
    EXPECT_GT(s, 0);
    EXPECT_LT(s, 30);
  }
  EXPECT_LT(aggregates.count, matrix.num_rows() / 3);
}

}  // namespace
}  // namespace planish
