// One conformance suite that every combination of solver, system and preconditioner runs through.
#include <functional>
#include <limits>
#include <memory>
#include <tuple>

#include "Eigen/Dense"
#include "core/abf/flatten.h"
#include "core/abf/step_solver.h"
#include "core/abf/topology.h"
#include "core/base/error.h"
#include "core/linalg/patch_preconditioner.h"
#include "core/mesh/angles.h"
#include "gmock/gmock.h"
#include "gtest/gtest.h"
#include "tests/core/kkt.h"
#include "tests/core/shapes.h"
#include "tests/testing/discs.h"

namespace planish {
namespace {

using Combination = std::tuple<SolverType, SystemType, PreconditionerType>;

// A Newton step of a bumpy surface, away from the first iterate.
struct StepFixture {
  StepFixture() : topology(DiscTopology(mesh).value()), target(MakeTargetAngles(topology, MeasuredAngles(mesh))) {
    x = target.angle;
    for (Eigen::Index i = 0; i < x.size(); ++i) x[i] *= 1 + 0.02 * std::sin(7.0 * static_cast<double>(i));
    mu = Multipliers::Zero(topology);
    for (Eigen::Index i = 0; i < mu.pair.size(); ++i) mu.pair[i] = 0.2 * std::sin(3.0 * static_cast<double>(i));
    cot = Cotangents(x);
    h = EvaluateConstraints(topology, x);
    gradient = LagrangianGradient(topology, objective, x, cot, mu);
    hessian = LagrangianHessian(topology, objective, x, mu);
  }

  // Eq. 5 by a dense factorization.
  NewtonStep DenseStep(const Eigen::VectorXd& a) const {
    const Eigen::MatrixXd b = ConstraintJacobian(topology, x, WheelForm::kLogarithm);
    const Eigen::Index n = b.cols(), m = b.rows();
    Eigen::MatrixXd kkt = Eigen::MatrixXd::Zero(n + m, n + m);
    kkt.topLeftCorner(n, n) = a.asDiagonal();
    kkt.topRightCorner(n, m) = b.transpose();
    kkt.bottomLeftCorner(m, n) = b;
    Eigen::VectorXd rhs(n + m);
    rhs << -gradient, -h.triangle, -h.pair;
    const Eigen::VectorXd solution = kkt.fullPivLu().solve(rhs);
    return {solution.head(n), {solution.segment(n, h.triangle.size()), solution.tail(h.pair.size())}};
  }

  Mesh mesh = testing::Hills(8, 7, 1.5);
  Topology topology;
  TargetAngles target;
  Objective objective{target};
  Eigen::VectorXd x, cot, gradient, hessian;
  Multipliers mu;
  ConstraintValues h;
};

void ExpectSameStep(const NewtonStep& step, const NewtonStep& expected, double tolerance) {
  EXPECT_LT((step.x - expected.x).norm(), tolerance * expected.x.norm());
  EXPECT_LT((step.mu.pair - expected.mu.pair).norm(), tolerance * expected.mu.pair.norm());
  EXPECT_LT((step.mu.triangle - expected.mu.triangle).norm(), tolerance * expected.mu.triangle.norm());
}

class LinearSolverTest : public ::testing::TestWithParam<Combination> {
 protected:
  StepSolver MakeStepSolver() const {
    const auto& [solver, system, preconditioner] = GetParam();
    return StepSolver(fixture_.topology, solver, system, preconditioner);
  }
  bool IsDirect() const { return std::get<0>(GetParam()) == SolverType::kDirect; }

