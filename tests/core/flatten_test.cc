#include "core/abf/flatten.h"

#include <cmath>
#include <functional>
#include <limits>
#include <memory>
#include <numbers>

#include "core/abf/layout.h"
#include "core/abf/newton.h"
#include "core/abf/objective.h"
#include "core/abf/topology.h"
#include "core/base/error.h"
#include "core/mesh/angles.h"
#include "gtest/gtest.h"
#include "tests/core/every_solver.h"
#include "tests/core/shapes.h"
#include "tests/testing/discs.h"

namespace planish {
namespace {

struct Disc {
  explicit Disc(const Mesh& mesh)
      : topology(DiscTopology(mesh).value()), target(MakeTargetAngles(topology, MeasuredAngles(mesh))) {}
  Flattening Flatten(const FlattenOptions& options = {}) const {
    return FlattenAngles(topology, target, options, {}).value();
  }
  Topology topology;
  TargetAngles target;
};

TEST(Flatten, MeetsEveryToleranceOnCurvedSurfaces) {
  for (const Mesh& mesh : {testing::Hills(20, 18, 2), testing::PuncturedSphere(12, 1.0), testing::Cone(9, 1.5),
                           testing::HalfCylinder(12, 8, 0.25), testing::Cone(3, 2)}) {
    const Flattening result = Disc(mesh).Flatten();
    EXPECT_TRUE(result.summary.converged) << result.summary.stop_message;
    EXPECT_LE(result.summary.residual.Max(), 1e-9);
    EXPECT_GT(result.angles.minCoeff(), 0);
    EXPECT_LT(result.angles.maxCoeff(), std::numbers::pi);
  }
}

TEST(Flatten, ResidualFallsQuadratically) {
  const Disc disc(testing::Hills(20, 18, 1.5));
  std::vector<double> residuals;
  FlattenControl control;
  control.on_progress = [&](const FlattenProgress& progress) {
    if (progress.linear_residual == 0 && progress.newton_iteration == static_cast<int>(residuals.size())) {
      residuals.push_back(progress.residual.Max());
    }
  };
  FlattenOptions options;
  options.tolerance = 1e-12;
  options.solver = SolverType::kDirect;
  ASSERT_TRUE(FlattenAngles(disc.topology, disc.target, options, control)->summary.converged);
  ASSERT_GE(residuals.size(), 4u);
  // The order log(r_{k+1} / r_k) / log(r_k / r_{k-1}) of the last step above the rounding level.
  std::size_t k = residuals.size() - 1;
  while (residuals[k] < 1e-13 && k > 3) --k;
  const double constant = residuals[k - 1] / (residuals[k - 2] * residuals[k - 2]);
  EXPECT_LT(residuals[k], 10 * constant * residuals[k - 1] * residuals[k - 1] + 1e-13)
      << residuals[k - 2] << " " << residuals[k - 1] << " " << residuals[k];
  EXPECT_LT(residuals[k] / residuals[k - 1], 1e-3) << "a wrong Hessian falls by a constant factor";
}

// All of its solves were said to have failed, with residuals of 1e-15: it tells no energy, for which rough tolerances
// ask.
TEST(Flatten, SolvesOfTheDirectSolverCountAsSuccessful) {
  FlattenOptions options;
  options.solver = SolverType::kDirect;
  for (const Mesh& mesh : {testing::Hills(20, 18, 1.5), testing::PuncturedSphere(12, 1.0), testing::Cone(9, 1.5)}) {
    const Flattening result = Disc(mesh).Flatten(options);
    EXPECT_TRUE(result.summary.converged);
    EXPECT_GT(result.summary.linear_solves, 0);
    EXPECT_EQ(result.summary.linear_failures, 0) << result.summary.linear_failure;
  }
}

TEST(Flatten, ForcingTermsSaveLinearIterations) {
  const Disc disc(testing::Hills(20, 18, 1.5));
  FlattenOptions options;
  options.preconditioner = PreconditionerType::kJacobi;
  const Flattening forced = disc.Flatten(options);
  options.linear_tolerance = 1e-8;
  const Flattening fixed = disc.Flatten(options);
  ASSERT_TRUE(forced.summary.converged && fixed.summary.converged);
  EXPECT_LT((fixed.angles - forced.angles).cwiseAbs().maxCoeff(), 1e-7);
  EXPECT_LE(fixed.summary.newton_iterations, forced.summary.newton_iterations);
  EXPECT_GT(fixed.summary.linear_iterations, 1.2 * forced.summary.linear_iterations);
  options.linear_tolerance = 0.5;
  EXPECT_FALSE(options.Validate().ok());
}

TEST(Flatten, EverySolverFindsTheSameAngles) {
  const Disc disc(testing::PuncturedSphere(9, 0.8));
  const Eigen::VectorXd expected = disc.Flatten().angles;
  for (const FlattenOptions& options : testing::EverySolver()) {
    const Flattening result = disc.Flatten(options);
    EXPECT_TRUE(result.summary.converged) << result.summary.stop_message;
    EXPECT_EQ(result.summary.solver, options.solver);
    EXPECT_EQ(result.summary.system, options.system);
    EXPECT_LT((result.angles - expected).cwiseAbs().maxCoeff(), 1e-6)
        << Name(options.solver) << " " << Name(options.system) << " " << Name(options.preconditioner);
  }
}

TEST(Flatten, EveryHessianFindsTheSameAngles) {
  const Disc disc(testing::Hills(14, 14, 5));
  FlattenOptions options;
  options.hessian = HessianType::kConvex;
  const Flattening convex = disc.Flatten(options);
  EXPECT_TRUE(convex.summary.converged) << convex.summary.stop_message;
  ASSERT_GT(convex.summary.convexified_iterations, 0) << "the example must need the convexified Hessian";
  EXPECT_EQ(convex.summary.indefinite_iterations, 0);
  options.hessian = HessianType::kExact;
  const Flattening exact = disc.Flatten(options);
  EXPECT_EQ(exact.summary.solver, SolverType::kMinres);
  EXPECT_TRUE(exact.summary.converged) << exact.summary.stop_message;
  EXPECT_GT(exact.summary.indefinite_iterations, 0);
  EXPECT_LT((exact.angles - convex.angles).cwiseAbs().maxCoeff(), 1e-6);
  const Flattening automatic = disc.Flatten();
  EXPECT_TRUE(automatic.summary.converged) << automatic.summary.stop_message;
  EXPECT_GT(automatic.summary.indefinite_iterations, 0);
  EXPECT_LT(automatic.summary.newton_iterations, convex.summary.newton_iterations) << "quadratic, not linear";
  EXPECT_LT((automatic.angles - convex.angles).cwiseAbs().maxCoeff(), 1e-6);
}

TEST(Flatten, KeepsABarrierWhereTheEnergyHasNoMinimum) {
  // Closing the sphere drives the outer angles to 0 without a minimum.
  const Disc disc(testing::PuncturedSphere(10, 0.1));
  const Flattening result = disc.Flatten();
  EXPECT_TRUE(result.summary.converged) << result.summary.stop_message;
  EXPECT_GT(result.summary.barrier, 0);
  EXPECT_LE(result.summary.residual.Max(), 1e-9);
  EXPECT_GT((result.angles.array() / disc.target.angle.array()).minCoeff(), 1e-4);
  EXPECT_NE(result.summary.stop_message.find("with a barrier of 0.01"), std::string::npos);
  EXPECT_EQ(Disc(testing::PuncturedSphere(10, 0.5)).Flatten().summary.barrier, 0);
}

TEST(Flatten, StartsWithTrianglesOfTheLeastEnergy) {
  for (const Mesh& mesh : {testing::PuncturedSphere(10, 0.01), testing::Hills(10, 9, 2)}) {
    const Disc disc(mesh);
    const Eigen::VectorXd start = StartingAngles(disc.target);
    EXPECT_GT(start.minCoeff(), 0);
    for (Eigen::Index f = 0; f < start.size(); f += 3) {
      EXPECT_NEAR(start.segment<3>(f).sum(), std::numbers::pi, 1e-12);
      // The gradient of f is the same along all three: that of the sum.
      const Eigen::Vector3d gradient =
          disc.target.weight.segment<3>(f).cwiseProduct(start.segment<3>(f) - disc.target.angle.segment<3>(f));
      EXPECT_LT((gradient.array() - gradient.mean()).abs().maxCoeff(), 1e-12 * (1 + gradient.cwiseAbs().maxCoeff()));
    }
  }
}

TEST(Flatten, NeedsFewStepsWithABarrierToo) {
  for (const int rings : {6, 10, 20, 40}) {
    for (const double hole : {0.01, 0.03}) {
      const Flattening result = Disc(testing::PuncturedSphere(rings, hole)).Flatten();
      EXPECT_TRUE(result.summary.converged) << result.summary.stop_message;
      EXPECT_GT(result.summary.barrier, 0) << "the example must need one";
      EXPECT_LE(result.summary.newton_iterations, 15) << rings << " rings, a hole of " << hole;
    }
  }
}

TEST(Flatten, IsAMinimumAmongFeasibleNeighbours) {
  const Disc disc(testing::Hills(10, 9, 2));
  const Flattening result = disc.Flatten();
  // Any other flattening of the same connectivity meets the constraints too, and must cost more.
  const Disc other(testing::Hills(10, 9, 1.9));
  const Eigen::VectorXd elsewhere = other.Flatten().angles;
  const Objective objective(disc.target);
  EXPECT_LT(objective.Energy(result.angles), objective.Energy(elsewhere));
}

TEST(Flatten, DoesNotDependOnPositionAndScale) {
  const Mesh mesh = testing::Hills(12, 10, 1.5);
  const Flattening expected = Disc(mesh).Flatten();
  for (const auto& [scale, offset, tolerance] : {std::tuple{1e-6, 0.0, 1e-9}, {1e6, 0.0, 1e-9}, {1.0, 1e4, 1e-7}}) {
    Mesh moved = mesh;
    for (Vec3& p : moved.positions) p = scale * p + Vec3::Constant(offset);
    const Flattening result = Disc(moved).Flatten();
    EXPECT_TRUE(result.summary.converged);
    EXPECT_LT((result.angles - expected.angles).cwiseAbs().maxCoeff(), tolerance);
  }
}

TEST(Flatten, NoClampChangesSlivers) {
  // Cells a thousand times as wide as high: angles down to a thousandth of a radian, developable.
  Mesh slivers = testing::Patch(6, 40, [](double s, double t) { return Vec3(1000 * 6 * s, 40 * t, 0); });
  const Disc disc(slivers);
  const Flattening result = disc.Flatten();
  EXPECT_TRUE(result.summary.converged);
  EXPECT_LT(((result.angles - disc.target.angle).array() / disc.target.angle.array()).abs().maxCoeff(), 1e-6);
}

TEST(Flatten, WithoutInteriorVertices) {
  Mesh fan = testing::Plane(5, 1);
  const Flattening result = Disc(fan).Flatten();
  EXPECT_TRUE(result.summary.converged);
  for (const auto system : {SystemType::kFull, SystemType::kReduced}) {
    FlattenOptions options;
    options.system = system;
    EXPECT_TRUE(Disc(Mesh{{{0, 0, 0}, {3, 0, 0}, {0, 4, 0}}, {{0, 1, 2}}}).Flatten(options).summary.converged);
  }
}

TEST(Flatten, GivesTheSameBytesEveryTime) {
  const Disc disc(testing::Hills(15, 15, 1.5));
  EXPECT_EQ(disc.Flatten().angles, disc.Flatten().angles);
}

TEST(Flatten, TellsTheResidualOfEveryStep) {
  std::vector<float> residuals;
  FlattenControl control;
  control.on_progress = [&](const FlattenProgress& progress) {
    residuals.resize(static_cast<std::size_t>(progress.newton_iteration) + 1);
    residuals.back() = static_cast<float>(progress.residual.Max());
  };
  const Disc disc(testing::Hills(12, 10, 2));
  const Flattening result = FlattenAngles(disc.topology, disc.target, {}, control).value();
  EXPECT_GT(result.summary.newton_iterations, 3);
  EXPECT_EQ(static_cast<int>(result.summary.residuals.size()), result.summary.newton_iterations + 1);
  EXPECT_EQ(result.summary.residuals, residuals);
  EXPECT_EQ(result.summary.residuals.back(), static_cast<float>(result.summary.residual.Max()));
}

TEST(Flatten, StopsAtTheIterationLimitAndSaysSo) {
  FlattenOptions options;
  options.max_newton_iterations = 1;
  const Flattening result = Disc(testing::Hills(12, 10, 2)).Flatten(options);
  EXPECT_FALSE(result.summary.converged);
  EXPECT_EQ(result.summary.newton_iterations, 1);
  EXPECT_NE(result.summary.stop_message.find("iteration limit reached after 1 Newton steps"), std::string::npos)
      << result.summary.stop_message;
}

// Such charts are cut: another solver, or another hundred iterations, would be for nothing.
TEST(Flatten, EndsAtAHardSystemIfTheCallerGivesUp) {
  const Disc disc(testing::Hills(30, 30, 1.5));
  FlattenOptions options;
  options.preconditioner = PreconditionerType::kAmg;
  options.tuning.step.iterations_to_give_up = 1;
  FlattenControl control;
  const auto run = [&] { return FlattenAngles(disc.topology, disc.target, options, control)->summary; };
  EXPECT_TRUE(run().converged) << "nobody gives up";
  control.gives_up = true;
  const FlattenSummary given_up = run();
  EXPECT_FALSE(given_up.converged);
  EXPECT_EQ(given_up.linear_iterations, 1);
  EXPECT_FALSE(given_up.preconditioner_changed);
  options.preconditioner = PreconditionerType::kJacobi;
  EXPECT_TRUE(run().converged) << "without multigrid, many iterations are to be expected";
  options.preconditioner = PreconditionerType::kAmg;
  options.linear_tolerance = 1e-6;
  EXPECT_TRUE(run().converged) << "a tolerance of one's own takes what it takes";
}

// A barrier that does not pay ends a solve like any other work beyond what is allowed; the summary says so.
TEST(Flatten, EndsWhereItWouldTakeTooMuchWork) {
  const Disc disc(testing::PuncturedSphere(16, 0.02));
  for (const BoundaryType boundary : {BoundaryType::kFree, BoundaryType::kConvex}) {
    FlattenOptions options;
    options.boundary = boundary;
    FlattenControl control;
    const auto run = [&] { return *FlattenAngles(disc.topology, disc.target, options, control); };
    const Flattening whole = run();
    ASSERT_TRUE(whole.summary.converged);
    EXPECT_FALSE(whole.summary.out_of_work);
    EXPECT_GE(whole.summary.work, whole.summary.linear_iterations + whole.summary.newton_iterations);
    control.most_work = whole.summary.work + 1;
    EXPECT_EQ(run().angles, whole.angles) << "a limit that is not reached changes nothing";
    control.most_work = whole.summary.work / 2;
    const FlattenSummary given_up = run().summary;
    EXPECT_TRUE(given_up.out_of_work);
    EXPECT_FALSE(given_up.converged);
    EXPECT_LT(given_up.work, control.most_work + 100) << "a step more, or a set";
    EXPECT_THAT(given_up.stop_message, ::testing::HasSubstr("too much work"));
    EXPECT_EQ(given_up.linear_failures, whole.summary.linear_failures) << "the limit is no failure";
  }
}

TEST(Flatten, ReportsThePreconditionerThatTheSizeChose) {
  const Disc disc(testing::Hills(30, 30, 1.5));
  FlattenOptions options;
  options.tuning.step.multigrid_faces = disc.topology.num_faces();
  EXPECT_EQ(disc.Flatten(options).summary.preconditioner, PreconditionerType::kAmg);
  ++options.tuning.step.multigrid_faces;
  const FlattenSummary below = disc.Flatten(options).summary;
  EXPECT_EQ(below.preconditioner, PreconditionerType::kCholesky);
  EXPECT_FALSE(below.preconditioner_changed) << "the size decided, nothing failed";
}

// The steep sides of these hills have weak faces. The limit is one weak row in so many: all rows may be weak, then next
// to none.
TEST(Flatten, SaysWhatMultigridDidWithout) {
  const Disc hills(testing::Hills(30, 30, 16));
  FlattenOptions options;
  options.preconditioner = PreconditionerType::kAmg;
  options.tuning.step.rows_per_weak_row = 1;
  const FlattenSummary whole = hills.Flatten(options).summary;
  EXPECT_EQ(whole.preconditioner_note, "");
  options.tuning.step.rows_per_weak_row = 10000;
  const FlattenSummary part = hills.Flatten(options).summary;
  EXPECT_NE(part.preconditioner_note.find("no exact solves on the vertices of weak faces: there are "),
            std::string::npos)
      << part.preconditioner_note;
  EXPECT_EQ(part.linear_failures, 0);
}

// What a sweep over FlattenTuning relies on: each part gets its own constants.
TEST(Flatten, HandsTheTuningToEveryPart) {
  const Disc hills(testing::Hills(30, 30, 1.5));
  FlattenOptions multigrid;
  multigrid.tuning.multigrid.max_levels = 1;
  multigrid.tuning.multigrid.max_dense_rows = 20;
  const FlattenSummary fallen_back = hills.Flatten(multigrid).summary;
  EXPECT_TRUE(fallen_back.converged && fallen_back.preconditioner_changed) << fallen_back.stop_message;
  EXPECT_NE(fallen_back.multigrid_failure.find("the coarsest level may have 20"), std::string::npos)
      << fallen_back.multigrid_failure;

  FlattenOptions linear;
  linear.tuning.linear.energy_slack = -1;  // no solve is believed
  EXPECT_EQ(hills.Flatten().summary.linear_failures, 0);
  EXPECT_GT(hills.Flatten(linear).summary.linear_failures, 0);

  FlattenOptions newton;
  newton.tuning.newton.barrier.weakest = 0.02;
  EXPECT_EQ(Disc(testing::PuncturedSphere(10, 0.01)).Flatten(newton).summary.barrier, 0.02);

  FlattenOptions boundary;
  boundary.boundary = BoundaryType::kConvex;
  EXPECT_GT(hills.Flatten(boundary).summary.boundary.set_changes, 1);
  boundary.tuning.boundary.max_set_changes = 1;
  EXPECT_EQ(hills.Flatten(boundary).summary.boundary.set_changes, 1);
}

TEST(Flatten, OneNewtonStepIsAlreadyClose) {
  const Disc disc(testing::Hills(16, 16, 1));
  FlattenOptions one;
  one.max_newton_iterations = 1;
  const Objective objective(disc.target);
  const double best = objective.Energy(disc.Flatten().angles), first = objective.Energy(disc.Flatten(one).angles);
  EXPECT_NEAR(first / best, 1, 0.05);
}

TEST(Flatten, CanBeInterruptedAtAnyProgressPoint) {
  const Disc disc(testing::PuncturedSphere(40, 0.6));
  FlattenOptions options;
  options.system = SystemType::kFull;
  options.preconditioner = PreconditionerType::kNone;
  int points = 0;
  FlattenControl count;
  count.on_progress = [&](const FlattenProgress&) { ++points; };
  ASSERT_TRUE(FlattenAngles(disc.topology, disc.target, options, count).ok());
  ASSERT_GT(points, 20);
  for (const int at : {0, 1, points / 2, points - 2}) {
    Interrupter interrupter;
    int seen = 0;
    FlattenControl control;
    control.cancel = &interrupter;
    control.on_progress = [&](const FlattenProgress&) {
      if (seen++ == at) interrupter.Interrupt();
    };
    const auto result = FlattenAngles(disc.topology, disc.target, options, control);
    EXPECT_EQ(result.status().code(), absl::StatusCode::kCancelled) << at;
    EXPECT_LE(seen, at + 2) << "went on after the interrupt";
  }
}

TEST(FlattenOptions, NameTheFieldThatIsWrong) {
  const auto field = [](const FlattenOptions& options) {
    const ErrorInfo info = ErrorInfoOf(options.Validate());
    return info.reason == "OPTIONS_INVALID" ? info.metadata.at("field") : "";
  };
  EXPECT_EQ(field({}), "");
  EXPECT_EQ(field({.tolerance = 0}), "tolerance");
  EXPECT_EQ(field({.tolerance = NAN}), "tolerance");
  EXPECT_EQ(field({.tolerance = 0.1}), "tolerance");
  EXPECT_EQ(field({.max_newton_iterations = 0}), "max_newton_iterations");
  EXPECT_EQ(field({.solver = SolverType::kDirect, .system = SystemType::kFull}), "system");
  EXPECT_EQ(field({.solver = SolverType::kDirect, .preconditioner = PreconditionerType::kJacobi}), "preconditioner");
  EXPECT_EQ(field({.system = SystemType::kFull, .preconditioner = PreconditionerType::kCholesky}), "preconditioner");
  EXPECT_EQ(field({.solver = SolverType::kUzawa, .hessian = HessianType::kExact}), "hessian");
}

TEST(Layout, ClosesEveryTriangleEvenWhenTheScaleVaries) {
  for (const double hole : {1.5, 0.6}) {
    const Mesh mesh = testing::PuncturedSphere(14, hole);
    const Disc disc(mesh);
    const Flattening flattening = disc.Flatten();
    ASSERT_TRUE(flattening.summary.converged);
    const std::vector<Vec2> at = LayOut(disc.topology, flattening.angles);
    for (std::int32_t c = 0; c < disc.topology.num_corners(); ++c) {
      const Face& face = mesh.faces[c / 3];
      const int k = c % 3;
      EXPECT_NEAR(testing::AngleAt(at[face[k]], at[face[Next(k)]], at[face[Prev(k)]]), flattening.angles[c], 1e-6);
    }
  }
}

// Solves with what it is told to do to the results, number by number.
using Fault = std::function<void(int solve, LinearSummary* summary, Eigen::VectorXd* lambda)>;
LinearSolver FaultySolver(Fault fault) {
  return [fault = std::move(fault), solves = 0](const SaddlePointOperator& system, const Preconditioner& preconditioner,
                                                const Eigen::VectorXd& rhs, const LinearSolveOptions& options,
                                                Eigen::VectorXd* lambda) mutable {
    LinearSummary summary = SolveSchur(MakeUzawaSolver(), system, preconditioner, rhs, options, lambda);
    fault(solves++, &summary, lambda);
    return summary;
  };
}

struct FaultyRun {
  explicit FaultyRun(Fault fault) : disc(testing::Hills(12, 10, 1.5)) {
    options.solver = SolverType::kUzawa;
    options.system = SystemType::kReduced;
    options.preconditioner = PreconditionerType::kCholesky;
    options.hessian = HessianType::kConvex;
    control.on_progress = [this](const FlattenProgress& progress) {
      if (progress.linear_residual == 0) steps.push_back(progress.step_length);
    };
    Newton newton(disc.topology, disc.target, options, control);
    newton.step_solver().set_solver(FaultySolver(std::move(fault)));
    summary = newton.Run();
  }
  Disc disc;
  FlattenOptions options;
  FlattenControl control;
  std::vector<double> steps;
  absl::StatusOr<FlattenSummary> summary;
};

TEST(Newton, CountsLinearSolvesThatFailAndKeepsTheReason) {
  const FaultyRun run([](int solve, LinearSummary* summary, Eigen::VectorXd*) {
    if (solve == 1) {
      summary->termination = LinearTermination::kIterationLimit;
      summary->iterations = LinearSolveOptions().max_iterations;
    }
    if (solve == 2) summary->termination = LinearTermination::kIndefinite;
  });
  ASSERT_TRUE(run.summary.ok()) << run.summary.status();
  EXPECT_TRUE(run.summary->converged);
  EXPECT_GE(run.summary->linear_solves, 4);
  EXPECT_EQ(run.summary->linear_failures, 2);
  EXPECT_TRUE(run.summary->linear_failure.starts_with("Newton step 2: iteration limit after 100000 iterations"))
      << run.summary->linear_failure;
}

TEST(Newton, CountsNothingWhereNothingFails) {
  const FaultyRun run([](int, LinearSummary*, Eigen::VectorXd*) {});
  ASSERT_TRUE(run.summary.ok()) << run.summary.status();
  EXPECT_TRUE(run.summary->converged);
  EXPECT_EQ(run.summary->linear_failures, 0);
  EXPECT_EQ(run.summary->linear_failure, "");
}

// A solve that gives no step, after one that was taken whole: the length of that one must not be taken for its own.
TEST(Newton, AFailedStepHasNoLength) {
  const FaultyRun run([](int solve, LinearSummary*, Eigen::VectorXd* lambda) {
    if (solve == 2) lambda->setConstant(std::numeric_limits<double>::quiet_NaN());
  });
  ASSERT_TRUE(run.summary.ok()) << run.summary.status();
  EXPECT_TRUE(run.summary->converged) << "the step is computed again, exactly";
  EXPECT_EQ(run.summary->linear_failures, 1);
  ASSERT_GE(run.steps.size(), 5u);
  EXPECT_EQ(run.steps[0], 0) << "before the first step";
  EXPECT_EQ(run.steps[1], 1);
  EXPECT_EQ(run.steps[2], 1);
  EXPECT_EQ(run.steps[3], 0) << "the failed one";
  EXPECT_EQ(run.steps[4], 1);
}

}  // namespace
}  // namespace planish
