#include "core/unwrap/chart.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numeric>
#include <utility>

#include "Eigen/Geometry"
#include "absl/strings/str_cat.h"
#include "core/abf/layout.h"
#include "core/base/error.h"
#include "core/mesh/face_order.h"
#include "core/mesh/predicates.h"
#include "core/mesh/rows.h"
#include "core/unwrap/distortion.h"
#include "core/unwrap/verify.h"

namespace planish {
namespace {

// Vertices of the chart: a vertex of the mesh counts once for every fan of faces that the chart has round it.
struct ChartVertices {
  std::vector<std::int32_t> of_corner;  // per corner of the chart
  std::vector<Vec3> positions;
  std::vector<std::int32_t> interior, outline;
};

ChartVertices NumberVertices(const Surface& surface, const std::vector<std::int32_t>& faces,
                             const std::vector<std::int32_t>& opposite) {
  ChartVertices vertices;
  vertices.of_corner.assign(opposite.size(), -1);
  for (std::int32_t start = 0; start < static_cast<std::int32_t>(opposite.size()); ++start) {
    if (vertices.of_corner[start] >= 0) continue;
    const auto v = static_cast<std::int32_t>(vertices.positions.size());
    vertices.positions.push_back(surface.mesh->positions[surface.mesh->faces[faces[start / 3]][start % 3]]);
    bool closed = false;
    for (std::int32_t c = start;;) {
      vertices.of_corner[c] = v;
      const std::int32_t o = opposite[3 * (c / 3) + Next(c % 3)];
      if (o < 0) break;
      c = 3 * (o / 3) + Next(o % 3);
      if (c == start) {
        closed = true;
        break;
      }
    }
    (closed ? vertices.interior : vertices.outline).push_back(v);
    if (closed) continue;
    for (std::int32_t c = start;;) {
      vertices.of_corner[c] = v;
      const std::int32_t o = opposite[3 * (c / 3) + Prev(c % 3)];
      if (o < 0) break;
      c = 3 * (o / 3) + Prev(o % 3);
    }
  }
  return vertices;
}

Chart Sorted(const Topology& topology, const std::vector<std::int32_t>& faces) {
  SortedTopology sorted = SortFaces(topology);
  Chart chart;
  chart.topology = std::move(sorted.topology);
  chart.faces = std::move(sorted.face);
  if (!faces.empty()) {
    for (std::int32_t& f : chart.faces) f = faces[f];
  }
  return chart;
}

// Corners at different vertices of the chart that are one in the mesh: each with the one before it.
std::vector<std::pair<std::int32_t, std::int32_t>> CornersOfOneVertex(const Mesh& mesh, const Chart& chart) {
  std::vector<std::array<std::int32_t, 3>> outline;  // vertex of the mesh, vertex, corner
  for (std::int32_t c = 0; c < chart.topology.num_corners(); ++c) {
    if (chart.topology.opposite[c] >= 0) continue;
    const std::int32_t corner = 3 * (c / 3) + Next(c % 3);
    outline.push_back({mesh.faces[chart.faces[c / 3]][corner % 3], chart.topology.faces[c / 3][corner % 3], corner});
  }
  std::sort(outline.begin(), outline.end());
  std::vector<std::pair<std::int32_t, std::int32_t>> pairs;
  for (std::size_t i = 1; i < outline.size(); ++i) {
    if (outline[i][0] == outline[i - 1][0]) pairs.emplace_back(outline[i - 1][2], outline[i][2]);
  }
  return pairs;
}

// Both sides of slits whose ends coincide, up to the errors of a solve and a layout, are moved to their middle, unless
// that turns a triangle over. So is what belongs to one vertex of the mesh where a chart touches itself there: apart by
// a rounding error, one side could come to lie on the other when it is rounded again.
std::vector<std::int32_t> CloseSlits(const Mesh& mesh, const Chart& chart, std::vector<Vec2>* positions) {
  constexpr double kCoincide = 1e-6;  // of the edge's length
  const std::vector<Face>& faces = chart.topology.faces;
  std::vector<std::int32_t> closed;
  std::vector<std::pair<std::int32_t, std::int32_t>> same;
  for (std::int32_t i = 0; i < static_cast<std::int32_t>(chart.slits.size()); ++i) {
    const auto [c, d] = chart.slits[i];
    const std::int32_t from = faces[c / 3][Next(c % 3)], to = faces[c / 3][Prev(c % 3)];
    const std::int32_t other_from = faces[d / 3][Prev(d % 3)], other_to = faces[d / 3][Next(d % 3)];
    const auto& p = *positions;
    const double near = kCoincide * (p[to] - p[from]).norm();
    if ((p[from] - p[other_from]).norm() > near || (p[to] - p[other_to]).norm() > near) continue;
    closed.push_back(i);
    same.emplace_back(from, other_from);
    same.emplace_back(to, other_to);
  }
  for (const auto& [c, d] : CornersOfOneVertex(mesh, chart)) {
    const std::int32_t v = faces[c / 3][c % 3], w = faces[d / 3][d % 3];
    const auto& p = *positions;
    const double edge =
        std::min((p[faces[c / 3][Next(c % 3)]] - p[v]).norm(), (p[faces[d / 3][Next(d % 3)]] - p[w]).norm());
    if ((p[v] - p[w]).norm() <= kCoincide * edge) same.emplace_back(v, w);
  }
  if (same.empty()) return closed;
  std::vector<std::int32_t> parent(positions->size());
  std::iota(parent.begin(), parent.end(), 0);
  const auto root = [&](std::int32_t v) {
    while (parent[v] != v) v = parent[v] = parent[parent[v]];
    return v;
  };
  std::vector<char> moves(positions->size(), 0);
  for (auto [v, w] : same) {
    moves[v] = moves[w] = 1;
    v = root(v), w = root(w);
    parent[std::max(v, w)] = std::min(v, w);
  }
  std::vector<Vec2> middle(positions->size(), Vec2::Zero());
  std::vector<int> count(positions->size(), 0);
  for (std::int32_t v = 0; v < static_cast<std::int32_t>(parent.size()); ++v) {
    if (!moves[v]) continue;
    middle[root(v)] += (*positions)[v];
    ++count[root(v)];
  }
  std::vector<Vec2> moved = *positions;
  for (std::int32_t v = 0; v < static_cast<std::int32_t>(parent.size()); ++v) {
    if (moves[v]) moved[v] = middle[root(v)] / count[root(v)];
  }
  for (const Face& face : faces) {
    const auto& [a, b, c] = face;
    if (!moves[a] && !moves[b] && !moves[c]) continue;
    if (Orientation((*positions)[a], (*positions)[b], (*positions)[c]) > 0 &&
        Orientation(moved[a], moved[b], moved[c]) <= 0) {
      return {};
    }
  }
  *positions = std::move(moved);
  return closed;
}

// The sum of body(corners in the plane, corners on the surface) over the faces.
template <typename Sum, typename Body>
Sum OverFaces(const Mesh& mesh, const Chart& chart, const std::vector<Vec2>& positions, const Execution& execution,
              const Body& body) {
  Sum sum;
  for (const Sum& part : execution.Collect<Sum>(chart.topology.num_faces(), [&](std::int64_t begin, std::int64_t end) {
         Sum chunk;
         for (std::int64_t f = begin; f < end; ++f) {
           Vec2 p[3];
           Vec3 q[3];
           for (int k = 0; k < 3; ++k) {
             p[k] = positions[chart.topology.faces[f][k]];
             q[k] = mesh.positions[mesh.faces[chart.faces[f]][k]];
           }
           body(chart.faces[f], p, q, &chunk);
         }
         return chunk;
       })) {
    sum.Add(part);
  }
  return sum;
}

struct Extent {
  double surface_area = 0, map_area = 0, surface_edges = 0, map_edges = 0;
  void Add(const Extent& other) {
    surface_area += other.surface_area;
    map_area += other.map_area;
    surface_edges += other.surface_edges;
    map_edges += other.map_edges;
  }
};

// To the area of the surface; where that is next to nothing, to the length of its edges.
void ScaleToSurface(const Mesh& mesh, const Chart& chart, const Execution& execution, std::vector<Vec2>* positions) {
  const auto extent = OverFaces<Extent>(mesh, chart, *positions, execution,
                                        [](std::int32_t, const Vec2 p[3], const Vec3 q[3], Extent* sum) {
                                          const Vec2 e1 = p[1] - p[0], e2 = p[2] - p[0];
                                          sum->map_area += std::abs(e1.x() * e2.y() - e1.y() * e2.x()) / 2;
                                          sum->surface_area += (q[1] - q[0]).cross(q[2] - q[0]).norm() / 2;
                                          for (int k = 0; k < 3; ++k) {
                                            sum->map_edges += (p[Next(k)] - p[k]).norm();
                                            sum->surface_edges += (q[Next(k)] - q[k]).norm();
                                          }
                                        });
  const double by_edges = extent.map_edges > 0 ? extent.surface_edges / extent.map_edges : 1;
  const double by_area = extent.map_area > 0 ? std::sqrt(extent.surface_area / extent.map_area) : 0;
  const double scale = by_area > 1e-3 * by_edges ? by_area : by_edges;
  for (Vec2& p : *positions) p *= scale;
}

}  // namespace

Chart MakeChart(const Gluing& gluing, const std::vector<std::int32_t>& faces, const Execution& execution) {
  const Surface& surface = gluing.surface();
  const auto local_face = [&](std::int32_t f) {
    const auto at = std::lower_bound(faces.begin(), faces.end(), f);
    return at != faces.end() && *at == f ? static_cast<std::int32_t>(at - faces.begin()) : -1;
  };
  Topology topology;
  std::vector<std::pair<std::int32_t, std::int32_t>> slits;
  topology.opposite.reserve(3 * faces.size());
  for (std::int32_t f = 0; f < static_cast<std::int32_t>(faces.size()); ++f) {
    for (int k = 0; k < 3; ++k) {
      const std::int32_t c = 3 * faces[f] + k, o = surface.across[c];
      const std::int32_t g = o < 0 ? -1 : local_face(o / 3);
      const std::int32_t there = g < 0 ? -1 : 3 * g + o % 3;
      topology.opposite.push_back(gluing.IsOutline(c) ? -1 : there);
      if (gluing.IsOutline(c) && there > 3 * f + k) slits.emplace_back(3 * f + k, there);
    }
  }
  const ChartVertices vertices = NumberVertices(surface, faces, topology.opposite);
  topology.num_vertices = static_cast<std::int32_t>(vertices.positions.size());
  topology.num_interior = static_cast<std::int32_t>(vertices.interior.size());
  for (std::size_t f = 0; f < faces.size(); ++f) {
    topology.faces.push_back({vertices.of_corner[3 * f], vertices.of_corner[3 * f + 1], vertices.of_corner[3 * f + 2]});
  }
  AssignRows(InSpatialOrder(vertices.positions, vertices.interior, execution), &topology);

  Chart chart = Sorted(topology, faces);
  if (!slits.empty()) {
    std::vector<std::int32_t> place(faces.size());
    for (std::int32_t f = 0; f < topology.num_faces(); ++f) place[local_face(chart.faces[f])] = f;
    for (const auto& [c, d] : slits) chart.slits.emplace_back(3 * place[c / 3] + c % 3, 3 * place[d / 3] + d % 3);
  }
  return chart;
}

Chart MakeChart(const Topology& disc) {
  return Sorted(disc, {});
}

Eigen::VectorXd Gather(const Chart& chart, const double* corners) {
  Eigen::VectorXd values(chart.topology.num_corners());
  for (std::size_t f = 0; f < chart.faces.size(); ++f) {
    for (std::size_t k = 0; k < 3; ++k) values[3 * f + k] = corners[3 * static_cast<std::size_t>(chart.faces[f]) + k];
  }
  return values;
}

void Scatter(const Chart& chart, const Eigen::VectorXd& values, double* corners) {
  for (std::size_t f = 0; f < chart.faces.size(); ++f) {
    for (std::size_t k = 0; k < 3; ++k) corners[3 * static_cast<std::size_t>(chart.faces[f]) + k] = values[3 * f + k];
  }
}

namespace {

// Of a chart, with faces of its own.
struct ChartUv {
  CornerUv uv;
  std::vector<char> ignored;