  StepFixture fixture_;
};

TEST_P(LinearSolverTest, SolvesEquation5) {
  StepSolver solver = MakeStepSolver();
  Eigen::VectorXd convex = fixture_.hessian;
  Convexify(2 * fixture_.target.weight, solver.RequiredConvexification(), &convex);
  ASSERT_TRUE(solver.Prepare(convex, convex, fixture_.cot).ok());
  NewtonStep step;
  LinearSolveOptions options;
  options.relative_tolerance = 1e-11;
  const LinearSummary summary = solver.Solve(fixture_.gradient, fixture_.h, options, &step).value();
  EXPECT_EQ(summary.termination, LinearTermination::kConverged) << Name(summary.termination);
  EXPECT_GT(summary.iterations, 0);
  EXPECT_LT(summary.true_residual, 1e-9);
  ExpectSameStep(step, fixture_.DenseStep(convex), 1e-7);
}

TEST_P(LinearSolverTest, StopsAtTheIterationLimitWithAConsistentStep) {
  StepSolver solver = MakeStepSolver();
  Eigen::VectorXd convex = fixture_.hessian;
  Convexify(2 * fixture_.target.weight, solver.RequiredConvexification(), &convex);
  ASSERT_TRUE(solver.Prepare(convex, convex, fixture_.cot).ok());
  LinearSolveOptions options;
  options.max_iterations = 5;
  NewtonStep step;
  const LinearSummary summary = solver.Solve(fixture_.gradient, fixture_.h, options, &step).value();
  const PreconditionerType preconditioner = std::get<2>(GetParam());
  if (preconditioner == PreconditionerType::kCholesky) {
    EXPECT_EQ(summary.termination, LinearTermination::kConverged) << "a factorization needs fewer";
  } else {
    EXPECT_EQ(summary.termination, LinearTermination::kIterationLimit);
    EXPECT_EQ(summary.iterations, 5);
  }
  // Whatever lambda is, x = A^-1 (f - B^t lambda) holds: the gradient rows of eq. 5 are met.
  Eigen::VectorXd rows = convex.cwiseProduct(step.x) + fixture_.gradient;
  for (Eigen::Index c = 0; c < rows.size(); ++c) rows[c] += step.mu.triangle[c / 3];
  AddPairRowsTransposed(fixture_.topology, fixture_.cot, step.mu.pair, &rows);
  EXPECT_LT(rows.cwiseAbs().maxCoeff(), 1e-9);
}

TEST_P(LinearSolverTest, ObeysTheInterrupterAndReportsProgress) {
  StepSolver solver = MakeStepSolver();
  Eigen::VectorXd convex = fixture_.hessian;
  Convexify(2 * fixture_.target.weight, solver.RequiredConvexification(), &convex);
  ASSERT_TRUE(solver.Prepare(convex, convex, fixture_.cot).ok());
  Interrupter interrupter;
  LinearSolveOptions options;
  options.cancel = &interrupter;
  options.relative_tolerance = 1e-11;
  std::vector<std::int64_t> reported;
  options.on_progress = [&](std::int64_t iterations, double residual) {
    reported.push_back(iterations);
    EXPECT_GT(residual, 0);
    if (iterations == kProgressInterval) interrupter.Interrupt();
  };
  NewtonStep step;
  LinearSummary summary = solver.Solve(fixture_.gradient, fixture_.h, options, &step).value();
  EXPECT_LE(summary.iterations, kProgressInterval);
  if (!IsDirect()) {
    ASSERT_FALSE(reported.empty());
    EXPECT_EQ(reported[0], 0);
  }
  if (reported.size() > 1) {
    EXPECT_EQ(summary.termination, LinearTermination::kInterrupted);
    EXPECT_EQ(summary.iterations, kProgressInterval);
  }
  interrupter.Interrupt();
  summary = solver.Solve(fixture_.gradient, fixture_.h, options, &step).value();
  EXPECT_EQ(summary.termination, LinearTermination::kInterrupted);
}

TEST_P(LinearSolverTest, ZeroRightHandSideNeedsNoIterations) {
  StepSolver solver = MakeStepSolver();
  const Eigen::VectorXd hessian = 2 * fixture_.target.weight;
  ASSERT_TRUE(solver.Prepare(hessian, hessian, fixture_.cot).ok());
  const ConstraintValues zero = {Eigen::VectorXd::Zero(fixture_.h.triangle.size()),
                                 Eigen::VectorXd::Zero(fixture_.h.pair.size())};
  NewtonStep step;
  const LinearSummary summary =
      solver.Solve(Eigen::VectorXd::Zero(fixture_.x.size()), zero, LinearSolveOptions(), &step).value();
  EXPECT_EQ(summary.termination, LinearTermination::kConverged);
  EXPECT_EQ(summary.iterations, 0);
  EXPECT_EQ(step.x.cwiseAbs().maxCoeff(), 0);
}

TEST_P(LinearSolverTest, ExactIndefiniteHessian) {
  // Turn one face indefinite on the plane: S then has one negative eigenvalue.
  Eigen::VectorXd exact = fixture_.hessian;
  exact.segment<3>(60) *= -1;
  StepSolver solver = MakeStepSolver();
  Eigen::VectorXd convex = exact;
  Convexify(2 * fixture_.target.weight, solver.RequiredConvexification(), &convex);
  ASSERT_TRUE(solver.Prepare(exact, convex, fixture_.cot).ok());
  LinearSolveOptions options;
  options.relative_tolerance = 1e-11;
  NewtonStep step;
  const LinearSummary summary = solver.Solve(fixture_.gradient, fixture_.h, options, &step).value();
  if (std::get<0>(GetParam()) == SolverType::kMinres) {
    EXPECT_EQ(summary.termination, LinearTermination::kConverged) << Name(summary.termination);
    ExpectSameStep(step, fixture_.DenseStep(exact), 1e-6);
  } else {
    // Conjugate directions may get through by luck, but must not claim a convergence that is not real.
    EXPECT_NE(summary.termination, LinearTermination::kInterrupted);
    if (summary.termination == LinearTermination::kConverged) {
      EXPECT_LT(summary.true_residual, 1e-8);
    }
  }
}

std::string CombinationName(const ::testing::TestParamInfo<Combination>& info) {
  const auto& [solver, system, preconditioner] = info.param;
  return std::string(Name(solver)) + "_" + Name(system) + "_" + Name(preconditioner);
}

INSTANTIATE_TEST_SUITE_P(
    All, LinearSolverTest,
    ::testing::Values(Combination{SolverType::kUzawa, SystemType::kFull, PreconditionerType::kNone},
                      Combination{SolverType::kUzawa, SystemType::kFull, PreconditionerType::kJacobi},
                      Combination{SolverType::kUzawa, SystemType::kReduced, PreconditionerType::kNone},
                      Combination{SolverType::kUzawa, SystemType::kReduced, PreconditionerType::kJacobi},
                      Combination{SolverType::kUzawa, SystemType::kReduced, PreconditionerType::kCholesky},
                      Combination{SolverType::kUzawa, SystemType::kReduced, PreconditionerType::kAmg},
                      Combination{SolverType::kMinres, SystemType::kFull, PreconditionerType::kNone},
                      Combination{SolverType::kMinres, SystemType::kFull, PreconditionerType::kJacobi},
                      Combination{SolverType::kMinres, SystemType::kReduced, PreconditionerType::kNone},
                      Combination{SolverType::kMinres, SystemType::kReduced, PreconditionerType::kJacobi},
                      Combination{SolverType::kMinres, SystemType::kReduced, PreconditionerType::kCholesky},
                      Combination{SolverType::kMinres, SystemType::kReduced, PreconditionerType::kAmg},
                      Combination{SolverType::kDirect, SystemType::kReduced, PreconditionerType::kCholesky}),
    CombinationName);

TEST(UzawaSolver, NoticesNegativeCurvature) {
  const StepFixture fixture;
  const Eigen::VectorXd negative = -2 * fixture.target.weight;
  const ReducedSystem system(fixture.topology, negative, fixture.cot);
  SaddlePointSolution solution;
  const LinearSummary summary = SolveSystem(MakeUzawaSolver(), system, IdentityPreconditioner(), fixture.gradient,
                                            fixture.h.pair, LinearSolveOptions(), &solution);
  EXPECT_EQ(summary.termination, LinearTermination::kIndefinite);
}

// A solver that hands over what it is told to.
LinearSolver FakeSolver(std::function<LinearSummary(const LinearSolveOptions& options, Eigen::VectorXd* lambda)> make) {
  return [make = std::move(make)](const SaddlePointOperator&, const Preconditioner&, const Eigen::VectorXd&,
                                  const LinearSolveOptions& options,
                                  Eigen::VectorXd* lambda) { return make(options, lambda); };
}

// M lambda = rhs of the fixture's Newton step.
struct SchurFixture : StepFixture {
  SchurFixture() : convex(Convexified()), system(topology, convex, cot) {
    rhs = Eigen::VectorXd::LinSpaced(system.num_multipliers(), -1, 2);
    LinearSolveOptions exact;
    exact.relative_tolerance = 1e-12;
    const LinearSummary summary =
        SolveSchur(MakeUzawaSolver(), system, JacobiPreconditioner(system.SchurDiagonal()), rhs, exact, &solution);
    EXPECT_EQ(summary.termination, LinearTermination::kConverged);
  }
  Eigen::VectorXd Convexified() const {
    Eigen::VectorXd changed = hessian;
    Convexify(2 * target.weight, Convexification::kByFace, &changed);
    return changed;
  }
  LinearSummary Solve(const LinearSolver& solver, const LinearSolveOptions& options) const {
    Eigen::VectorXd lambda;
    return SolveSchur(solver, system, IdentityPreconditioner(), rhs, options, &lambda);
  }

