// ChartEstimates: what charts will look like, compared with the maps that are solved for.
#include "core/unwrap/chart_estimate.h"

#include <cmath>
#include <complex>
#include <numbers>

#include "core/charts/surface.h"
#include "core/unwrap/unwrap.h"
#include "gtest/gtest.h"
#include "tests/core/shapes.h"

namespace planish {
namespace {

// Estimates of the connected pieces of a mesh, which are discs.
struct Estimated {
  explicit Estimated(const Mesh& mesh)
      : surface(MakeSurface(mesh, {}).value()),
        segmentation(surface, Segmentation::Kind::kWhole, 1.05, {}),
        estimates(segmentation, AtlasTuning()) {
    EXPECT_EQ(segmentation.charts().size(), 1u);
    estimates.Update(0);
  }
  const ChartEstimate& whole() const { return estimates.of(0); }

  const Surface surface;
  Segmentation segmentation;
  ChartEstimates estimates;
};

// By ABF, whether the map overlaps itself or not.
UnwrapResult Solved(const Mesh& mesh) {
  UnwrapOptions options;
  options.seams.policy = SeamPolicy::kNone;
  options.pack = false;
  return Unwrap(mesh, options, {}).value();
}

// Root mean square distance of the points after the turn, move and scale that fit best, over that from their middle.
double Misfit(const std::vector<Vec2>& points, const std::vector<Vec2>& wanted) {
  EXPECT_EQ(points.size(), wanted.size());
  using Complex = std::complex<double>;
  const auto n = static_cast<double>(points.size());
  Complex middle = 0, wanted_middle = 0, turn = 0;
  for (std::size_t i = 0; i < points.size(); ++i) {
    middle += Complex(points[i].x(), points[i].y()) / n;
    wanted_middle += Complex(wanted[i].x(), wanted[i].y()) / n;
  }
  const auto p = [&](std::size_t i) { return Complex(points[i].x(), points[i].y()) - middle; };
  const auto q = [&](std::size_t i) { return Complex(wanted[i].x(), wanted[i].y()) - wanted_middle; };
  double from = 0, to = 0, off = 0;
  for (std::size_t i = 0; i < points.size(); ++i) {
    turn += std::conj(p(i)) * q(i);
    from += std::norm(p(i));
    to += std::norm(q(i));
  }
  for (std::size_t i = 0; i < points.size(); ++i) off += std::norm(turn / from * p(i) - q(i));
  return std::sqrt(off / to);
}

FlatMesh DiscOf(const Estimated& estimated) {
  std::vector<std::int32_t> place;
  std::vector<std::pair<std::int32_t, std::int32_t>> slits;
  return ChartMesh(estimated.segmentation.gluing(), estimated.segmentation.charts()[0], &place, &slits);
}

// Of the outline, and of the corners of all faces.
struct Misfits {
  double outline, corners;
};

Misfits MisfitsOf(Estimated* estimated, const CornerUv& uv) {
  std::vector<Vec2> outline, corners, estimated_corners;
  for (const HalfedgeHandle h : estimated->whole().outline) {
    const std::int32_t c = CornerOf(*estimated->surface.mesh, h);
    outline.push_back(UvOf(uv, 3 * (c / 3) + Next(c % 3)));
  }
  const std::vector<std::int32_t>& faces = estimated->segmentation.charts()[0];
  const FlatMesh disc = DiscOf(*estimated);
  const std::vector<Vec2> positions = estimated->estimates.Positions(0, disc);
  for (std::size_t f = 0; f < faces.size(); ++f) {
    for (std::int32_t k = 0; k < 3; ++k) {
      corners.push_back(UvOf(uv, 3 * faces[f] + k));
      estimated_corners.push_back(positions[disc.faces[f][k]]);
    }
  }
  return {Misfit(estimated->whole().points, outline), Misfit(estimated_corners, corners)};
}

// Two turns of a ramp, which unrolls onto itself.
Mesh WindingRamp() {
  return testing::Patch(160, 6, [](double u, double v) {
    const double turn = 4 * std::numbers::pi * u, radius = 1 + 0.5 * v;
    return Vec3(radius * std::cos(turn), radius * std::sin(turn), 0.3 * u);
  });
}

TEST(ChartEstimates, AreTheSolvedMapsOfWhatUnrolls) {
  for (const Mesh& mesh :
       {testing::Plane(9, 7, 0.2), testing::LShape(5), testing::Star(4), testing::HalfCylinder(12, 6, 0.2)}) {
    const UnwrapResult solved = Solved(mesh);
    Estimated estimated(mesh);
    EXPECT_NEAR(estimated.whole().stretch, 1, 1e-6);
    EXPECT_NEAR(solved.charts[0].stretch_l2, 1, 1e-3);
    const auto [outline, corners] = MisfitsOf(&estimated, solved.uv);
    EXPECT_LT(outline, 1e-3);
    EXPECT_LT(corners, 3e-3) << "as far as conjugate gradients go";
    EXPECT_EQ(estimated.whole().face, -1) << "sound";
    double length = 0;  // kept
    const std::vector<Vec2>& points = estimated.whole().points;
    for (std::size_t i = 0; i < points.size(); ++i) length += (points[(i + 1) % points.size()] - points[i]).norm();
    double on_surface = 0;
    for (const HalfedgeHandle h : estimated.whole().outline) on_surface += estimated.surface.length(h);
    EXPECT_NEAR(length, on_surface, 1e-3 * on_surface);
  }
}

TEST(ChartEstimates, AreNearTheSolvedMapsOfCurvedDiscs) {
  for (const Mesh& mesh : {testing::Hills(16, 16, 0.5), testing::Hills(24, 24, 1), testing::Cone(9, 0.5),
                           testing::PuncturedSphere(16, std::numbers::pi / 2)}) {
    const UnwrapResult solved = Solved(mesh);
    Estimated estimated(mesh);
    ASSERT_GT(solved.charts[0].stretch_l2, 1.001);
    EXPECT_NEAR(estimated.whole().stretch, solved.charts[0].stretch_l2, 0.04);
    const auto [outline, corners] = MisfitsOf(&estimated, solved.uv);
    EXPECT_LT(outline, 0.05);
    EXPECT_LT(corners, 0.05) << mesh.faces.size();
    EXPECT_EQ(estimated.whole().face, -1) << "sound";
    EXPECT_EQ(solved.quality.overlapping, 0);
  }
}

// A vertex next to the middle of an edge makes triangles with angles of about 1e-6 and pi.
TEST(ChartEstimates, HoldOnNeedles) {
  Mesh mesh = testing::PuncturedSphere(14, 0.3);
  const double stretch = Estimated(mesh).whole().stretch;
  EXPECT_GT(stretch, 1.05);
  for (std::size_t f = 0, faces = mesh.faces.size(); f < faces; f += 5) {
    const auto [a, b, c] = mesh.faces[f];
    const Vec3 middle = (mesh.positions[a] + mesh.positions[b]) / 2;
    const auto v = static_cast<std::int32_t>(mesh.positions.size());
    mesh.positions.push_back(middle + 1e-6 * (mesh.positions[c] - middle));
    mesh.faces[f] = {a, v, c};
    mesh.faces.push_back({v, b, c});
    mesh.faces.push_back({a, b, v});
  }
  EXPECT_NEAR(Estimated(mesh).whole().stretch, stretch, 0.02 * stretch);
}

TEST(ChartEstimates, ArePlacedWhereVerticesCoincide) {
  Mesh mesh = testing::Plane(9, 7, 0.2);
  mesh.positions[31] = mesh.positions[32];  // both inside
  mesh.positions[0] = mesh.positions[1];    // on the outline
  Estimated estimated(mesh);
  for (const Vec2& p : estimated.estimates.Positions(0, DiscOf(estimated))) EXPECT_TRUE(p.allFinite());
}

TEST(ChartEstimates, AChartThatOverlapsIsUnsoundUntilItIsCut) {
  const Mesh mesh = WindingRamp();
  EXPECT_GT(Solved(mesh).quality.overlapping, 0);
  Estimated estimated(mesh);
  const std::int32_t face = estimated.whole().face, other_face = estimated.whole().other_face;
  ASSERT_GE(face, 0);
  ASSERT_GE(other_face, 0);
  EXPECT_NE(face, other_face);
  for (const std::int32_t chart : estimated.segmentation.Split({{0, face, other_face}}, {})) {
    estimated.estimates.Update(chart);
    EXPECT_EQ(estimated.estimates.of(chart).face, -1) << "one turn each, about";
    EXPECT_NEAR(estimated.estimates.of(chart).stretch, 1, 0.01);
  }
}

TEST(ChartEstimates, AreTheSameAgain) {
  const Mesh mesh = testing::Hills(16, 16, 1);
  const Estimated one(mesh);
  Estimated again(mesh);
  EXPECT_EQ(one.whole().points, again.whole().points);
  EXPECT_EQ(one.whole().outline, again.whole().outline);
  EXPECT_EQ(one.whole().stretch, again.whole().stretch);
  const ChartEstimate kept = again.whole();
  const std::vector<std::int32_t> parts = again.segmentation.Split({{0}}, {});
  ASSERT_EQ(parts.size(), 2u);
  for (const std::int32_t chart : parts) again.estimates.Update(chart);
  EXPECT_NE(again.whole().points, kept.points);
  again.estimates.Restore(0, kept);
  EXPECT_EQ(again.whole().points, kept.points);
}

}  // namespace
}  // namespace planish
