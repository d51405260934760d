#include "core/unwrap/hole_filling.h"

#include <algorithm>
#include <numbers>
#include <span>
#include <utility>
#include <vector>

#include "core/abf/layout.h"
#include "core/abf/target_angles.h"
#include "core/base/status_macros.h"
#include "core/mesh/angles.h"
#include "core/mesh/half_edges.h"
#include "core/mesh/import.h"
#include "core/mesh/tri_mesh.h"

namespace planish {
namespace {

constexpr double kFanWeight = 0.01;     // of an angle of a fan, relative to others
constexpr double kLeastFanAngle = 0.1;  // of a fan, radians, where the faces round a hole leave it less

// The chart with its slits glued. Face f is face f of the chart.
TriMesh Glued(const Mesh& mesh, const Chart& chart) {
  std::vector<std::int32_t> opposite = chart.topology.opposite;
  for (const auto& [c, d] : chart.slits) {
    opposite[c] = d;
    opposite[d] = c;
  }
  return LinkFaces(
      opposite, [&](std::int32_t c) { return mesh.faces[chart.faces[c / 3]][c % 3]; }, [](std::int32_t f) { return f; },
      mesh.positions);
}

void AddFan(std::span<const HalfedgeHandle> loop, TriMesh* mesh) {
  Vec3 sum = Vec3::Zero();
  for (const HalfedgeHandle h : loop) sum += mesh->point(mesh->from_vertex_handle(h));
  const VertexHandle middle = mesh->add_vertex(sum / static_cast<double>(loop.size()));
  // Corner 0 comes last, so that halfedge_handle() of the face is the half-edge that it faces.
  for (const HalfedgeHandle h : loop) {
    const VertexHandle from = mesh->from_vertex_handle(h), to = mesh->to_vertex_handle(h);
    mesh->add_face(middle, to, from);
  }
}

}  // namespace

std::optional<FilledChart> FillHoles(const Mesh& mesh, const Chart& chart, const Execution& execution) {
  if (chart.slits.empty()) return std::nullopt;
  TriMesh glued = Glued(mesh, chart);
  const auto loops = BoundaryLoops(glued);
  const auto characteristic =
      static_cast<std::int64_t>(glued.n_vertices() + glued.n_faces()) - static_cast<std::int64_t>(glued.n_edges());
  if (loops.count() < 2 || characteristic != 2 - loops.count()) return std::nullopt;
  std::int32_t outer = 0;
  double longest = -1;
  for (std::int32_t i = 0; i < loops.count(); ++i) {
    if (loops.loop(i).size() < 3) return std::nullopt;
    double length = 0;
    for (const HalfedgeHandle h : loops.loop(i)) length += glued.calc_edge_length(h);
    if (length > longest) longest = length, outer = i;
  }
  for (std::int32_t i = 0; i < loops.count(); ++i) {
    if (i != outer) AddFan(loops.loop(i), &glued);
  }
  FilledChart filled;
  std::vector<std::int32_t> order;
  filled.topology = MakeTopology(glued, &order, execution);
  filled.places = glued.property(glued.points_property_handle()).data_vector();
  for (const std::int32_t f : order) {
    for (std::int32_t k = 0; k < 3; ++k) filled.corner.push_back(f < chart.topology.num_faces() ? 3 * f + k : -1);
  }
  return filled;
}

FilledChart Unfilled(const Mesh& mesh, const Chart& chart) {
  const Topology& topology = chart.topology;
  FilledChart same = {topology, std::vector<std::int32_t>(topology.num_corners()),
                      std::vector<Vec3>(topology.num_vertices)};
  for (std::int32_t c = 0; c < topology.num_corners(); ++c) {
    same.corner[c] = c;
    same.places[topology.faces[c / 3][c % 3]] = mesh.positions[mesh.faces[chart.faces[c / 3]][c % 3]];
  }
  return same;
}

absl::StatusOr<ChartMap> PlaceFilled(const Mesh& mesh, const Chart& chart, const FilledChart& filled,
                                     const std::vector<Vec2>& places, const Eigen::VectorXd& measured,
                                     FlattenSummary summary, const Execution& execution) {
  const TargetAngles target = MakeTargetAngles(chart.topology, measured, execution);
  if (execution.IsCancelled()) return absl::CancelledError("cancelled");
  std::vector<Vec2> positions(chart.topology.num_vertices);
  for (std::int32_t c = 0; c < filled.topology.num_corners(); ++c) {
    const std::int32_t o = filled.corner[c];
    if (o >= 0) positions[chart.topology.faces[o / 3][o % 3]] = places[filled.topology.faces[c / 3][c % 3]];
  }
  summary.energy = 0;
  for (std::int32_t f = 0; f < chart.topology.num_faces(); ++f) {
    Eigen::Vector3d angles;
    TriangleAngles(TriangleOf(positions, chart.topology.faces[f]).data(), angles.data());
    const auto off = angles - target.angle.segment<3>(3 * f);
    summary.energy += target.weight.segment<3>(3 * f).cwiseProduct(off.cwiseAbs2()).sum();
  }
  return PlaceChart(mesh, chart, std::move(summary), std::move(positions), execution);
}

absl::StatusOr<ChartMap> MapFilled(const Mesh& mesh, const Chart& chart, const FilledChart& filled,
                                   const Eigen::VectorXd& measured, const FlattenOptions& options,
                                   const Execution& execution) {
  const Topology& topology = filled.topology;
  Eigen::VectorXd angles(topology.num_corners());
  std::vector<double> sum(topology.num_vertices, 0);
  for (std::int32_t c = 0; c < topology.num_corners(); ++c) {
    if (filled.corner[c] < 0) continue;
    angles[c] = measured[filled.corner[c]];
    sum[topology.faces[c / 3][c % 3]] += angles[c];
  }
  // Two corners of a fan at every vertex round a hole.
  const auto left_over = [&](std::int32_t v) { return std::max(kLeastFanAngle, (2 * std::numbers::pi - sum[v]) / 2); };
  for (std::int32_t f = 0; f < topology.num_faces(); ++f) {
    if (filled.corner[3 * f] >= 0) continue;
    const double a = left_over(topology.faces[f][0]), b = left_over(topology.faces[f][1]);
    angles[3 * f] = a;
    angles[3 * f + 1] = b;
    angles[3 * f + 2] = std::max(kLeastFanAngle, std::numbers::pi - a - b);
  }
  TargetAngles target = MakeTargetAngles(topology, angles, execution);
  for (std::int32_t c = 0; c < topology.num_corners(); ++c) {
    if (filled.corner[c] < 0) target.weight[c] *= kFanWeight;
  }
  if (execution.IsCancelled()) return absl::CancelledError("cancelled");
  PLANISH_ASSIGN_OR_RETURN(Flattening flattening, FlattenAngles(topology, target, options, {execution}));
  const std::vector<Vec2> laid_out = LayOut(topology, flattening.angles, execution);
  return PlaceFilled(mesh, chart, filled, laid_out, measured, std::move(flattening.summary), execution);
}

}  // namespace planish
