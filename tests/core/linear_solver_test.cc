// One conformance suite that every combination of solver, system and preconditioner runs through.
#include <tuple>

#include "Eigen/Dense"
#include "core/abf/flatten.h"
#include "core/abf/step_solver.h"
#include "core/mesh/angles.h"
#include "core/mesh/disc_check.h"
#include "gtest/gtest.h"
#include "tests/core/shapes.h"

namespace planish {
namespace {

using Combination = std::tuple<SolverType, SystemType, PreconditionerType>;

// A Newton step of a bumpy surface, away from the first iterate.
struct StepFixture {
  StepFixture() : topology(CheckDisc(mesh).value()), target(MakeTargetAngles(topology, MeasuredAngles(mesh))) {
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
  const LinearSummary summary = solver.Solve(fixture_.gradient, fixture_.h, options, &step);
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
  const LinearSummary summary = solver.Solve(fixture_.gradient, fixture_.h, options, &step);
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
  options.interrupter = &interrupter;
  options.relative_tolerance = 1e-11;
  std::vector<std::int64_t> reported;
  options.on_progress = [&](std::int64_t iterations, double residual) {
    reported.push_back(iterations);
    EXPECT_GT(residual, 0);
    if (iterations == kProgressInterval) interrupter.Interrupt();
  };
  NewtonStep step;
  LinearSummary summary = solver.Solve(fixture_.gradient, fixture_.h, options, &step);
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
  summary = solver.Solve(fixture_.gradient, fixture_.h, options, &step);
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
      solver.Solve(Eigen::VectorXd::Zero(fixture_.x.size()), zero, LinearSolveOptions(), &step);
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
  const LinearSummary summary = solver.Solve(fixture_.gradient, fixture_.h, options, &step);
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
  const LinearSummary summary = MakeUzawaSolver()->Solve(system, IdentityPreconditioner(), fixture.gradient,
                                                         fixture.h.pair, LinearSolveOptions(), &solution);
  EXPECT_EQ(summary.termination, LinearTermination::kIndefinite);
}

TEST(SparseCholesky, ReportsAnIndefiniteMatrixAndRecovers) {
  SparseMatrix matrix(4, 4);
  matrix.setIdentity();
  matrix.coeffRef(2, 2) = -1;
  SparseCholesky cholesky;
  EXPECT_EQ(cholesky.Factorize(matrix, 2).code(), absl::StatusCode::kFailedPrecondition);
  matrix.coeffRef(2, 2) = 4;
  ASSERT_TRUE(cholesky.Factorize(matrix, 2).ok());
  Eigen::VectorXd x;
  cholesky.Solve(Eigen::VectorXd::Ones(4), &x);
  EXPECT_EQ(x, Eigen::Vector4d(1, 1, 0.25, 1));
}

}  // namespace
}  // namespace planish
