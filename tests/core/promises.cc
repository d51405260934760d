#include "tests/core/promises.h"

#include <algorithm>
#include <cmath>
#include <set>

#include "Eigen/Geometry"
#include "core/base/error.h"
#include "core/unwrap/distortion.h"
#include "core/unwrap/verify.h"

namespace planish::testing {
namespace {

// A face that is thicker, in UV, needs no widening: some units of the last place of a float, and what a solve in double
// leaves of errors.
constexpr double kThickForFloat = 1e-6, kThickForDouble = 1e-9;
// Altitude over the longest edge: needles below that are widened as well where a neighbour that is widened turns them.
constexpr double kNeedle = 1e-4;

double LongestEdge(const Mesh& mesh, std::int32_t f) {
  const Vec3 &a = mesh.positions[mesh.faces[f][0]], &b = mesh.positions[mesh.faces[f][1]],
             &c = mesh.positions[mesh.faces[f][2]];
  return std::max({(b - a).norm(), (c - b).norm(), (a - c).norm()});
}

double Altitude(const Mesh& mesh, std::int32_t f) {
  const Vec3 &a = mesh.positions[mesh.faces[f][0]], &b = mesh.positions[mesh.faces[f][1]],
             &c = mesh.positions[mesh.faces[f][2]];
  const double longest = LongestEdge(mesh, f);
  return longest > 0 ? (b - a).cross(c - a).norm() / longest : 0;
}

double LongestInUv(const UnwrapResult& result, std::int32_t f) {
  const Vec2 a = UvOf(result.uv, 3 * f), b = UvOf(result.uv, 3 * f + 1), c = UvOf(result.uv, 3 * f + 2);
  return std::max({(b - a).norm(), (c - b).norm(), (a - c).norm()});
}

// As far as a double can tell.
bool HasNoArea(const Mesh& mesh, std::int32_t f) {
  return Altitude(mesh, f) <= 1e-12 * LongestEdge(mesh, f);
}

// What a chart's stretch may be above the limit (UnwrapOptions), by rounding to float.
constexpr double kSlack = 1.0011;

// Root mean square stretch of each chart, widened faces left out.
std::vector<double> StretchOfCharts(const Mesh& mesh, const UnwrapResult& result) {
  std::vector<MapSums> sums(result.charts.size());
  for (std::int32_t f = 0; f < mesh.num_faces(); ++f) {
    const bool is_widened = std::binary_search(result.widened.begin(), result.widened.end(), f);
    if (result.face_chart[f] < 0 || is_widened || HasNoArea(mesh, f)) continue;
    Vec2 p[3];
    Vec3 q[3];
    for (int k = 0; k < 3; ++k) {
      p[k] = UvOf(result.uv, 3 * f + k);
      q[k] = mesh.positions[mesh.faces[f][k]];
    }
    sums[result.face_chart[f]].Add(p, q);
  }
  std::vector<double> stretch;
  for (const MapSums& of_chart : sums) stretch.push_back(of_chart.StretchL2());
  return stretch;
}

// Faces that promises leave out.
std::vector<char> WithoutArea(const Mesh& mesh, const std::vector<std::int32_t>& face_chart) {
  std::vector<char> ignored(mesh.faces.size());
  for (std::int32_t f = 0; f < mesh.num_faces(); ++f) ignored[f] = face_chart[f] < 0 || HasNoArea(mesh, f);
  return ignored;
}

// Relative: what the density of a chart may be off by where no warning names its faces.
constexpr double kDensitySlack = 0.03;
// A face that spans so much of a tile, while less of the texture than this is used, must be named.
constexpr double kSpansTile = 0.8, kHardlyUsed = 0.15;
// Of all edges squared: charts with less area consist of needles, and core measures their density along edges.
constexpr double kLeastArea = 1e-4;

// Per face: whether a warning of these reasons names it.
std::vector<char> NamedBy(const UnwrapResult& result, const std::set<std::string>& reasons) {
  std::vector<char> named(result.face_chart.size(), 0);
  for (const UnwrapWarning& warning : result.warnings) {
    if (!reasons.contains(warning.reason)) continue;
    for (const std::int32_t f : warning.faces) named[f] = 1;
  }
  return named;
}

// All charts have the density that is told, or are named.
void JudgeDensity(const Mesh& mesh, const UnwrapOptions& options, const UnwrapResult& result,
                  const std::vector<char>& ignored, std::vector<std::string>* broken) {
  if (!options.pack || !options.face_weights.empty() || !options.face_atlas.empty()) return;
  const double scale = result.texels_per_unit / options.atlas.texture_size;
  const std::vector<char> is_named = NamedBy(result, {"CHARTS_REDUCED", "DENSITY_VARIES", "FACES_WIDENED"});
  std::vector<double> area(result.charts.size()), uv_area = area, squares = area;
  std::vector<char> skipped(result.charts.size(), 0);
  double longest = 0;
  for (std::int32_t f = 0; f < mesh.num_faces(); ++f) {
    if (ignored[f]) continue;
    const std::int32_t i = result.face_chart[f];
    if (is_named[f]) skipped[i] = 1;
    const double length = LongestEdge(mesh, f);
    longest = std::max(longest, LongestInUv(result, f));
    if (std::binary_search(result.widened.begin(), result.widened.end(), f)) continue;
    area[i] += Altitude(mesh, f) * length / 2;
    for (int k = 0; k < 3; ++k) {
      squares[i] += (mesh.positions[mesh.faces[f][(k + 1) % 3]] - mesh.positions[mesh.faces[f][k]]).squaredNorm();
    }
    const Vec2 a = UvOf(result.uv, 3 * f), b = UvOf(result.uv, 3 * f + 1) - a, c = UvOf(result.uv, 3 * f + 2) - a;
    uv_area[i] += std::abs(b.x() * c.y() - b.y() * c.x()) / 2;
  }
  std::int64_t other = 0;
  double farthest = 1, share = 0;
  for (std::size_t i = 0; i < area.size(); ++i) {
    if (skipped[i] || area[i] <= kLeastArea * squares[i]) continue;
    const double ratio = std::sqrt(uv_area[i] / area[i]) / scale;
    other += std::abs(ratio - 1) > kDensitySlack;
    if (std::abs(ratio - 1) <= std::abs(farthest - 1)) continue;
    farthest = ratio;
    share = area[i] / squares[i];
  }
  if (other > 0) {
    broken->push_back(std::to_string(other) + " charts have another density than is told, up to " +
                      std::to_string(farthest) + " times, with an area of " + std::to_string(share) +
                      " of squared edges");
  }
  const std::vector<char> is_long = NamedBy(result, {"FACES_TOO_LONG"});
  if (longest > kSpansTile && result.quality.packing_efficiency < kHardlyUsed * options.atlas.tiles &&
      std::find(is_long.begin(), is_long.end(), 1) == is_long.end()) {
    broken->push_back("a long face sets the density without a warning");
  }
}

}  // namespace

std::vector<std::string> BrokenPromises(const Mesh& mesh, const UnwrapOptions& options,
                                        const absl::StatusOr<UnwrapResult>& result) {
  if (!result.ok()) {
    // A mesh without any area is refused.
    if (ErrorInfoOf(result.status()).reason == "MESH_FACE_DEGENERATE") return {};
    return {"refused: " + std::string(result.status().message())};
  }
  std::vector<std::string> broken;
  const std::vector<char> ignored = WithoutArea(mesh, result->face_chart);
  const OrientationFaults orientation = CheckOrientations(result->uv, {}, ignored);
  if (orientation.flipped > 0) broken.push_back(std::to_string(orientation.flipped) + " triangles are flipped");
  if (orientation.degenerate > 0) broken.push_back(std::to_string(orientation.degenerate) + " triangles have no area");
  const std::vector<std::int32_t> nothing_glued(3 * mesh.faces.size(), -1);
  const Overlaps overlaps = CheckOverlaps(nothing_glued, result->uv, orientation, {}, ignored);
  if (overlaps.pairs > 0) broken.push_back(std::to_string(overlaps.pairs) + " pairs of triangles overlap");
  if (result->quality.flipped + result->quality.degenerate + result->quality.overlapping <
      orientation.flipped + orientation.degenerate + overlaps.pairs) {
    broken.push_back("the report says less than that");
  }
  const std::vector<double> stretch = StretchOfCharts(mesh, *result);
  const auto stretched =
      std::count_if(stretch.begin(), stretch.end(), [&](double s) { return s > kSlack * options.MaxStretch(); });
  if (stretched > 0) {
    broken.push_back(std::to_string(stretched) + " charts are stretched beyond the limit, by " +
                     std::to_string(*std::max_element(stretch.begin(), stretch.end())));
  }
  const double thick = result->precision == Precision::kFloat ? kThickForFloat : kThickForDouble;
  const double atlas_scale = result->texels_per_unit / options.atlas.texture_size;
  const auto needless = std::count_if(result->widened.begin(), result->widened.end(), [&](std::int32_t f) {
    const double scale = std::min(atlas_scale, LongestInUv(*result, f) / LongestEdge(mesh, f));
    return Altitude(mesh, f) * scale > thick && Altitude(mesh, f) > kNeedle * LongestEdge(mesh, f);
  });
  if (needless > 0) broken.push_back(std::to_string(needless) + " faces were widened that need not be");
  const bool is_outside =
      std::any_of(result->uv.begin(), result->uv.end(), [&](double x) { return !(x >= 0 && x <= 10); });
  if (is_outside) broken.push_back("UV lie outside of the tiles");
  JudgeDensity(mesh, options, *result, ignored, &broken);
  return broken;
}

}  // namespace planish::testing