  Eigen::VectorXd convex;
  ReducedSystem system;
  Eigen::VectorXd rhs, solution;
};

TEST(LinearSolver, RecomputesTheResidualAndBelievesNoSolver) {
  const SchurFixture fixture;
  LinearSolveOptions options;
  options.relative_tolerance = 1e-6;
  const auto half_done = [&](const LinearSolveOptions&, Eigen::VectorXd* lambda) {
    *lambda = 0.5 * fixture.solution;
    LinearSummary lie;
    lie.true_residual = 1e-9;
    lie.energy = 1e-9;
    return lie;
  };
  LinearSummary summary = fixture.Solve(FakeSolver(half_done), options);
  EXPECT_EQ(summary.termination, LinearTermination::kStagnated);
  EXPECT_NEAR(summary.true_residual, 0.5, 1e-6);
  options.rough = {{.energy = 1e-2, .residual = 1e-3}};
  summary = fixture.Solve(FakeSolver(half_done), options);
  EXPECT_EQ(summary.termination, LinearTermination::kStagnated) << "a rough solve is checked as well";
  EXPECT_NEAR(summary.true_residual, 0.5, 1e-6);
  // The same solution is good enough where so much may be left, in each entry and in all.
  const double sum = (0.5 * fixture.rhs).lpNorm<1>();
  for (const auto& [left, termination] :
       {std::pair(std::numeric_limits<double>::infinity(), LinearTermination::kConverged),
        std::pair(0.11 * sum, LinearTermination::kStagnated), std::pair(1.1 * sum, LinearTermination::kConverged)}) {
    options.rough = {{.energy = 1e-2, .residual = 2, .residual_sum = left}};
    EXPECT_EQ(fixture.Solve(FakeSolver(half_done), options).termination, termination) << left / sum;
  }
}

TEST(LinearSolver, RecomputesTheEnergyThatWasTaken) {
  const SchurFixture fixture;
  LinearSolveOptions options;
  options.rough = {{.energy = 1e-2, .residual = 10}};
  const double energy = fixture.solution.dot(fixture.rhs);
  double claimed = 0.75 * energy;  // half of the solution takes three quarters of the energy
  const LinearSolver solver = FakeSolver([&](const LinearSolveOptions&, Eigen::VectorXd* lambda) {
    *lambda = 0.5 * fixture.solution;
    LinearSummary summary;
    summary.energy = 1e-3;
    summary.energy_taken = claimed;
    return summary;
  });
  EXPECT_EQ(fixture.Solve(solver, options).termination, LinearTermination::kConverged);
  claimed = energy;
  EXPECT_EQ(fixture.Solve(solver, options).termination, LinearTermination::kStagnated);
}

TEST(LinearSolver, SaysNothingOfSolvesThatSayTheyFailed) {
  const SchurFixture fixture;
  for (const auto termination : {LinearTermination::kIterationLimit, LinearTermination::kIndefinite}) {
    const LinearSummary summary = fixture.Solve(FakeSolver([&](const LinearSolveOptions&, Eigen::VectorXd*) {
                                                  LinearSummary failed;
                                                  failed.termination = termination;
                                                  failed.iterations = 7;
                                                  return failed;
                                                }),
                                                {});
    EXPECT_EQ(summary.termination, termination);
    EXPECT_EQ(summary.true_residual, 1) << "of lambda = 0";
    EXPECT_EQ(Describe(summary),
              std::string(Name(termination)) + " after 7 iterations, residual 1.0e+00 of the right-hand side");
  }
}

TEST(LinearSolver, NonFiniteNumbersAreNoConvergence) {
  const SchurFixture fixture;
  LinearSolveOptions options;
  const LinearSolver solver = FakeSolver([](const LinearSolveOptions&, Eigen::VectorXd* lambda) {
    (*lambda)[3] = std::numeric_limits<double>::quiet_NaN();
    LinearSummary summary;
    summary.energy = 0;
    return summary;
  });
  EXPECT_EQ(fixture.Solve(solver, options).termination, LinearTermination::kStagnated);
  options.rough = {{.energy = 1, .residual = 1e300}};
  EXPECT_EQ(fixture.Solve(solver, options).termination, LinearTermination::kStagnated);
}

// What failed solves lead to in a StepSolver with multigrid, on a chart of `n` x `n` cells.
struct Fallback {
  explicit Fallback(int n)
      : mesh(testing::Hills(n, n, 1.5)),
        topology(DiscTopology(mesh).value()),
        target(MakeTargetAngles(topology, MeasuredAngles(mesh))),
        hessian(2 * target.weight),
        cot(Cotangents(target.angle)),
        solver(topology, SolverType::kUzawa, SystemType::kReduced, PreconditionerType::kAmg) {}

