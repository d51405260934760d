// The wheel condition in its product forms, against finite differences, and the whole matrix of eq. 5.
#include "tests/core/kkt.h"

#include <cmath>
#include <random>
#include <string>

#include "Eigen/Dense"
#include "core/abf/topology.h"
#include "core/mesh/angles.h"
#include "gtest/gtest.h"
#include "tests/core/differences.h"
#include "tests/core/shapes.h"
#include "tests/testing/discs.h"

namespace planish {
namespace {

constexpr WheelForm kForms[] = {WheelForm::kLogarithm, WheelForm::kProduct, WheelForm::kDifference};

struct KktDisc {
  explicit KktDisc(const Mesh& mesh)
      : topology(DiscTopology(mesh).value()), target(MakeTargetAngles(topology, MeasuredAngles(mesh))) {
    std::mt19937 random(5);
    std::uniform_real_distribution<double> unit(-1, 1);
    x = target.angle;
    for (double& angle : x) angle *= 1 + 0.1 * unit(random);
    mu = Multipliers::Zero(topology);
    for (double& m : mu.triangle) m = unit(random);
    for (double& m : mu.pair) m = 0.3 * unit(random);
  }

  Eigen::VectorXd Values(const Eigen::VectorXd& at, WheelForm form) const {
    const ConstraintValues h = EvaluateConstraints(topology, at, form);
    Eigen::VectorXd all(h.triangle.size() + h.pair.size());
    all << h.triangle, h.pair;
    return all;
  }
  // grad_x L by the Jacobian.
  Eigen::VectorXd Gradient(const Eigen::VectorXd& at, WheelForm form) const {
    Eigen::VectorXd all(mu.triangle.size() + mu.pair.size());
    all << mu.triangle, mu.pair;
    return objective.Gradient(at) + ConstraintJacobian(topology, at, form).transpose() * all;
  }

