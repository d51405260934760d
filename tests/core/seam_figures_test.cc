// What is said of the seams of a map, where it is known.
#include "core/unwrap/seam_figures.h"

#include <algorithm>
#include <cmath>
#include <functional>
#include <utility>
#include <vector>

#include "gtest/gtest.h"
#include "tests/core/shapes.h"

namespace planish {
namespace {

// The figures of a map of two charts: faces whose middles fulfil `is_apart` make up the second.
SeamFigures FiguresOf(const Mesh& mesh, const std::function<bool(const Vec3&)>& is_apart) {
  CornerUv uv(6 * mesh.faces.size());
  for (std::int32_t f = 0; f < mesh.num_faces(); ++f) {
    const Face& face = mesh.faces[f];
    const Vec3 middle = (mesh.positions[face[0]] + mesh.positions[face[1]] + mesh.positions[face[2]]) / 3;
    for (int k = 0; k < 3; ++k) {
      const Vec3& p = mesh.positions[face[k]];
      SetUv(3 * f + k, Vec2(p.x() + (is_apart(middle) ? 5 : 0), p.y()), &uv);
    }
  }
  return MeasureSeams(mesh, uv);
}

TEST(SeamFigures, OfAStraightSeamInTheOpen) {
  const SeamFigures figures = FiguresOf(testing::Plane(10, 10), [](const Vec3& p) { return p.x() > 0.3; });
  EXPECT_NEAR(figures.visible_length, 1, 1e-6);
  EXPECT_NEAR(figures.turn_deg, 0, 1e-9);
  ASSERT_TRUE(figures.symmetry);
  EXPECT_EQ(*figures.symmetry, 1) << "the plane y = 1/2";
}

TEST(SeamFigures, OfStairsTurnByRightAngles) {
  const SeamFigures figures = FiguresOf(
      testing::Plane(10, 10), [](const Vec3& p) { return std::floor(10 * p.x()) + std::floor(10 * p.y()) > 9; });
  EXPECT_NEAR(figures.turn_deg, 90, 1e-9);
}

// Across x = 1/2 the left third of one side is cut off, and nothing on the other; then both.
TEST(SeamFigures, OfOneSideHaveNoMirrorImage) {
  const Mesh mesh = testing::Patch(12, 12, [](double u, double v) { return Vec3(u, v, v * v); });
  const auto of_one = [](const Vec3& p) { return p.x() < 0.25; };
  const auto of_both = [](const Vec3& p) { return std::abs(p.x() - 0.5) > 0.25; };
  ASSERT_TRUE(FiguresOf(mesh, of_one).symmetry);
  EXPECT_EQ(*FiguresOf(mesh, of_one).symmetry, 0);
  EXPECT_EQ(*FiguresOf(mesh, of_both).symmetry, 1);
}

TEST(SeamFigures, OfASurfaceWithoutMirrorPlaneHaveNoSymmetry) {
  EXPECT_FALSE(FiguresOf(testing::Hills(12, 12), [](const Vec3& p) { return p.x() < 0.5; }).symmetry);
}

// Half of a seam runs on the floor of a deep trench.
TEST(SeamFigures, AreLessVisibleInATrench) {
  const Mesh mesh =
      testing::Patch(40, 20, [](double u, double v) { return Vec3(u, v, std::abs(u - 0.5) < 0.06 ? -1 : 0); });
  const double on_top = FiguresOf(mesh, [](const Vec3& p) { return p.x() < 0.2; }).visible_length;
  const double below = FiguresOf(mesh, [](const Vec3& p) { return p.x() < 0.5; }).visible_length;
  EXPECT_GT(on_top, 0);
  EXPECT_LT(below, 0.6 * on_top);
}

// As many vertices as one likes in one place do not take forever.
TEST(SeamFigures, OfCrowdedVerticesAreGivenUp) {
  Mesh mesh = testing::Plane(150, 150);
  for (Vec3& p : mesh.positions) p *= 1e-5;
  mesh.positions.push_back(Vec3(1, 1, 1));
  mesh.faces.push_back({0, 1, static_cast<std::int32_t>(mesh.positions.size()) - 1});
  EXPECT_FALSE(FiguresOf(mesh, [](const Vec3& p) { return p.x() > 1e-6; }).symmetry);
}

}  // namespace
}  // namespace planish