  // The first `failures` solves run into their limits.
  absl::StatusOr<LinearSummary> Solve(int failures) {
    calls = 0;
    solver.set_solver(FakeSolver([this, failures](const LinearSolveOptions& options, Eigen::VectorXd*) {
      LinearSummary summary;
      limits.push_back(options.max_iterations);
      summary.energy = 0;
      if (calls++ >= failures) return summary;
      summary.termination = LinearTermination::kIterationLimit;
      summary.iterations = options.max_iterations;
      return summary;
    }));
    const absl::Status prepared = solver.Prepare(hessian, hessian, cot);
    if (!prepared.ok()) return prepared;
    const ConstraintValues h = EvaluateConstraints(topology, target.angle);
    LinearSolveOptions options;
    options.rough = {{.energy = 1, .residual = 1e300}};
    return solver.Solve(Eigen::VectorXd::Zero(3 * topology.num_faces()), h, options, &step);
  }

  Mesh mesh;
  Topology topology;
  TargetAngles target;
  Eigen::VectorXd hessian, cot;
  StepSolver solver;
  NewtonStep step;
  int calls = 0;
  std::vector<std::int64_t> limits;
};

TEST(StepSolver, TurnsToCholeskyAndSaysWhy) {
  Fallback chart(20);
  const auto summary = chart.Solve(1);
  ASSERT_TRUE(summary.ok()) << summary.status();
  EXPECT_EQ(summary->termination, LinearTermination::kConverged);
  EXPECT_EQ(chart.solver.preconditioner(), PreconditionerType::kCholesky);
  EXPECT_EQ(chart.solver.multigrid_failure(),
            "multigrid: iteration limit after 300 iterations, residual 1.0e+00 of the right-hand side");
  EXPECT_EQ(chart.limits[0], 300);
}

TEST(StepSolver, FactorizesNothingThatNobodyReservedMemoryFor) {
  Fallback chart(160);
  ASSERT_GT(chart.topology.num_faces(), kMostFallbackFaces);
  const auto summary = chart.Solve(1);
  ASSERT_FALSE(summary.ok());
  EXPECT_EQ(ErrorInfoOf(summary.status()).reason, "SOLVER_FAILED");
  EXPECT_THAT(std::string(summary.status().message()),
              ::testing::AllOf(::testing::HasSubstr("multigrid: iteration limit after 3000 iterations"),
                               ::testing::HasSubstr("at most 50000 triangles, this one has 51200"),
                               ::testing::HasSubstr("--seams=auto")));
  EXPECT_EQ(chart.limits[0], 3000) << "multigrid has longer where nothing can take over";
  EXPECT_EQ(chart.solver.preconditioner(), PreconditionerType::kAmg);
}

// A random positive definite matrix with the pattern of a mesh.
BlockMatrix<double> MeshMatrix(const StepFixture& fixture, ReducedMatrix<double>* storage) {
  Eigen::VectorXd convex = fixture.hessian;
  Convexify(2 * fixture.target.weight, Convexification::kByFace, &convex);
  return storage->Assemble(convex, fixture.cot);
}

TEST(SparseCholesky, SolvesToRounding) {
  const StepFixture fixture;
  ReducedMatrix<double> storage(fixture.topology);
  BlockMatrix<double> matrix = MeshMatrix(fixture, &storage);
  SparseCholesky cholesky;
  EXPECT_EQ(cholesky.bytes(), 0);
  Eigen::VectorXd x, product;
  const Eigen::VectorXd rhs = Eigen::VectorXd::LinSpaced(2 * matrix.num_rows(), -3, 5);
  for (int i = 0; i < 3; ++i) {  // the second and third with the order and the pattern of the first
    ASSERT_TRUE(cholesky.Factorize(matrix).ok());
    cholesky.Solve(rhs, &x);
    Multiply(matrix, x, &product);
    EXPECT_LT((product - rhs).norm(), 1e-10 * rhs.norm());
    for (double& value : matrix.value) value *= 1.5;
  }
  EXPECT_GT(cholesky.bytes(), 36 * matrix.num_rows());
  EXPECT_LT(cholesky.bytes(), 36 * 20 * matrix.num_rows());
}

TEST(SparseCholesky, TakesAMatrixOfAnotherPattern) {
  BlockMatrix<double> diagonal;  // with a second pattern below
  for (std::int32_t i = 0; i < 4; ++i) {
    diagonal.column.push_back(i);
    diagonal.value.insert(diagonal.value.end(), {4, 1, 1, 3});
    diagonal.row_begin.push_back(i + 1);
  }
  SparseCholesky cholesky;
  ASSERT_TRUE(cholesky.Factorize(diagonal).ok());
  Eigen::VectorXd x;
  cholesky.Solve(Eigen::VectorXd::Ones(8), &x);
  EXPECT_NEAR(x[0], 2.0 / 11, 1e-15);
  EXPECT_NEAR(x[7], 3.0 / 11, 1e-15);
  const StepFixture fixture;
  ReducedMatrix<double> storage(fixture.topology);
  const BlockMatrix<double> matrix = MeshMatrix(fixture, &storage);
  ASSERT_TRUE(cholesky.Factorize(matrix).ok());
  const Eigen::VectorXd rhs = Eigen::VectorXd::Ones(2 * matrix.num_rows());
  Eigen::VectorXd product;
  cholesky.Solve(rhs, &x);
  Multiply(matrix, x, &product);
  EXPECT_LT((product - rhs).norm(), 1e-10 * rhs.norm());
  BlockMatrix<double> nothing;
  ASSERT_TRUE(SparseCholesky().Factorize(nothing).ok());
}

TEST(SparseCholesky, ReportsAnIndefiniteMatrixAndRecovers) {
  const StepFixture fixture;
  ReducedMatrix<double> storage(fixture.topology);
  BlockMatrix<double> matrix = MeshMatrix(fixture, &storage);
  SparseCholesky cholesky;
  const std::vector<double> good = matrix.value;
  for (const double bad : {-1.0, 0.0, std::numeric_limits<double>::quiet_NaN()}) {
    for (double& value : matrix.value) value *= bad;
    EXPECT_EQ(cholesky.Factorize(matrix).code(), absl::StatusCode::kFailedPrecondition);
    matrix.value = good;
    EXPECT_TRUE(cholesky.Factorize(matrix).ok());
  }
}

TEST(SparseCholesky, KeepsToItsMemory) {
  const StepFixture fixture;
  ReducedMatrix<double> storage(fixture.topology);
  const BlockMatrix<double> matrix = MeshMatrix(fixture, &storage);
  SparseCholesky cholesky;
  ASSERT_TRUE(cholesky.Factorize(matrix).ok());
  const std::int64_t bytes = cholesky.bytes();
  cholesky.set_max_bytes(bytes - 1);
  const absl::Status refused = cholesky.Factorize(matrix);
  EXPECT_EQ(refused.code(), absl::StatusCode::kResourceExhausted);
  EXPECT_THAT(std::string(refused.message()), ::testing::HasSubstr("are reserved for it"));
  EXPECT_EQ(cholesky.bytes(), 0);
  cholesky.set_max_bytes(bytes);
  EXPECT_TRUE(cholesky.Factorize(matrix).ok());
}

TEST(PatchedPreconditioner, SaysWhyAPatchHasNoFactor) {
  const StepFixture fixture;
  ReducedMatrix<float> storage(fixture.topology);
  BlockMatrix<float> matrix = storage.Assemble(2 * fixture.target.weight, fixture.cot);
  const auto patched = [&](std::int64_t max_bytes) {
    return PatchedPreconditioner(IdentityPreconditioner(), matrix, {0, 1, 2}, max_bytes).status().code();
  };
  EXPECT_EQ(patched(1 << 20), absl::StatusCode::kOk);
  EXPECT_EQ(patched(1), absl::StatusCode::kResourceExhausted);
  for (float& value : matrix.value) value = -value;
  EXPECT_EQ(patched(1 << 20), absl::StatusCode::kFailedPrecondition);
}

}  // namespace
}  // namespace planish
