#include "core/unwrap/hole_filling.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <numeric>
#include <utility>
#include <vector>

#include "core/abf/layout.h"
#include "core/abf/target_angles.h"
#include "core/base/status_macros.h"
#include "core/mesh/face_order.h"
#include "core/mesh/half_edges.h"
#include "core/mesh/rows.h"

namespace planish {
namespace {

constexpr double kFanWeight = 0.01;  // of an angle of a fan, relative to others
constexpr double kLeastAngle = 0.1;  // of a fan, radians, where the faces round a hole leave it less

// The faces of the chart, then those of fans, before they are sorted.
class Filling {
 public:
  Filling(const Mesh& mesh, const Chart& chart) : mesh_(mesh), chart_(chart), opposite_(chart.topology.opposite) {}

  bool Run() {
    Glue();
    if (!FindLoops()) return false;
    for (const std::vector<std::int32_t>& loop : loops_) {
      if (loop != loops_[outer_]) AddFan(loop);
    }
    return true;
  }

  FilledChart Result(const Execution& execution) {
    Topology topology;
    topology.num_vertices = static_cast<std::int32_t>(places_.size());
    topology.faces = faces_;
    topology.opposite = opposite_;
    std::vector<char> is_outline(places_.size(), 0);
    for (std::int32_t c = 0; c < static_cast<std::int32_t>(opposite_.size()); ++c) {
      if (opposite_[c] < 0) is_outline[Origin(faces_, c)] = 1;
    }
    std::vector<std::int32_t> interior;
    for (std::int32_t v = 0; v < topology.num_vertices; ++v) {
      if (!is_outline[v]) interior.push_back(v);
    }
    topology.num_interior = static_cast<std::int32_t>(interior.size());
    AssignRows(InSpatialOrder(places_, interior, execution), &topology);
    SortedTopology sorted = SortFaces(topology);
    FilledChart filled;
    filled.topology = std::move(sorted.topology);
    const std::int32_t own = chart_.topology.num_faces();
    for (const std::int32_t f : sorted.face) {
      for (std::int32_t k = 0; k < 3; ++k) filled.corner.push_back(f < own ? 3 * f + k : -1);
    }
    return filled;
  }

 private:
  Vec3 Place(std::int32_t c) const { return mesh_.positions[mesh_.faces[chart_.faces[c / 3]][c % 3]]; }

  // Joins both sides of slits; numbers vertices anew.
  void Glue() {
    const std::vector<Face>& faces = chart_.topology.faces;
    std::vector<std::int32_t> parent(chart_.topology.num_vertices);
    std::iota(parent.begin(), parent.end(), 0);
    const auto root = [&](std::int32_t v) {
      while (parent[v] != v) v = parent[v] = parent[parent[v]];
      return v;
    };
    for (const auto& [c, d] : chart_.slits) {
      opposite_[c] = d;
      opposite_[d] = c;
      for (const auto& [v, w] :
           {std::pair(Origin(faces, c), Target(faces, d)), std::pair(Target(faces, c), Origin(faces, d))}) {
        const std::int32_t a = root(v), b = root(w);
        parent[std::max(a, b)] = std::min(a, b);
      }
    }
    std::vector<std::int32_t> number(parent.size(), -1);
    for (std::int32_t c = 0; c < chart_.topology.num_corners(); ++c) {
      const std::int32_t v = root(faces[c / 3][c % 3]);
      if (number[v] < 0) {
        number[v] = static_cast<std::int32_t>(places_.size());
        places_.push_back(Place(c));
      }
      if (c % 3 == 0) faces_.emplace_back();
      faces_.back()[c % 3] = number[v];
    }
  }

  // Returns whether there are two loops or more and no handle.
  bool FindLoops() {
    std::vector<char> seen(opposite_.size(), 0);
    double longest = -1;
    std::int64_t outline_edges = 0;
    for (std::int32_t start = 0; start < static_cast<std::int32_t>(opposite_.size()); ++start) {
      if (opposite_[start] >= 0 || seen[start]) continue;
      loops_.emplace_back();
      double length = 0;
      std::int32_t c = start;
      do {
        seen[c] = 1;
        loops_.back().push_back(c);
        length += (places_[Target(faces_, c)] - places_[Origin(faces_, c)]).norm();
        c = NextOnOutline(opposite_, c);
      } while (c != start);
      outline_edges += static_cast<std::int64_t>(loops_.back().size());
      if (loops_.back().size() < 3) return false;
      if (length > longest) longest = length, outer_ = loops_.size() - 1;
    }
    const auto vertices = static_cast<std::int64_t>(places_.size()), faces = static_cast<std::int64_t>(faces_.size());
    const std::int64_t edges = (3 * faces + outline_edges) / 2;
    return loops_.size() > 1 && vertices - edges + faces == 2 - static_cast<std::int64_t>(loops_.size());
  }

