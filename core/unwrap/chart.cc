#include "core/unwrap/chart.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "Eigen/Geometry"
#include "absl/strings/str_cat.h"
#include "core/abf/layout.h"
#include "core/base/error.h"
#include "core/mesh/angles.h"
#include "core/mesh/box_tree.h"
#include "core/mesh/half_edges.h"
#include "core/mesh/predicates.h"
#include "core/unwrap/distortion.h"

namespace planish {
namespace {

using Corners2 = std::array<Vec2, 3>;  // in the plane
using Corners3 = std::array<Vec3, 3>;  // on the surface

// Half-edges of the outline: the mesh's vertex at which each begins, the chart's vertex, and the half-edge's number.
// Sorted, so that chart vertices that are one vertex of the mesh are neighbours.
std::vector<std::array<std::int32_t, 3>> OutlineBySource(const Mesh& mesh, const Chart& chart) {
  std::vector<std::array<std::int32_t, 3>> outline;
  for (std::int32_t c = 0; c < chart.topology->num_corners(); ++c) {
    if (chart.topology->opposite[c] >= 0) continue;
    outline.push_back({mesh.faces[chart.faces[c / 3]][Next(c % 3)], Origin(chart.topology->faces, c), c});
  }
  std::sort(outline.begin(), outline.end());
  return outline;
}

// Moves both sides of slits to their middle if their ends coincide up to the errors of a solve and a layout, unless
// that flips a triangle. Does the same for the copies of a mesh vertex at which a chart touches itself: if they
// differed by a rounding error, the sides could overlap after further rounding. Returns the slits that are closed.
std::vector<std::int32_t> CloseSlits(const Mesh& mesh, const Chart& chart, std::vector<Vec2>* positions) {
  constexpr double kCoincide = 1e-6;  // of the edge's length
  const std::vector<Face>& faces = chart.topology->faces;
  const std::vector<Vec2>& p = *positions;
  std::vector<std::int32_t> closed;
  std::vector<std::pair<std::int32_t, std::int32_t>> same;
  for (std::int32_t i = 0; i < static_cast<std::int32_t>(chart.slits.size()); ++i) {
    const auto [c, d] = chart.slits[i];
    const std::int32_t from = Origin(faces, c), to = Target(faces, c);
    const std::int32_t other_from = Target(faces, d), other_to = Origin(faces, d);
    const double near = kCoincide * (p[to] - p[from]).norm();
    if ((p[from] - p[other_from]).norm() > near || (p[to] - p[other_to]).norm() > near) continue;
    closed.push_back(i);
    same.emplace_back(from, other_from);
    same.emplace_back(to, other_to);
  }
  const std::vector<std::array<std::int32_t, 3>> outline = OutlineBySource(mesh, chart);
  for (std::size_t i = 1; i < outline.size(); ++i) {
    const auto& [source, v, c] = outline[i - 1];
    const auto& [next_source, w, d] = outline[i];
    if (source != next_source) continue;
    const double edge = std::min((p[Target(faces, c)] - p[v]).norm(), (p[Target(faces, d)] - p[w]).norm());
    if ((p[v] - p[w]).norm() <= kCoincide * edge) same.emplace_back(v, w);
  }
  if (same.empty()) return closed;
  UnionFind joined(positions->size());
  std::vector<char> moves(positions->size(), 0);
  for (const auto& [v, w] : same) {
    moves[v] = moves[w] = 1;
    joined.Join(v, w);
  }
  std::vector<Vec2> middle(positions->size(), Vec2::Zero());
  std::vector<int> count(positions->size(), 0);
  for (std::int32_t v = 0; v < static_cast<std::int32_t>(moves.size()); ++v) {
    if (!moves[v]) continue;
    middle[joined.Find(v)] += p[v];
    ++count[joined.Find(v)];
  }
  std::vector<Vec2> moved = p;
  for (std::int32_t v = 0; v < static_cast<std::int32_t>(moves.size()); ++v) {
    if (moves[v]) moved[v] = middle[joined.Find(v)] / count[joined.Find(v)];
  }
  for (const Face& face : faces) {
    if (!moves[face[0]] && !moves[face[1]] && !moves[face[2]]) continue;
    if (Orientation(TriangleOf(p, face)) > 0 && Orientation(TriangleOf(moved, face)) <= 0) return {};
  }
  *positions = std::move(moved);
  return closed;
}

struct Extent {
  // Sums over the faces that are not widened. `surface_squares`: of squared edges.
  double surface_area = 0, map_area = 0, surface_squares = 0;
  double surface_edges = 0, map_edges = 0;  // sums over all faces
  void Add(const Extent& other) {
    surface_area += other.surface_area;
    map_area += other.map_area;
    surface_squares += other.surface_squares;
    surface_edges += other.surface_edges;
    map_edges += other.map_edges;
  }
};

// Area of a chart, relative to the sum of its squared edges, below which it consists of needles. Errors of their angles
// change the area of needles many times over.
constexpr double kLeastArea = 1e-4;

// Scales the map to the area of the surface, without widened faces, or to the length of edges if there is next to no
// area; then by Chart::enlargement.
void ScaleToSurface(const Mesh& mesh, const Chart& chart, const Execution& execution, std::vector<Vec2>* positions) {
  const auto extent = execution.SumUp<Extent>(chart.topology->num_faces(), [&](std::int32_t f, Extent* sum) {
    const Corners2 p = TriangleOf(*positions, chart.topology->faces[f]);
    const Corners3 q = TriangleOf(mesh.positions, mesh.faces[chart.faces[f]]);
    for (int k = 0; k < 3; ++k) {
      sum->map_edges += (p[Next(k)] - p[k]).norm();
      sum->surface_edges += (q[Next(k)] - q[k]).norm();
    }
    if (chart.is_widened(f)) return;
    sum->map_area += std::abs(DoubleArea(p)) / 2;
    sum->surface_area += DoubleArea(q) / 2;
    for (int k = 0; k < 3; ++k) sum->surface_squares += (q[Next(k)] - q[k]).squaredNorm();
  });
  const double by_edges = extent.map_edges > 0 ? extent.surface_edges / extent.map_edges : 1;
  const double by_area = extent.map_area > 0 ? std::sqrt(extent.surface_area / extent.map_area) : 0;
  const bool has_area = extent.surface_area > kLeastArea * extent.surface_squares && by_area > 1e-3 * by_edges;
  const double scale = chart.enlargement * (has_area ? by_area : by_edges);
  for (Vec2& p : *positions) p *= scale;
}

// The UV of the corners of the chart's faces, in the order of its topology.
CornerUv UvOfChart(const Chart& chart, const std::vector<Vec2>& positions) {
  CornerUv uv(2 * chart.topology->num_corners());
  for (std::int32_t c = 0; c < chart.topology->num_corners(); ++c) {
    SetUv(c, positions[chart.topology->faces[c / 3][c % 3]], &uv);
  }
  return uv;
}

// Cosine and sine of rotations, as examples of the unknown rotation of the delivered map.
constexpr std::array<std::array<double, 2>, 3> kTurns = {{{0.8, 0.6}, {12.0 / 13, -5.0 / 13}, {8.0 / 17, 15.0 / 17}}};

// Rotates a map that does not overlap itself by each of kTurns, rounds it to multiples of `resolution`, and returns the
// first overlaps that this causes. Triangles that rounding flips or collapses do not count. `ignored`: per face of the
// chart; empty: none.
Overlaps OverlapsAfterRounding(const Chart& chart, const ChartMap& map, const std::vector<std::int32_t>& opposite,
                               const std::vector<char>& ignored, double resolution, const Execution& execution) {
  for (const auto& [cosine, sine] : kTurns) {
    std::vector<Vec2> positions(map.positions.size());
    for (std::size_t v = 0; v < positions.size(); ++v) {
      const Vec2& p = map.positions[v];
      positions[v] =
          resolution *
          (Vec2(cosine * p.x() - sine * p.y(), sine * p.x() + cosine * p.y()) / resolution).array().round().matrix();
    }
    std::vector<char> left_out(chart.faces.size());
    for (std::int32_t f = 0; f < chart.topology->num_faces(); ++f) {
      left_out[f] =
          (!ignored.empty() && ignored[f] != 0) || Orientation(TriangleOf(positions, chart.topology->faces[f])) <= 0;
    }
    const CornerUv uv = UvOfChart(chart, positions);
    const OrientationFaults orientation = CheckOrientations(uv, execution, left_out);
    Overlaps overlaps = CheckOverlaps(opposite, uv, orientation, execution, left_out, /*max_pairs=*/1);
    if (overlaps.pairs > 0) return overlaps;
  }
  return {};
}

// A quick test whether the map overlaps itself neither now nor after rounding to multiples of `resolution`: every
// corner is farther from all edges that it must not cross than rounding can move both. True for most charts; false if a
// full test is needed.
bool StaysApart(const Chart& chart, const ChartMap& map, double resolution) {
  constexpr double kMargin = 3;  // rounding brings two places nearer by at most the square root of 2
  constexpr std::int64_t kTestsPerEdge = 64;
  if (!(resolution > 0) || !map.closed_slits.empty()) return false;
  const double least = kMargin * resolution;
  const Topology& topology = *chart.topology;
  for (const Face& face : topology.faces) {
    const Corners2 p = TriangleOf(map.positions, face);
    if (!(DoubleArea(p) > least * LongestEdge(p))) return false;
  }
  std::vector<std::array<std::int32_t, 2>> edges;  // of the outline: from, to
  std::vector<Box> boxes;
  for (std::int32_t c = 0; c < topology.num_corners(); ++c) {
    if (topology.opposite[c] >= 0) continue;
    edges.push_back({Origin(topology.faces, c), Target(topology.faces, c)});
    boxes.push_back(Box::Around(map.positions[edges.back()[0]], map.positions[edges.back()[1]]));
  }
  const BoxTree tree(std::move(boxes));
  const auto at = [&](std::int32_t v) -> const Vec2& { return map.positions[v]; };
  std::int64_t tests_left = kTestsPerEdge * std::ssize(edges);
  for (std::int32_t i = 0; i < static_cast<std::int32_t>(edges.size()); ++i) {
    const bool apart = tree.ForEachMeeting(tree.boxes()[i].Grown(least), [&](std::int32_t j) {
      if (--tests_left < 0) return false;
      if (j <= i) return true;
      const auto [a, b] = edges[i];
      const auto [c, d] = edges[j];
      double square = 0;
      if (b == c) {
        square = std::min(SquaredDistanceToSegment(at(d), at(a), at(b)), SquaredDistanceToSegment(at(a), at(c), at(d)));
      } else if (d == a) {
        square = std::min(SquaredDistanceToSegment(at(c), at(a), at(b)), SquaredDistanceToSegment(at(b), at(c), at(d)));
      } else {
        square = SquaredDistance(at(a), at(b), at(c), at(d));
      }
      return square > least * least;
    });
    if (!apart) return false;
  }
  return true;
}

// The topology of a single triangle.
const std::shared_ptr<const Topology>& OfTriangle() {
  static const std::shared_ptr<const Topology> topology = [] {
    std::vector<std::int32_t> order;
    return std::make_shared<const Topology>(
        MakeTopology({{{0, 1, 2}}, {-1, -1, -1}, std::vector<Vec3>(3, Vec3::Zero())}, &order));
  }();
  return topology;
}

}  // namespace

Chart MakeChart(const FlatMesh& disc, const std::vector<std::int32_t>& faces,
                const std::vector<std::pair<std::int32_t, std::int32_t>>& slits, const Execution& execution) {
  Chart chart;
  if (disc.faces.size() == 1 && disc.faces[0] == Face{0, 1, 2} && disc.opposite == OfTriangle()->opposite) {
    chart.topology = OfTriangle();
    chart.faces = {0};
  } else {
    chart.topology = std::make_shared<const Topology>(MakeTopology(disc, &chart.faces, execution));
  }
  std::vector<std::int32_t> place;
  if (!slits.empty()) place.resize(chart.faces.size());
  for (std::int32_t f = 0; f < static_cast<std::int32_t>(place.size()); ++f) place[chart.faces[f]] = f;
  for (const auto& [c, d] : slits) chart.slits.emplace_back(3 * place[c / 3] + c % 3, 3 * place[d / 3] + d % 3);
  for (std::int32_t& f : chart.faces) f = faces[f];
  return chart;
}

std::vector<std::int32_t> OppositeWithClosedSlits(const Chart& chart, const std::vector<std::int32_t>& closed_slits) {
  std::vector<std::int32_t> opposite = chart.topology->opposite;
  for (const std::int32_t i : closed_slits) {
    const auto [c, d] = chart.slits[i];
    opposite[c] = d;
    opposite[d] = c;
  }
  return opposite;
}

std::vector<Vec2> OutlineOf(const Chart& chart, const std::vector<Vec2>& positions) {
  std::vector<Vec2> outline;
  const Loops loops = BoundaryLoops(chart.topology->opposite);
  for (const std::int32_t c : loops[0]) outline.push_back(positions[Origin(chart.topology->faces, c)]);
  return outline;
}

double ExtentOf(const std::vector<Vec2>& points) {
  Box box;
  for (const Vec2& p : points) box.Add(p);
  double square = 0;
  for (const Vec2& p : points) square = std::max(square, (p - (box.low + box.high) / 2).squaredNorm());
  return 2 * std::sqrt(square);
}

ChartFaults FindFaults(const Mesh& mesh, const Chart& chart, const ChartMap& map, const std::vector<char>& ignored,
                       double resolution, const Execution& execution) {
  ChartFaults faults;
  const auto sums = execution.SumUp<MapSums>(chart.topology->num_faces(), [&](std::int32_t f, MapSums* sum) {
    if (chart.is_widened(f) || (!ignored.empty() && ignored[chart.faces[f]])) return;
    sum->Add(TriangleOf(map.positions, chart.topology->faces[f]).data(),
             TriangleOf(mesh.positions, mesh.faces[chart.faces[f]]).data());
  });
  faults.stretch = sums.StretchL2();
  faults.extent = ExtentOf(map.positions);
  if (StaysApart(chart, map, resolution)) return faults;
  std::vector<char> own_ignored;
  if (!ignored.empty()) {
    for (const std::int32_t f : chart.faces) own_ignored.push_back(ignored[f]);
  }
  const std::vector<std::int32_t> opposite = OppositeWithClosedSlits(chart, map.closed_slits);
  const CornerUv uv = UvOfChart(chart, map.positions);
  const OrientationFaults orientation = CheckOrientations(uv, execution, own_ignored);
  Overlaps overlaps = CheckOverlaps(opposite, uv, orientation, execution, own_ignored, /*max_pairs=*/1);
  if (overlaps.pairs == 0 && resolution > 0) {
    overlaps = OverlapsAfterRounding(chart, map, opposite, own_ignored, resolution, execution);
  }
  faults.flipped_or_degenerate = orientation.flipped + orientation.degenerate;
  faults.is_injective = faults.flipped_or_degenerate + overlaps.pairs == 0;
  if (overlaps.faces.size() >= 2) {
    faults.face = chart.faces[overlaps.faces[0]];
    faults.other_face = chart.faces[overlaps.faces[1]];
  }
  return faults;
}

absl::StatusOr<ChartMap> LayOutChart(const Mesh& mesh, const Chart& chart, Flattening flattening,
                                     const Execution& execution) {
  auto summary = std::make_shared<const FlattenSummary>(std::move(flattening.summary));
  if (chart.is_triangle_as_measured()) return LayOutTriangle(mesh, chart, std::move(summary), execution);
  return PlaceChart(mesh, chart, std::move(summary), LayOut(*chart.topology, flattening.angles, execution), execution);
}

absl::StatusOr<ChartMap> LayOutTriangle(const Mesh& mesh, const Chart& chart,
                                        std::shared_ptr<const FlattenSummary> summary, const Execution& execution) {
  // The edges are more precise than the angles: if two angles are `a` radians, their rounding moves a corner along the
  // longest edge by the fraction eps / a of the edge, which is far more than the altitude of a needle.
  const std::array<std::int32_t, 3>& corners = mesh.faces[chart.faces[0]];
  const auto length = [&](int k) { return (mesh.positions[corners[Next(k)]] - mesh.positions[corners[k]]).norm(); };
  const int first = std::max({0, 1, 2}, [&](int a, int b) { return length(a) < length(b); });
  const double longest = length(first);
  const Vec3& origin = mesh.positions[corners[first]];
  const Vec3 along = (mesh.positions[corners[Next(first)]] - origin) / longest;
  const Vec3 apex = mesh.positions[corners[Prev(first)]] - origin;
  std::vector<Vec2> positions(3);
  const std::array<std::int32_t, 3>& vertices = chart.topology->faces[0];
  positions[vertices[first]] = Vec2::Zero();
  positions[vertices[Next(first)]] = Vec2(longest, 0);
  positions[vertices[Prev(first)]] = Vec2(apex.dot(along), along.cross(apex).norm());
  return PlaceChart(mesh, chart, std::move(summary), std::move(positions), execution);
}

absl::StatusOr<ChartMap> PlaceChart(const Mesh& mesh, const Chart& chart, std::shared_ptr<const FlattenSummary> summary,
                                    std::vector<Vec2> positions, const Execution& execution) {
  if (execution.IsCancelled()) return absl::CancelledError("cancelled");
  ChartMap map;
  map.flatten = std::move(summary);
  if (!std::all_of(positions.begin(), positions.end(), [](const Vec2& p) { return p.allFinite(); })) {
    return MakeError(absl::StatusCode::kInternal, "SOLVER_FAILED",
                     absl::StrCat("the layout has non-finite coordinates; ", map.flatten->stop_message));
  }
  map.positions = std::move(positions);
  map.closed_slits = CloseSlits(mesh, chart, &map.positions);
  ScaleToSurface(mesh, chart, execution, &map.positions);
  return map;
}

}  // namespace planish