  ChartUv(const Chart& chart, const std::vector<char>& ignored_in_mesh) : uv(2 * chart.topology.num_corners()) {
    if (ignored_in_mesh.empty()) return;
    for (const std::int32_t f : chart.faces) ignored.push_back(ignored_in_mesh[f]);
  }

  Overlaps FindOverlaps(const std::vector<std::int32_t>& opposite, const Execution& execution,
                        OrientationFaults* orientation) const {
    *orientation = CheckOrientations(uv, execution, ignored);
    return CheckOverlaps(opposite, uv, *orientation, execution, ignored);
  }
};

}  // namespace

double StretchOf(const Mesh& mesh, const Chart& chart, const CornerUv& uv, const std::vector<char>& ignored,
                 const Execution& execution) {
  MapSums sums;
  for (const MapSums& part :
       execution.Collect<MapSums>(chart.topology.num_faces(), [&](std::int64_t begin, std::int64_t end) {
         MapSums chunk;
         for (std::int64_t i = begin; i < end; ++i) {
           const std::size_t f = chart.faces[i];
           if (!ignored.empty() && ignored[f]) continue;
           Vec2 p[3];
           Vec3 q[3];
           for (std::size_t k = 0; k < 3; ++k) {
             p[k] = Vec2(uv[2 * (3 * f + k)], uv[2 * (3 * f + k) + 1]);
             q[k] = mesh.positions[mesh.faces[f][k]];
           }
           chunk.Add(p, q);
         }
         return chunk;
       })) {
    sums.Add(part);
  }
  return sums.StretchL2();
}

Overlaps OverlapsWithin(const Chart& chart, const std::vector<std::int32_t>& opposite, const CornerUv& uv,
                        const std::vector<char>& ignored, const Execution& execution) {
  ChartUv own(chart, ignored);
  std::vector<std::int32_t> own_opposite = chart.topology.opposite;
  for (const auto& [c, d] : chart.slits) {
    if (opposite[3 * chart.faces[c / 3] + c % 3] < 0) continue;
    own_opposite[c] = d;
    own_opposite[d] = c;
  }
  for (std::size_t i = 0; i < own.uv.size(); ++i) {
    own.uv[i] = uv[6 * static_cast<std::size_t>(chart.faces[i / 6]) + i % 6];
  }
  OrientationFaults orientation;
  return own.FindOverlaps(own_opposite, execution, &orientation);
}

ChartFaults FindFaults(const Mesh& mesh, const Chart& chart, const ChartMap& map, const std::vector<char>& ignored,
                       const Execution& execution) {
  ChartFaults faults;
  const auto sums = OverFaces<MapSums>(mesh, chart, map.positions, execution,
                                       [&](std::int32_t f, const Vec2 p[3], const Vec3 q[3], MapSums* sum) {
                                         if (ignored.empty() || !ignored[f]) sum->Add(p, q);
                                       });
  faults.stretch = sums.StretchL2();
  std::vector<std::int32_t> opposite = chart.topology.opposite;
  for (const std::int32_t i : map.closed_slits) {
    const auto [c, d] = chart.slits[i];
    opposite[c] = d;
    opposite[d] = c;
  }
  ChartUv own(chart, ignored);
  for (std::int32_t c = 0; c < chart.topology.num_corners(); ++c) {
    const Vec2& p = map.positions[chart.topology.faces[c / 3][c % 3]];
    own.uv[2 * c] = p.x();
    own.uv[2 * c + 1] = p.y();
  }
  OrientationFaults orientation;
  const Overlaps overlaps = own.FindOverlaps(opposite, execution, &orientation);
  faults.turned = orientation.flipped + orientation.degenerate;
  faults.does_overlap = faults.turned + overlaps.pairs > 0;
  Vec2 low = map.positions.front(), high = low;
  for (const Vec2& p : map.positions) {
    low = low.cwiseMin(p);
    high = high.cwiseMax(p);
  }
  double square = 0;
  for (const Vec2& p : map.positions) square = std::max(square, (p - (low + high) / 2).squaredNorm());
  faults.extent = 2 * std::sqrt(square);
  if (overlaps.faces.size() >= 2) {
    faults.face = chart.faces[overlaps.faces[0]];
    faults.other_face = chart.faces[overlaps.faces[1]];
  }
  return faults;
}

absl::StatusOr<Flattening> FlattenChart(const Chart& chart, Eigen::VectorXd measured, const FlattenOptions& options,
                                        const FlattenControl& control, const Execution& execution) {
  const TargetAngles target = MakeTargetAngles(chart.topology, measured, execution);
  measured.resize(0);
  if (execution.IsStopped()) return absl::CancelledError("cancelled");
  return FlattenAngles(chart.topology, target, options, control);
}

absl::StatusOr<ChartMap> LayOutChart(const Mesh& mesh, const Chart& chart, Flattening flattening,
                                     const Execution& execution) {
  Layout layout = LayOut(chart.topology, flattening.angles, execution);
  return PlaceChart(mesh, chart, std::move(flattening.summary), std::move(layout.positions), execution);
}

absl::StatusOr<ChartMap> PlaceChart(const Mesh& mesh, const Chart& chart, FlattenSummary summary,
                                    std::vector<Vec2> positions, const Execution& execution) {
  if (execution.IsStopped()) return absl::CancelledError("cancelled");
  ChartMap map;
  map.flatten = std::move(summary);
  if (!std::all_of(positions.begin(), positions.end(), [](const Vec2& p) { return p.allFinite(); })) {
    return MakeError(absl::StatusCode::kInternal, "SOLVER_FAILED",
                     absl::StrCat("the layout has non-finite coordinates; ", map.flatten.stop_message));
  }
  map.positions = std::move(positions);
  map.closed_slits = CloseSlits(mesh, chart, &map.positions);
  ScaleToSurface(mesh, chart, execution, &map.positions);
  return map;
}

}  // namespace planish
