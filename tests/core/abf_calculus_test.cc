// Every derivative against finite differences, on meshes with many wheels.
#include <cmath>
#include <functional>
#include <numbers>
#include <random>

#include "Eigen/Core"
#include "core/abf/boundary_control.h"
#include "core/abf/constraints.h"
#include "core/abf/full_system.h"
#include "core/abf/lagrangian.h"
#include "core/abf/objective.h"
#include "core/abf/reduced_system.h"
#include "core/abf/topology.h"
#include "core/mesh/angles.h"
#include "gtest/gtest.h"
#include "tests/core/differences.h"
#include "tests/core/kkt.h"
#include "tests/core/shapes.h"
#include "tests/testing/discs.h"

namespace planish {
namespace {

struct Fixture {
  // Every `straight`-th boundary vertex is held straight.
  explicit Fixture(const Mesh& mesh, int straight = 0) : topology(DiscTopology(mesh).value()) {
    target = MakeTargetAngles(topology, MeasuredAngles(mesh));
    if (straight > 0) {
      ActiveSet set(topology, target);
      Eigen::VectorXd pressures(set.num_vertices());
      for (Eigen::Index b = 0; b < pressures.size(); ++b) pressures[b] = b % straight == 0 ? 1 : -1;
      set.Update(pressures, 0, /*only_last=*/false);
      topology = set.ConstrainedTopology();
    }
    std::mt19937 random(3);
    std::uniform_real_distribution<double> unit(-1, 1);
    x = target.angle;
    for (double& angle : x) angle *= 1 + 0.1 * unit(random);
    mu = Multipliers::Zero(topology);
    for (double& m : mu.triangle) m = unit(random);
    for (double& m : mu.pair) m = 0.3 * unit(random);
  }

  Eigen::VectorXd Stacked(const Eigen::VectorXd& at) const {
    const ConstraintValues h = EvaluateConstraints(topology, at);
    Eigen::VectorXd all(h.triangle.size() + h.pair.size());
    all << h.triangle, h.pair;
    return all;
  }
  Eigen::VectorXd StackedMultipliers() const {
    Eigen::VectorXd all(mu.triangle.size() + mu.pair.size());
    all << mu.triangle, mu.pair;
    return all;
  }
  Eigen::VectorXd Gradient(const Eigen::VectorXd& at) const {
    return LagrangianGradient(topology, objective, at, Cotangents(at), mu);
  }