  void AddFan(const std::vector<std::int32_t>& loop) {
    const auto middle = static_cast<std::int32_t>(places_.size());
    const auto first = static_cast<std::int32_t>(faces_.size()), n = static_cast<std::int32_t>(loop.size());
    Vec3 sum = Vec3::Zero();
    for (const std::int32_t c : loop) sum += places_[Origin(faces_, c)];
    places_.push_back(sum / n);
    opposite_.resize(opposite_.size() + static_cast<std::size_t>(3 * n));
    for (std::int32_t i = 0; i < n; ++i) {
      const std::int32_t c = loop[i], f = first + i;
      faces_.push_back({Target(faces_, c), Origin(faces_, c), middle});
      opposite_[c] = 3 * f + 2;
      opposite_[3 * f + 2] = c;
      // Its edge from the middle to the target of c is the next face's edge from its second vertex to the middle.
      opposite_[3 * f + 1] = 3 * (first + (i + 1) % n);
      opposite_[3 * f] = 3 * (first + (i + n - 1) % n) + 1;
    }
  }

  const Mesh& mesh_;
  const Chart& chart_;
  std::vector<std::int32_t> opposite_;
  std::vector<Face> faces_;
  std::vector<Vec3> places_;                      // on the surface, per vertex
  std::vector<std::vector<std::int32_t>> loops_;  // half-edges
  std::size_t outer_ = 0;
};

}  // namespace

std::optional<FilledChart> FillHoles(const Mesh& mesh, const Chart& chart, const Execution& execution) {
  if (chart.slits.empty()) return std::nullopt;
  Filling filling(mesh, chart);
  if (!filling.Run()) return std::nullopt;
  return filling.Result(execution);
}

absl::StatusOr<ChartMap> MapFilled(const Mesh& mesh, const Chart& chart, const FilledChart& filled,
                                   const Eigen::VectorXd& measured, const FlattenOptions& options,
                                   const FlattenControl& control, const Execution& execution) {
  const Topology& topology = filled.topology;
  Eigen::VectorXd angles(topology.num_corners());
  std::vector<double> sum(topology.num_vertices, 0);
  for (std::int32_t c = 0; c < topology.num_corners(); ++c) {
    if (filled.corner[c] < 0) continue;
    angles[c] = measured[filled.corner[c]];
    sum[topology.faces[c / 3][c % 3]] += angles[c];
  }
  // Two corners of a fan at every vertex round a hole.
  const auto left_over = [&](std::int32_t v) { return std::max(kLeastAngle, (2 * std::numbers::pi - sum[v]) / 2); };
  for (std::int32_t f = 0; f < topology.num_faces(); ++f) {
    if (filled.corner[3 * f] >= 0) continue;
    const double a = left_over(topology.faces[f][0]), b = left_over(topology.faces[f][1]);
    angles[3 * f] = a;
    angles[3 * f + 1] = b;
    angles[3 * f + 2] = std::max(kLeastAngle, std::numbers::pi - a - b);
  }
  TargetAngles target = MakeTargetAngles(topology, angles, execution);
  for (std::int32_t c = 0; c < topology.num_corners(); ++c) {
    if (filled.corner[c] < 0) target.weight[c] *= kFanWeight;
  }
  if (execution.IsStopped()) return absl::CancelledError("cancelled");
  PLANISH_ASSIGN_OR_RETURN(Flattening flattening, FlattenAngles(topology, target, options, control));
  const Layout layout = LayOut(topology, flattening.angles, execution);
  std::vector<Vec2> positions(chart.topology.num_vertices);
  const TargetAngles own = MakeTargetAngles(chart.topology, measured, execution);
  double energy = 0;
  for (std::int32_t c = 0; c < topology.num_corners(); ++c) {
    const std::int32_t o = filled.corner[c];
    if (o < 0) continue;
    positions[chart.topology.faces[o / 3][o % 3]] = layout.positions[topology.faces[c / 3][c % 3]];
    const double off = flattening.angles[c] - own.angle[o];
    energy += own.weight[o] * off * off;
  }
  flattening.summary.energy = energy;
  return PlaceChart(mesh, chart, std::move(flattening.summary), std::move(positions), execution);
}

}  // namespace planish
