// Faces thinner than the delivered type holds are widened (core/unwrap/widening.h).
#include "core/unwrap/widening.h"

#include <cmath>
#include <numbers>
#include <string>
#include <vector>

#include "core/mesh/angles.h"
#include "core/unwrap/unwrap.h"
#include "gmock/gmock.h"
#include "gtest/gtest.h"
#include "tests/core/promises.h"

namespace planish {
namespace {

using ::testing::IsEmpty;

// A square sheet of 2 * 12 * 12 triangles, with its middle vertex in the origin.
Mesh Sheet(double bump) {
  constexpr std::int32_t n = 12;
  Mesh mesh;
  for (int j = 0; j <= n; ++j) {
    for (int i = 0; i <= n; ++i) {
      const double x = (i - n / 2) / 6.0, y = (j - n / 2) / 6.0;
      mesh.positions.emplace_back(x, y, bump * (std::cos(2 * x) * std::cos(y) - 1));
    }
  }
  for (std::int32_t j = 0; j < n; ++j) {
    for (std::int32_t i = 0; i < n; ++i) {
      const std::int32_t a = j * (n + 1) + i;
      mesh.faces.push_back({a, a + 1, a + n + 2});
      mesh.faces.push_back({a, a + n + 2, a + n + 1});
    }
  }
  return mesh;
}

// Puts a vertex into a face, at these barycentric coordinates.
void SplitFace(std::int32_t f, const Vec3& at, Mesh* mesh) {
  const auto [a, b, c] = mesh->faces[f];
  const auto p = static_cast<std::int32_t>(mesh->positions.size());
  mesh->positions.push_back(at[0] * mesh->positions[a] + at[1] * mesh->positions[b] + at[2] * mesh->positions[c]);
  mesh->faces[f] = {a, b, p};
  mesh->faces.push_back({b, c, p});
  mesh->faces.push_back({c, a, p});
}

// With needles of about `angle` at the middle: a vertex that nearly lies in a corner of a face, one that nearly lies on
// an edge, and one inside of a needle.
Mesh SheetWithNeedles(double bump, double angle) {
  Mesh mesh = Sheet(bump);
  std::vector<std::int32_t> at_middle;
  for (std::int32_t f = 0; f < mesh.num_faces(); ++f) {
    if (mesh.positions[mesh.faces[f][0]].norm() == 0) at_middle.push_back(f);
  }
  const std::int32_t corner = at_middle.at(0), edge = at_middle.at(1);
  const auto needle = static_cast<std::int32_t>(mesh.num_faces()) + 1;
  SplitFace(corner, {1 - 2 * angle, angle, angle}, &mesh);
  SplitFace(edge, {0.5 - angle / 2, 0.5 - angle / 2, angle}, &mesh);
  SplitFace(needle, {0.3, 0.3, 0.4}, &mesh);
  return mesh;
}

struct Case {
  double angle;
  double bump;
  SeamPolicy policy;
  Precision precision;
};

class Needles : public ::testing::TestWithParam<Case> {};

TEST_P(Needles, AreMappedWithoutFlips) {
  const auto& [angle, bump, policy, precision] = GetParam();
  const Mesh mesh = SheetWithNeedles(bump, angle);
  UnwrapOptions options;
  options.seams.policy = policy;
  options.precision = precision;
  const auto result = Unwrap(mesh, options, {});
  ASSERT_TRUE(result.ok()) << result.status();
  EXPECT_EQ(result->quality.flipped, 0);
  EXPECT_EQ(result->quality.degenerate, 0);
  EXPECT_EQ(result->quality.overlapping, 0);
  EXPECT_THAT(testing::BrokenPromises(mesh, options, result), IsEmpty());
  EXPECT_EQ(result->precision, precision);
  // A unit of the last place of a float is some 1e-7 of the sheet, one of a double 1e-16.
  if (precision == Precision::kFloat && angle < 1e-8) {
    EXPECT_GE(std::ssize(result->widened), 4);
  }
  if (precision == Precision::kDouble && angle > 1e-7) {
    EXPECT_THAT(result->widened, IsEmpty());
  }
  std::string count = "0";
  for (const UnwrapWarning& warning : result->warnings) {
    EXPECT_NE(warning.reason, "UV_FLIPPED");
    EXPECT_NE(warning.reason, "UV_DEGENERATE");
    if (warning.reason == "FACES_WIDENED") count = warning.metadata.at("count");
  }
  EXPECT_EQ(count, std::to_string(result->widened.size()));
}

std::vector<Case> Cases() {
  std::vector<Case> cases;
  for (const double angle : {1e-6, 1e-7, 1e-8, 2e-10, 1e-11, 1e-12, 1e-13}) {
    for (const double bump : {0.0, 0.02}) {
      for (const SeamPolicy policy : {SeamPolicy::kNone, SeamPolicy::kAuto}) {
        for (const Precision precision : {Precision::kFloat, Precision::kDouble}) {
          cases.push_back({angle, bump, policy, precision});
        }
      }
    }
  }
  return cases;
}

std::string NameOf(const ::testing::TestParamInfo<Case>& info) {
  const auto& [angle, bump, policy, precision] = info.param;
  return std::to_string(info.index) + (bump == 0 ? "Flat" : "Bumpy") + (policy == SeamPolicy::kNone ? "None" : "Auto") +
         (precision == Precision::kFloat ? "Float" : "Double");
}

INSTANTIATE_TEST_SUITE_P(All, Needles, ::testing::ValuesIn(Cases()), NameOf);

// Nothing is widened where every face holds: the map is the same as ever.
TEST(Widening, LeavesOtherMeshesAlone) {
  for (const Precision precision : {Precision::kFloat, Precision::kDouble}) {
    UnwrapOptions options;
    options.precision = precision;
    const auto result = Unwrap(Sheet(0.1), options, {});
    ASSERT_TRUE(result.ok()) << result.status();
    EXPECT_THAT(result->widened, IsEmpty());
  }
}

// The angles that a widened face is to keep sum up to pi, and none is less than asked for.
TEST(Widening, RaisesTheLeastAngles) {
  Mesh mesh;
  mesh.positions = {{0, 0, 0}, {1, 0, 0}, {0.5, 1e-9, 0}};
  mesh.faces = {{0, 1, 2}};
  Chart chart;
  chart.faces = {0};
  EXPECT_EQ(AnglesToKeep(chart, MeasuredAngles(mesh)), MeasuredAngles(mesh));
  chart.least_angle = {1e-3};
  const Eigen::VectorXd angles = AnglesToKeep(chart, MeasuredAngles(mesh));
  EXPECT_DOUBLE_EQ(angles.minCoeff(), 1e-3);
  EXPECT_NEAR(angles.sum(), std::numbers::pi, 1e-15);
}

}  // namespace
}  // namespace planish