  Topology topology;
  TargetAngles target;
  Objective objective{target};
  Eigen::VectorXd x;
  Multipliers mu;
};

Fixture ManyWheels() {
  return Fixture(testing::Hills(7, 6));
}

Fixture StraightVertices() {
  return Fixture(testing::Hills(7, 6), 3);
}

// With and without boundary control.
class Calculus : public ::testing::TestWithParam<Fixture (*)()> {};
INSTANTIATE_TEST_SUITE_P(Boundaries, Calculus, ::testing::Values(&ManyWheels, &StraightVertices));

TEST(TargetAngles, SumToTwoPiRoundInteriorVertices) {
  const Fixture f = ManyWheels();
  Eigen::VectorXd sum = Eigen::VectorXd::Zero(f.topology.num_interior);
  for (std::int32_t c = 0; c < f.topology.num_corners(); ++c) {
    if (f.topology.corner_row[c] >= 0) sum[f.topology.corner_row[c]] += f.target.angle[c];
  }
  EXPECT_EQ(f.topology.num_interior, 30);
  EXPECT_LT((sum.array() - 2 * std::numbers::pi).abs().maxCoeff(), 1e-14);
}

TEST(TargetAngles, DoNotDependOnTheActiveSet) {
  const Fixture f = StraightVertices();
  const Eigen::VectorXd measured = MeasuredAngles(testing::Hills(7, 6));
  EXPECT_EQ(MakeTargetAngles(f.topology, measured).angle, f.target.angle);
}

TEST(Constraints, AreMetByThePlane) {
  const Fixture f(testing::Plane(6, 5, 0.3));
  EXPECT_LT(f.Stacked(f.target.angle).cwiseAbs().maxCoeff(), 1e-13);
  EXPECT_LT(EvaluateWheelProducts(f.topology, f.target.angle).cwiseAbs().maxCoeff(), 1e-13);
}

TEST(Constraints, ProductAndLogarithmAgree) {
  const Fixture f = ManyWheels();
  const ConstraintValues h = EvaluateConstraints(f.topology, f.x);
  const Eigen::VectorXd product = EvaluateWheelProducts(f.topology, f.x);
  for (std::int32_t v = 0; v < f.topology.num_interior; ++v) {
    EXPECT_NEAR(std::log1p(product[v]), h.pair[2 * v + 1], 1e-12);
  }
}

TEST(Constraints, OfBoundaryVerticesAreTheirAngleSumsAlone) {
  const Fixture f = StraightVertices();
  ASSERT_GE(f.topology.num_rows, f.topology.num_interior + 7);
  const ConstraintValues h = EvaluateConstraints(f.topology, f.x);
  Eigen::VectorXd sum = Eigen::VectorXd::Constant(f.topology.num_rows, -std::numbers::pi);
  for (std::int32_t c = 0; c < f.topology.num_corners(); ++c) {
    if (f.topology.corner_row[c] >= 0) sum[f.topology.corner_row[c]] += f.x[c];
  }
  for (std::int32_t v = f.topology.num_interior; v < f.topology.num_rows; ++v) {
    EXPECT_NEAR(h.pair[2 * v], sum[v], 1e-14);
    EXPECT_EQ(h.pair[2 * v + 1], 0);
  }
}

TEST_P(Calculus, JacobianIsTheDerivative) {
  const Fixture f = GetParam()();
  const Eigen::MatrixXd jacobian = ConstraintJacobian(f.topology, f.x, WheelForm::kLogarithm);
  const Eigen::MatrixXd expected = testing::Differences([&](const Eigen::VectorXd& at) { return f.Stacked(at); }, f.x);
  EXPECT_LT(testing::Distance(jacobian, expected), 1e-8);
}

TEST_P(Calculus, ProductJacobianIsTheDerivative) {
  const Fixture f = GetParam()();
  const Eigen::MatrixXd jacobian = ConstraintJacobian(f.topology, f.x, WheelForm::kProduct);
  const Eigen::MatrixXd expected =
      testing::Differences([&](const Eigen::VectorXd& at) { return EvaluateWheelProducts(f.topology, at); }, f.x);
  for (std::int32_t v = 0; v < f.topology.num_interior; ++v) {
    EXPECT_LT(testing::Distance(jacobian.row(f.topology.num_faces() + 2 * v + 1), expected.row(v)), 1e-8);
  }
}

TEST(Objective, BarrierIsLeastAtTheTargetAndGrowsTowardsZero) {
  const Fixture f = ManyWheels();
  Objective barrier(f.target);
  barrier.set_barrier(0.5);
  EXPECT_NEAR(barrier.Value(f.target.angle), 0, 1e-14);
  EXPECT_LT(barrier.Gradient(f.target.angle).cwiseAbs().maxCoeff(), 1e-14);
  Eigen::VectorXd collapsed = f.target.angle;
  collapsed[0] *= 1e-9;
  EXPECT_GT(barrier.Value(collapsed), f.objective.Value(collapsed) + 0.5 * 19);
}

TEST(BoundMultipliers, BringBackAnglesThatTheBarriersOwnCurvatureOnlyDoubles) {
  Fixture f = ManyWheels();
  BoundMultipliers bounds(f.target, f.objective, Alone());
  EXPECT_EQ(bounds.Curvature(f.x), f.objective.Curvature(f.x)) << "there is no barrier yet";
  f.objective.set_barrier(1e-2);
  // Newton's method on f_tau alone, whose minimum is the target, from angles that have collapsed; no step may take
  // more than most of an angle.
  using Vector = const Eigen::VectorXd&;
  const auto steps = [&](const std::function<Eigen::VectorXd(Vector)>& curvature_at,
                         const std::function<void(Vector, Vector, double)>& follow) {
    Eigen::VectorXd x = 1e-6 * f.target.angle;
    for (int i = 0; i < 60; ++i) {
      const Eigen::VectorXd gradient = f.objective.Gradient(x);
      if (gradient.cwiseAbs().maxCoeff() < 1e-9) return i;
      const Eigen::VectorXd curvature = curvature_at(x);
      EXPECT_GT(curvature.minCoeff(), 0);
      const Eigen::VectorXd step = -gradient.cwiseQuotient(curvature);
      const double length = std::min(1.0, 0.95 / (-step.cwiseQuotient(x)).cwiseMax(1e-9).maxCoeff());
      const Eigen::VectorXd next = x + length * step;
      follow(x, next, length);
      x = next;
    }
    return 60;
  };
  const int primal = steps([&](Vector x) { return f.objective.Curvature(x); }, [](Vector, Vector, double) {});
  const int dual = steps([&](Vector x) { return bounds.Curvature(x); },
                         [&](Vector x, Vector next, double length) { bounds.Follow(x, next, length); });
  EXPECT_GT(primal, 12);
  EXPECT_LT(dual, 10);
  // There they are the barrier's second derivative.
  EXPECT_LT(testing::Distance(bounds.Curvature(f.target.angle), f.objective.Curvature(f.target.angle)), 1e-7);
  f.objective.set_barrier(0.5);
  bounds.set_z({});
  EXPECT_LT(testing::Distance(bounds.Curvature(f.x), f.objective.Curvature(f.x)), 1e-12) << "from the start again";
}

TEST_P(Calculus, GradientIsTheDerivative) {
  Fixture f = GetParam()();
  f.objective.set_barrier(0.3);
  const auto lagrangian = [&](const Eigen::VectorXd& at) {
    return Eigen::VectorXd::Constant(1, f.objective.Value(at) + f.StackedMultipliers().dot(f.Stacked(at)));
  };
  const Eigen::VectorXd expected = testing::Differences(lagrangian, f.x).transpose();
  EXPECT_LT(testing::Distance(f.Gradient(f.x), expected), 2e-7);
}

TEST_P(Calculus, HessianIsTheDerivativeOfTheGradientAndDiagonal) {
  Fixture f = GetParam()();
  f.objective.set_barrier(0.3);
  const Eigen::MatrixXd expected = testing::Differences([&](const Eigen::VectorXd& at) { return f.Gradient(at); }, f.x);
  const Eigen::VectorXd hessian = LagrangianHessian(f.topology, f.objective, f.x, f.mu);
  EXPECT_LT(testing::Distance(Eigen::MatrixXd(hessian.asDiagonal()), expected), 2e-7);
}

// Smallest eigenvalue of diag(a) relative to diag(b) on the plane of zero sum, by formulas for 2 x 2 matrices.
double PlaneEigenvalue(const Eigen::Vector3d& a, const Eigen::Vector3d& b) {
  Eigen::Matrix<double, 3, 2> basis;
  basis << 1, 0, -1, 1, 0, -1;
  const Eigen::Matrix2d pa = basis.transpose() * a.asDiagonal() * basis;
  const Eigen::Matrix2d pb = basis.transpose() * b.asDiagonal() * basis;
  // pb = l l^T; the eigenvalues are those of c = l^-1 pa l^-T.
  const double l00 = std::sqrt(pb(0, 0)), l10 = pb(1, 0) / l00, l11 = std::sqrt(pb(1, 1) - l10 * l10);
  const double c00 = pa(0, 0) / (l00 * l00);
  const double c10 = (pa(1, 0) / l00 - l10 * c00) / l11;
  const double c11 = (pa(1, 1) - 2 * l10 * pa(1, 0) / l00 + l10 * l10 * c00) / (l11 * l11);
  return (c00 + c11) / 2 - std::hypot((c00 - c11) / 2, c10);
}

TEST(Convexify, LiftsJustTheFacesThatNeedIt) {
  const Fixture f = ManyWheels();
  Eigen::VectorXd exact = LagrangianHessian(f.topology, f.objective, f.x, f.mu);
  // Face 0: negative entry, but positive on the plane. Face 1: negative on the plane. Face 2: hopeless.
  const Eigen::VectorXd base = 2 * f.target.weight;
  exact.segment<3>(0) << -0.1 * base[0], 3 * base[1], 3 * base[2];
  exact.segment<3>(3) << -2 * base[3], base[4], base[5];
  exact.segment<3>(6) = -5 * base.segment<3>(6);
  Eigen::VectorXd convex = exact;
  const std::int64_t changed = Convexify(base, Convexification::kByFace, &convex);
  EXPECT_GE(changed, 2);
  EXPECT_EQ(convex.segment<3>(0), exact.segment<3>(0));
  for (std::int32_t face = 0; face < f.topology.num_faces(); ++face) {
    const double before = PlaneEigenvalue(exact.segment<3>(3 * face), base.segment<3>(3 * face));
    const double after = PlaneEigenvalue(convex.segment<3>(3 * face), base.segment<3>(3 * face));
    EXPECT_NEAR(after, std::max(before, ConvexityTuning().min_curvature), 1e-9) << face;
  }
  Eigen::VectorXd by_angle = exact;
  EXPECT_GE(Convexify(base, Convexification::kByAngle, &by_angle), 3);
  EXPECT_GT((by_angle.array() / base.array()).minCoeff(), 0.999 * ConvexityTuning().min_curvature);
}

// Dense matrices of an operator.
Eigen::MatrixXd DenseSchur(const SaddlePointOperator& system) {
  Eigen::MatrixXd schur(system.num_multipliers(), system.num_multipliers());
  Eigen::VectorXd p, h, y;
  for (Eigen::Index i = 0; i < schur.cols(); ++i) {
    system.ApplyBTransposed(Eigen::VectorXd::Unit(schur.cols(), i), &p);
    system.ApplyInverseA(p, &h);
    system.ApplyB(h, &y);
    schur.col(i) = y;
  }
  return schur;
}

// What systems and matrices put on the diagonal for wheel rows that are not there, so that it is positive.
Eigen::VectorXd AbsentRows(const Topology& topology, const Eigen::VectorXd& diagonal) {
  Eigen::VectorXd absent = Eigen::VectorXd::Zero(diagonal.size());
  const Eigen::Index first = diagonal.size() - 2 * topology.num_rows;
  for (std::int32_t v = topology.num_interior; v < topology.num_rows; ++v) {
    absent[first + 2 * v + 1] = diagonal[first + 2 * v];
  }
  return absent;
}

TEST_P(Calculus, FullSystemIsTheMatrixOfThePaper) {
  const Fixture f = GetParam()();
  const Eigen::VectorXd hessian = LagrangianHessian(f.topology, f.objective, f.x, f.mu);
  const FullSystem system(f.topology, hessian, Cotangents(f.x));
  const Eigen::MatrixXd b = ConstraintJacobian(f.topology, f.x, WheelForm::kLogarithm);
  Eigen::MatrixXd scaled = b;
  for (Eigen::Index i = 0; i < hessian.size(); ++i) scaled.col(i) /= hessian[i];
  const Eigen::MatrixXd expected = scaled.lazyProduct(b.transpose());
  const Eigen::MatrixXd schur = DenseSchur(system);
  EXPECT_LT(testing::Distance(schur, expected), 1e-12);
  const Eigen::VectorXd diagonal = schur.diagonal() + AbsentRows(f.topology, schur.diagonal());
  EXPECT_LT(testing::Distance(diagonal, system.SchurDiagonal()), 1e-12);
}

TEST_P(Calculus, ReducedSystemIsTheSchurComplementOfTheFullOneEvenWithZeroEntries) {
  const Fixture f = GetParam()();
  Eigen::VectorXd hessian = LagrangianHessian(f.topology, f.objective, f.x, f.mu);
  const Eigen::VectorXd cot = Cotangents(f.x);
  const ReducedSystem system(f.topology, hessian, cot);
  const Eigen::MatrixXd m = DenseSchur(FullSystem(f.topology, hessian, Cotangents(f.x)));
  const Eigen::Index faces = f.topology.num_faces(), pairs = 2 * f.topology.num_rows;
  // The block of the triangles is diagonal: no two of them share an angle.
  const Eigen::VectorXd triangles = m.diagonal().head(faces);
  ASSERT_EQ(m.topLeftCorner(faces, faces), Eigen::MatrixXd(triangles.asDiagonal()));
  Eigen::MatrixXd scaled = m.topRightCorner(faces, pairs);
  for (Eigen::Index i = 0; i < faces; ++i) scaled.row(i) /= triangles[i];
  const Eigen::MatrixXd coupling = m.bottomLeftCorner(pairs, faces), block = m.bottomRightCorner(pairs, pairs);
  const Eigen::MatrixXd expected = block - Eigen::MatrixXd(coupling.lazyProduct(scaled));
  Eigen::MatrixXd schur = DenseSchur(system);
  EXPECT_LT(testing::Distance(schur, expected), 1e-11);
  schur.diagonal() += AbsentRows(f.topology, schur.diagonal());
  EXPECT_LT(testing::Distance(schur.diagonal(), system.SchurDiagonal()), 1e-12);

  ReducedMatrix matrix(f.topology);
  const BlockMatrix<double>& assembled = matrix.Assemble(hessian, Cotangents(f.x));
  Eigen::MatrixXd dense = Eigen::MatrixXd::Zero(pairs, pairs);
  for (std::int32_t i = 0; i < assembled.num_rows(); ++i) {
    for (std::int32_t k = assembled.row_begin[i]; k < assembled.row_begin[i + 1]; ++k) {
      const double* entry = &assembled.value[4 * static_cast<std::size_t>(k)];
      dense.block<2, 2>(2 * i, 2 * assembled.column[k]) << entry[0], entry[1], entry[2], entry[3];
    }
  }
  EXPECT_LT(testing::Distance(dense, schur), 1e-12);
  const Eigen::VectorXd probe = Eigen::VectorXd::LinSpaced(pairs, -1, 2);
  Eigen::VectorXd product;
  Multiply(assembled, probe, &product);
  EXPECT_LT(testing::Distance(product, schur.lazyProduct(probe)), 1e-11);

  hessian[3] = 0;  // 1 / A_i does not exist; the inverse on the plane does
  EXPECT_TRUE(DenseSchur(ReducedSystem(f.topology, hessian, cot)).allFinite());
}

}  // namespace
}  // namespace planish