  Topology topology;
  TargetAngles target;
  Objective objective{target};
  Eigen::VectorXd x;
  Multipliers mu;
};

class EveryWheelForm : public ::testing::TestWithParam<WheelForm> {};

TEST_P(EveryWheelForm, JacobianIsTheDerivativeOfTheConstraints) {
  const KktDisc disc(testing::Hills(7, 6));
  const Eigen::MatrixXd jacobian = ConstraintJacobian(disc.topology, disc.x, GetParam());
  const Eigen::MatrixXd expected =
      testing::Differences([&](const Eigen::VectorXd& at) { return disc.Values(at, GetParam()); }, disc.x);
  EXPECT_LT((jacobian - expected).cwiseAbs().maxCoeff(), 1e-8);
}

TEST_P(EveryWheelForm, GradientIsTheDerivativeOfTheLagrangian) {
  const KktDisc disc(testing::Hills(7, 6));
  Eigen::VectorXd mu(disc.mu.triangle.size() + disc.mu.pair.size());
  mu << disc.mu.triangle, disc.mu.pair;
  const auto lagrangian = [&](const Eigen::VectorXd& at) {
    return Eigen::VectorXd::Constant(1, disc.objective.Value(at) + mu.dot(disc.Values(at, GetParam())));
  };
  const Eigen::VectorXd expected = testing::Differences(lagrangian, disc.x).transpose();
  EXPECT_LT((disc.Gradient(disc.x, GetParam()) - expected).cwiseAbs().maxCoeff(), 2e-7);
}

TEST_P(EveryWheelForm, HessianIsTheDerivativeOfTheGradient) {
  const KktDisc disc(testing::Hills(7, 6));
  const Eigen::MatrixXd hessian = LagrangianHessianMatrix(disc.topology, disc.objective, disc.x, disc.mu, GetParam());
  const Eigen::MatrixXd expected =
      testing::Differences([&](const Eigen::VectorXd& at) { return disc.Gradient(at, GetParam()); }, disc.x);
  EXPECT_LT((hessian - expected).cwiseAbs().maxCoeff(), 2e-7);
  EXPECT_LT((hessian - hessian.transpose()).cwiseAbs().maxCoeff(), 1e-12);
}

TEST_P(EveryWheelForm, NonzerosFollowFromTheValences) {
  for (const Mesh& mesh : {testing::Hills(7, 6), testing::PuncturedSphere(6, 0.8), testing::Cone(9, 1),
                           testing::Cone(3, 1), testing::Hills(2, 2)}) {
    const KktDisc disc(mesh);
    const SparseMatrix kkt =
        KktMatrix(LagrangianHessianMatrix(disc.topology, disc.objective, disc.x, disc.mu, GetParam()),
                  ConstraintJacobian(disc.topology, disc.x, GetParam()));
    EXPECT_EQ(CountKktNonzeros(disc.topology, GetParam()), kkt.nonZeros());
    EXPECT_EQ(kkt.rows(), 3 * mesh.num_faces() + mesh.num_faces() + 2 * disc.topology.num_interior);
  }
}

TEST_P(EveryWheelForm, PlainNewtonFindsTheSameMap) {
  const KktDisc disc(testing::Hills(16, 14, 1.5));
  const Flattening expected = FlattenAngles(disc.topology, disc.target, {.tolerance = 1e-12}, {}).value();
  const KktSolution found = SolveByKkt(disc.topology, disc.target, {.form = GetParam()}).value();
  ASSERT_TRUE(found.converged) << found.residual.Max();
  EXPECT_GT((found.x - disc.target.angle).cwiseAbs().maxCoeff(), 0.01);
  EXPECT_LT((found.x - expected.angles).cwiseAbs().maxCoeff(), 1e-10);
  EXPECT_LE(found.newton_iterations, 12);
}

INSTANTIATE_TEST_SUITE_P(, EveryWheelForm, ::testing::ValuesIn(kForms), [](const auto& tested) {
  return std::string(tested.param == WheelForm::kLogarithm ? "logarithm"
                     : tested.param == WheelForm::kProduct ? "product"
                                                           : "difference");
});

TEST(Kkt, MultipliersOfTheFormsAreMultiplesOfEachOther) {
  const KktDisc disc(testing::Hills(9, 8, 1.2));
  const KktSolution logarithm = SolveByKkt(disc.topology, disc.target, {.form = WheelForm::kLogarithm}).value();
  const KktSolution product = SolveByKkt(disc.topology, disc.target, {.form = WheelForm::kProduct}).value();
  const KktSolution difference = SolveByKkt(disc.topology, disc.target, {.form = WheelForm::kDifference}).value();
  ASSERT_TRUE(logarithm.converged && product.converged && difference.converged);
  const WheelSines sines = EvaluateWheelSines(disc.topology, logarithm.x);
  for (std::int32_t v = 0; v < disc.topology.num_interior; ++v) {
    EXPECT_NEAR(product.mu.pair[2 * v + 1], logarithm.mu.pair[2 * v + 1], 1e-9);
    EXPECT_NEAR(difference.mu.pair[2 * v + 1] * sines.before[v], logarithm.mu.pair[2 * v + 1], 1e-9);
  }
}

// Newton with a wrong Hessian converges too, but linearly.
TEST(Kkt, NewtonOnTheProductFormIsQuadratic) {
  const KktDisc disc(testing::Hills(12, 11, 1.5));
  double before = 0;
  for (int steps = 1; steps <= 12; ++steps) {
    KktOptions options{.form = WheelForm::kProduct, .tolerance = 1e-12, .max_newton_iterations = steps};
    const double residual = SolveByKkt(disc.topology, disc.target, options).value().residual.Max();
    if (before > 0 && before < 1e-2) {
      EXPECT_LT(residual, std::max(20 * before * before, 1e-12)) << steps;
    }
    if (residual <= 1e-12) return;
    before = residual;
  }
  ADD_FAILURE() << "not converged: " << before;
}

}  // namespace
}  // namespace planish
