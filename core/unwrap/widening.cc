#include "core/unwrap/widening.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numbers>
#include <utility>

#include "core/mesh/angles.h"
#include "core/mesh/box_tree.h"
#include "core/mesh/predicates.h"

namespace planish {
namespace {

using Corners = std::array<Vec2, 3>;

// Rounding moves a corner by at most 0.71 grains, and so changes an altitude by at most 1.42.
constexpr double kLeastAltitude = 1.5;  // grains
constexpr double kAltitude = 3;         // grains: the target, as the map does not keep angles exactly
constexpr double kHeldAltitude = 12;    // grains: rounding changes it by at most an eighth
constexpr double kGrowth = 4;           // an angle that did not suffice grows by at least this factor
constexpr double kMostGrowth = 1e3;     // an angle is at most this times the angle that should suffice
constexpr double kMostAngle = 0.5;      // radians; above it, raising the angles does not make a triangle thicker
constexpr double kLeastPlace = 1e-30;   // nearer to 0, exponents no longer distinguish places
// Grains: the limit for an enlarged chart, some thousandths of the texture's side for float.
constexpr double kMostExtent = 1e5;
// Radians. If a thicker face is flipped, its shape is not the reason.
constexpr double kThin = 1e-4;

// The corners of a delivered face are rounded to multiples of this.
double GrainOf(const Corners& p, Precision precision) {
  const int digits = precision == Precision::kFloat ? std::numeric_limits<float>::digits : kDigitsOfSolve;
  const double farthest = std::max({p[0].maxCoeff(), p[1].maxCoeff(), p[2].maxCoeff(), kLeastPlace});
  return std::ldexp(1.0, std::ilogb(farthest) + 1 - digits);
}

// Raises the least angles of a triangle to `least`, at the cost of the largest.
void RaiseAngles(double least, Eigen::Ref<Eigen::Vector3d> angles) {
  int largest = 0;
  angles.maxCoeff(&largest);
  angles = angles.cwiseMax(least);
  angles[largest] = std::numbers::pi - angles[Next(largest)] - angles[Prev(largest)];
}

// A face that rounding destroys, or nearly, in its map.
struct ThinFace {
  std::int32_t face = 0;
  double grain = 0, longest = 0, altitude = 0;
  bool must_widen = true;  // false: only if it is a needle on the surface too
  bool is_small = true;    // too small on the surface too, so that no map could hold it well
};

struct ThinFaces {
  std::vector<ThinFace> faces;
  Box box;  // of all corners of the chart
};

// Faces that rounding may collapse or flip, and faces that are already collapsed or flipped. All must be widened. With
// `as_delivered`, only the latter must be, since altitudes no longer matter then. in_plane(f) are the corners of face
// f, grain_of(p) is the rounding unit at these, and `scale` is length in the plane over length on the surface.
template <typename InPlane, typename GrainOf>
ThinFaces FindThin(const Mesh& mesh, const Chart& chart, const std::vector<char>& ignored, double scale,
                   bool as_delivered, const InPlane& in_plane, const GrainOf& grain_of) {
  ThinFaces thin;
  for (std::int32_t f = 0; f < chart.topology->num_faces(); ++f) {
    const Corners p = in_plane(f);
    for (const Vec2& corner : p) thin.box.Add(corner);
    if (!ignored.empty() && ignored[chart.faces[f]] != 0) continue;
    const double grain = grain_of(p), longest = LongestEdge(p), altitude = DoubleArea(p) / longest;
    const bool is_turned = Orientation(p) <= 0;
    if (altitude >= kLeastAltitude * grain && !is_turned) continue;
    // If the map shrinks this face more than the surface explains, its shape is not the reason.
    const std::array<Vec3, 3> q = TriangleOf(mesh.positions, mesh.faces[chart.faces[f]]);
    const double as_drawn = scale * std::min(1.0, chart.enlargement), on_surface = LongestEdge(q);
    const bool is_small = as_drawn * DoubleArea(q) < kHeldAltitude * grain * on_surface;
    thin.faces.push_back({f, grain, std::max(longest, as_drawn * on_surface), as_delivered ? 0 : altitude,
                          is_turned || !as_delivered, is_small});
  }
  return thin;
}

bool Widen(const Mesh& mesh, const ThinFaces& thin, Chart* chart) {
  // Needles that need not be widened are widened only together with others, beside which they would be squashed.
  if (std::none_of(thin.faces.begin(), thin.faces.end(), [](const ThinFace& t) { return t.must_widen; })) return false;
  std::vector<std::int32_t> sources;
  for (const ThinFace& t : thin.faces) sources.push_back(chart->faces[t.face]);
  const Eigen::VectorXd measured = MeasuredAngles(mesh, sources);
  bool any = false;
  double factor = 1, coarsest = 0;
  std::vector<double> least_angle = chart->least_angle;
  if (least_angle.empty()) least_angle.assign(chart->faces.size(), 0.0);
  for (std::size_t i = 0; i < thin.faces.size(); ++i) {
    const auto& [f, grain, longest, altitude, must_widen, is_small] = thin.faces[i];
    const double kept = std::max(least_angle[f], measured.segment<3>(3 * static_cast<Eigen::Index>(i)).minCoeff());
    if (!must_widen && kept > kThin) continue;
    // The altitude of a face with two such angles is half of the angle times its longest edge.
    const double wanted = 2 * kAltitude * grain / longest;
    if (kept >= kMostAngle || (wanted <= kept && kept > kThin)) {
      factor = std::max(factor, altitude > 0 ? kAltitude * grain / altitude : kGrowth);
      coarsest = std::max(coarsest, grain);
      continue;
    }
    const double next = std::min({kMostAngle, std::max(wanted, kGrowth * kept), kMostGrowth * wanted});
    if (next <= kept) continue;
    least_angle[f] = next;
    any = true;
  }
  if (any) chart->least_angle = std::move(least_angle);
  if (any) return true;
  // If a chart's whole map is tiny, the chart is enlarged, since faces of any shape are too small in it.
  const double extent = factor * (thin.box.high - thin.box.low).maxCoeff();
  if (!(factor > 1) || !(extent <= kMostExtent * coarsest)) return false;
  chart->enlargement *= factor;
  for (std::size_t i = 0; i < thin.faces.size(); ++i) {
    if (!thin.faces[i].is_small) continue;  // only the map makes it small, and need not once the chart is enlarged
    double& least = least_angle[thin.faces[i].face];
    least = std::max(least, measured.segment<3>(3 * static_cast<Eigen::Index>(i)).minCoeff());
  }
  chart->least_angle = std::move(least_angle);
  return true;
}

}  // namespace

Eigen::VectorXd AnglesToKeep(const Chart& chart, Eigen::VectorXd measured) {
  for (std::size_t f = 0; f < chart.least_angle.size(); ++f) {
    if (chart.least_angle[f] > 0)
      RaiseAngles(chart.least_angle[f], measured.segment<3>(3 * static_cast<Eigen::Index>(f)));
  }
  return measured;
}

bool WidenInMap(const Mesh& mesh, const ChartMap& map, double grain, const std::vector<char>& ignored, Chart* chart) {
  const ThinFaces thin = FindThin(
      mesh, *chart, ignored, 1, /*as_delivered=*/false,
      [&](std::int32_t f) { return TriangleOf(map.positions, chart->topology->faces[f]); },
      [&](const Corners&) { return grain; });
  return Widen(mesh, thin, chart);
}

bool IsThin(const Mesh& mesh, const CornerUv& uv, double scale, Precision precision, const Chart& chart,
            std::int32_t f) {
  const std::array<Vec3, 3> q = TriangleOf(mesh.positions, mesh.faces[f]);
  const double least = kHeldAltitude * GrainOf(TriangleOf(uv, f), precision);
  return scale * std::min(1.0, chart.enlargement) * DoubleArea(q) < least * LongestEdge(q);
}

bool WidenDelivered(const Mesh& mesh, const CornerUv& uv, double scale, Precision precision,
                    const std::vector<char>& ignored, Chart* chart) {
  const ThinFaces thin = FindThin(
      mesh, *chart, ignored, scale, /*as_delivered=*/true,
      [&](std::int32_t f) { return TriangleOf(uv, chart->faces[f]); },
      [&](const Corners& p) { return GrainOf(p, precision); });
  return Widen(mesh, thin, chart);
}

}  // namespace planish
