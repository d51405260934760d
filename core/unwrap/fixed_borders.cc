#include "core/unwrap/fixed_borders.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <optional>
#include <utility>

#include "Eigen/Core"
#include "Eigen/Geometry"
#include "Eigen/OrderingMethods"
#include "core/abf/layout.h"
#include "core/abf/target_angles.h"
#include "core/base/error.h"
#include "core/base/portable_math.h"
#include "core/base/status_macros.h"
#include "core/linalg/sparse_elimination.h"
#include "core/mesh/angles.h"
#include "core/mesh/half_edges.h"
#include "core/unwrap/distortion.h"
#include "core/unwrap/holes.h"
#include "core/unwrap/relaxing.h"
#include "core/unwrap/steps.h"
#include "core/unwrap/widening.h"

namespace planish {
namespace {

constexpr int kMostSolves = 30;
constexpr double kLeastGain = 1e-3;  // reduction of the stretch that is worth another solve
// Least angles (radians) and lengths (relative to the mean), for triangles with next to no area.
constexpr double kLeastAngle = 1e-3, kLeastLength = 1e-4;

class BarycentricMap {
 public:
  BarycentricMap(const Topology& disc, const std::vector<Vec3>& places) : disc_(disc), places_(places) {
    row_.assign(disc.num_vertices, 0);
    PutOutlineOnCircle();
    for (std::int32_t& row : row_) {
      if (row >= 0) row = rows_++;
    }
    AddMeanValueWeights();
    OrderRows();
  }

  std::vector<Vec2> Run(const Execution& execution) {
    std::vector<double> draws(disc_.num_vertices, 1);  // factor on the weights towards each vertex
    std::vector<Vec2> best;
    double least = 0;
    for (int solve = 0; solve < kMostSolves && !execution.IsCancelled(); ++solve) {
      const std::vector<Vec2> positions = Solve(draws);
      if (positions.empty()) break;
      std::vector<MapSums> around(disc_.num_vertices);
      MapSums all;
      for (const Face& face : disc_.faces) {
        MapSums one;
        one.Add(TriangleOf(positions, face).data(), TriangleOf(places_, face).data());
        if (!(one.surface_area > 0)) continue;
        all.Add(one);
        for (const std::int32_t v : face) around[v].Add(one);
      }
      const double stretch = all.StretchL2();
      if (!std::isfinite(stretch)) break;
      if (!best.empty() && execution.IsStopRequested()) break;
      if (!best.empty() && stretch > (1 - kLeastGain) * least) break;
      best = positions;
      least = stretch;
      for (std::int32_t v = 0; v < disc_.num_vertices; ++v) {
        if (around[v].surface_area > 0) draws[v] /= std::sqrt(around[v].stretch / around[v].surface_area) / stretch;
      }
    }
    return execution.IsCancelled() ? std::vector<Vec2>() : best;
  }

 private:
  void PutOutlineOnCircle() {
    positions_.assign(disc_.num_vertices, Vec2::Zero());
    std::vector<std::pair<std::int32_t, double>> outline;  // vertices, and the distance to each along the outline
    double length = 0;
    const Loops loops = BoundaryLoops(disc_.opposite);
    for (const std::int32_t c : loops[0]) {
      const std::int32_t from = Origin(disc_.faces, c), to = Target(disc_.faces, c);
      outline.emplace_back(from, length);
      length += std::max((places_[to] - places_[from]).norm(), 1e-300);
    }
    // Keeps vertices apart, however short the edge between them.
    const double even = kLeastLength * length / static_cast<double>(outline.size());
    const double whole = length + even * static_cast<double>(outline.size());
    for (std::size_t i = 0; i < outline.size(); ++i) {
      const double turn = 2 * std::numbers::pi * (outline[i].second + even * static_cast<double>(i)) / whole;
      positions_[outline[i].first] = Vec2(portable::Cos(turn), portable::Sin(turn));
      row_[outline[i].first] = -1;
    }
  }

  // Adds Floater's mean value weights: tan(half of the angle at i) / length, from both sides of the edge from i to j.
  void AddMeanValueWeights() {
    double mean = 0;
    for (std::int32_t c = 0; c < disc_.num_corners(); ++c) {
      mean += (places_[Target(disc_.faces, c)] - places_[Origin(disc_.faces, c)]).norm() / disc_.num_corners();
    }
    const double shortest = std::max(kLeastLength * mean, 1e-300);
    for (const Face& face : disc_.faces) {
      for (int k = 0; k < 3; ++k) {
        const std::int32_t i = face[k];
        if (row_[i] < 0) continue;
        const Vec3 to_next = places_[face[(k + 1) % 3]] - places_[i], to_last = places_[face[(k + 2) % 3]] - places_[i];
        const double angle = portable::Atan2(to_next.cross(to_last).norm(), to_next.dot(to_last));
        const double half = portable::Tan(std::clamp(angle, kLeastAngle, std::numbers::pi - kLeastAngle) / 2);
        weights_.push_back({i, face[(k + 1) % 3], half / std::max(to_next.norm(), shortest)});
        weights_.push_back({i, face[(k + 2) % 3], half / std::max(to_last.norm(), shortest)});
      }
    }
  }

  // Puts the rows in an order that keeps U sparse (approximate minimum degree).
  void OrderRows() {
    if (rows_ == 0) return;
    using Permutation = Eigen::PermutationMatrix<Eigen::Dynamic, Eigen::Dynamic, int>;
    Permutation order;  // the row that comes first, second, ...
    const std::vector<double> draws(disc_.num_vertices, 1);
    Eigen::AMDOrdering<int>()(Eigen::SparseMatrix<double>(Matrix(draws, nullptr)), order);
    const Permutation place = order.inverse();
    for (std::int32_t& row : row_) {
      if (row >= 0) row = place.indices()[row];
    }
  }

  // The matrix, with every row divided by the sum of its weights. `right`, unless null, gets the right-hand side.
  SparseElimination::Matrix Matrix(const std::vector<double>& draws, std::vector<Vec2>* right) const {
    std::vector<double> sum(rows_, 0);
    for (const Weight& w : weights_) sum[row_[w.from]] += w.weight * draws[w.to];
    std::vector<Eigen::Triplet<double>> entries;
    entries.reserve(rows_ + weights_.size());
    for (std::int32_t i = 0; i < rows_; ++i) entries.emplace_back(i, i, 1);
    for (const Weight& w : weights_) {
      const std::int32_t row = row_[w.from];
      const double share = w.weight * draws[w.to] / sum[row];
      if (row_[w.to] >= 0) {
        entries.emplace_back(row, row_[w.to], -share);
      } else if (right != nullptr) {
        (*right)[row] += share * positions_[w.to];
      }
    }
    SparseElimination::Matrix matrix(rows_, rows_);
    matrix.setFromTriplets(entries.begin(), entries.end());
    return matrix;
  }

  // The positions of all vertices; empty if the matrix is singular in double precision.
  std::vector<Vec2> Solve(const std::vector<double>& draws) {
    std::vector<Vec2> solution(rows_, Vec2::Zero());
    const SparseElimination::Matrix matrix = Matrix(draws, &solution);
    if (!elimination_) elimination_.emplace(matrix);
    elimination_->Solve(matrix, &solution);
    std::vector<Vec2> positions = positions_;
    for (std::int32_t v = 0; v < disc_.num_vertices; ++v) {
      if (row_[v] >= 0) positions[v] = solution[row_[v]];
      if (!positions[v].allFinite()) return {};
    }
    return positions;
  }

  struct Weight {
    std::int32_t from, to;
    double weight;
  };

  const Topology& disc_;
  const std::vector<Vec3>& places_;
  std::vector<Vec2> positions_;    // of the outline
  std::vector<std::int32_t> row_;  // of the matrix, per vertex; -1 on the outline
  std::int32_t rows_ = 0;
  std::vector<Weight> weights_;
  std::optional<SparseElimination> elimination_;  // created by the first solve
};

constexpr double kMostStretchOfAbf = 3;  // of a map that a barrier keeps open
// If another map has replaced ABF's, and its stretch exceeds kStretchToLower, a barycentric map is tried as well. It is
// used if its stretch is less by the factor kWorthMeans.
constexpr double kStretchToLower = 1.1, kWorthMeans = 1.05;
// Most stretch of a map with filled holes, relative to the slit map: a tube is better slit than flattened as a ring.
// With SeamPolicy::kKeep a tube stays a ring up to kMuchStretch, beyond which there would be a warning.
constexpr double kMostStretchForHoles = 1.1;
// For more faces, a convex outline takes many seconds (an active set of thousands), and so does a barycentric map.
constexpr std::int32_t kMostFacesForConvex = 10'000, kMostFacesForBarycentres = 200'000;

constexpr double kFanWeight = 0.01;     // weight of a fan's angle, relative to others
constexpr double kLeastFanAngle = 0.1;  // of a fan, radians, if the faces round a hole leave less

// The chart without filled holes.
FilledChart Unfilled(const Mesh& mesh, const Chart& chart) {
  const Topology& topology = *chart.topology;
  FilledChart same = {topology, std::vector<std::int32_t>(topology.num_corners()),
                      std::vector<Vec3>(topology.num_vertices)};
  for (std::int32_t c = 0; c < topology.num_corners(); ++c) {
    same.corner[c] = c;
    same.places[topology.faces[c / 3][c % 3]] = mesh.positions[mesh.faces[chart.faces[c / 3]][c % 3]];
  }
  return same;
}

// A chart that may get another map.
struct Candidate {
  const ChartSolve& solve;
  Job* job;
  MappedChart* mapped;
  const Execution& execution;
  std::int64_t work_left;             // WorkLimits::other_map
  Eigen::VectorXd measured;           // AnglesToKeep()
  FlattenSummary summary;             // of the first solve
  std::optional<FilledChart> filled;  // if the chart is planar with holes, which are slit open

  const Topology& topology() const { return *mapped->chart.topology; }
  // Whether the current map overlaps itself, or is open only by a barrier and too stretched.
  bool is_no_use() const {
    return !mapped->faults.is_injective ||
           (mapped->map.flatten->barrier > 0 && mapped->faults.stretch > kMostStretchOfAbf);
  }
};

// The map of the chart with these positions of its vertices. The map gets `summary`, with the energy of the map.
absl::StatusOr<ChartMap> PlaceOwn(const Candidate& c, std::vector<Vec2> positions, FlattenSummary summary) {
  const TargetAngles target = MakeTargetAngles(c.topology(), c.measured, c.execution);
  if (c.execution.IsCancelled()) return absl::CancelledError("cancelled");
  summary.energy = 0;
  for (std::int32_t f = 0; f < c.topology().num_faces(); ++f) {
    Eigen::Vector3d angles;
    TriangleAngles(TriangleOf(positions, c.topology().faces[f]).data(), angles.data());
    const Eigen::Vector3d off = angles - target.angle.segment<3>(3 * f);
    summary.energy += target.weight.segment<3>(3 * f).cwiseProduct(off.cwiseAbs2()).sum();
  }
  return PlaceChart(c.job->mesh, c.mapped->chart, std::make_shared<const FlattenSummary>(std::move(summary)),
                    std::move(positions), c.execution);
}

// PlaceOwn() with positions of the filled chart's vertices.
absl::StatusOr<ChartMap> PlaceFilled(const Candidate& c, const FilledChart& filled, const std::vector<Vec2>& places,
                                     FlattenSummary summary) {
  std::vector<Vec2> positions(c.topology().num_vertices);
  for (std::int32_t corner = 0; corner < filled.topology.num_corners(); ++corner) {
    const std::int32_t own = filled.corner[corner];
    if (own < 0) continue;
    positions[c.topology().faces[own / 3][own % 3]] = places[filled.topology.faces[corner / 3][corner % 3]];
  }
  return PlaceOwn(c, std::move(positions), std::move(summary));
}

// Maps the filled chart by ABF; all slits are closed. Fans get the angles that the faces round a hole leave them, with
// little weight.
absl::StatusOr<ChartMap> MapByAbf(const Candidate& c) {
  const FilledChart& filled = *c.filled;
  const Topology& topology = filled.topology;
  Eigen::VectorXd angles(topology.num_corners());
  std::vector<double> sum(topology.num_vertices, 0);
  for (std::int32_t corner = 0; corner < topology.num_corners(); ++corner) {
    if (filled.corner[corner] < 0) continue;
    angles[corner] = c.measured[filled.corner[corner]];
    sum[topology.faces[corner / 3][corner % 3]] += angles[corner];
  }
  // A fan has two corners at every vertex round a hole.
  const auto left_over = [&](std::int32_t v) { return std::max(kLeastFanAngle, (2 * std::numbers::pi - sum[v]) / 2); };
  for (std::int32_t f = 0; f < topology.num_faces(); ++f) {
    if (filled.corner[3 * f] >= 0) continue;
    const double a = left_over(topology.faces[f][0]), b = left_over(topology.faces[f][1]);
    angles.segment<3>(3 * f) << a, b, std::max(kLeastFanAngle, std::numbers::pi - a - b);
  }
  TargetAngles target = MakeTargetAngles(topology, angles, c.execution);
  for (std::int32_t corner = 0; corner < topology.num_corners(); ++corner) {
    if (filled.corner[corner] < 0) target.weight[corner] *= kFanWeight;
  }
  if (c.execution.IsCancelled()) return absl::CancelledError("cancelled");
  FlattenControl control = ControlOf(c.solve);
  control.most_work = c.work_left;
  PLANISH_ASSIGN_OR_RETURN(Flattening flattening, FlattenAngles(topology, target, c.job->options.flatten, control));
  c.mapped->work += static_cast<double>(flattening.summary.work);
  const std::vector<Vec2> laid_out = LayOut(topology, flattening.angles, c.execution);
  return PlaceFilled(c, filled, laid_out, std::move(flattening.summary));
}

// A barycentric map, of the filled chart if there is one. INTERNAL, SOLVER_FAILED: there is no such map.
absl::StatusOr<ChartMap> MapByMeans(const Candidate& c) {
  const FilledChart filled = c.filled ? *c.filled : Unfilled(c.job->mesh, c.mapped->chart);
  const std::vector<Vec2> drawn = MapByBarycentres(filled.topology, filled.places, c.execution);
  if (c.execution.IsCancelled()) return absl::CancelledError("cancelled");
  if (drawn.empty()) {
    return MakeError(absl::StatusCode::kInternal, "SOLVER_FAILED", "there is no barycentric map in double precision");
  }
  FlattenSummary summary = c.summary;
  summary.barrier = 0;
  summary.converged = true;
  PLANISH_ASSIGN_OR_RETURN(ChartMap map, PlaceFilled(c, filled, drawn, std::move(summary)));
  const std::vector<char>& ignored = c.solve.charts.ignored;
  PLANISH_ASSIGN_OR_RETURN(
      map, PlaceOwn(c, RelaxedPositions(c.job->mesh, c.mapped->chart, map, ignored, c.execution), *map.flatten));
  map.is_barycentric = true;
  return map;
}

// Maps the chart by ABF with a convex outline, which cannot overlap itself.
absl::StatusOr<ChartMap> MapConvex(const Candidate& c) {
  PLANISH_ASSIGN_OR_RETURN(Flattening convex, FlattenWith(c.solve, BoundaryType::kConvex, c.work_left, c.mapped));
  return LayOutChart(c.job->mesh, c.mapped->chart, std::move(convex), c.execution);
}

// The most stretch with which another map replaces the current one: if the current map is sound, its stretch divided by
// `better`, otherwise kMostStretchForBorders.
double MostStretch(const Candidate& c, double better) {
  const ChartFaults& present = c.mapped->faults;
  const bool is_sound = present.is_injective && present.stretch <= kMostStretchForBorders;
  return is_sound ? present.stretch / better : kMostStretchForBorders;
}

// MostStretch() for a map with filled holes, which replaces a map with slits.
double MostStretchWithHoles(const Candidate& c) {
  const double most = MostStretch(c, 1 / kMostStretchForHoles);
  return c.job->options.seams.policy == SeamPolicy::kKeep ? std::max(most, kMuchStretch) : most;
}

// Uses another map if it is sound and its stretch is at most `most`. Returns whether it did.
bool Takes(const Candidate& c, const Charts& charts, absl::StatusOr<ChartMap> map, double most) {
  if (!map.ok() || !map->flatten->converged) return false;
  const ChartFaults faults =
      FindFaults(c.job->mesh, c.mapped->chart, *map, charts.ignored, charts.resolution, c.execution);
  if (!faults.is_injective || !(faults.stretch <= most)) return false;
  c.mapped->map = *std::move(map);
  c.mapped->faults = faults;
  return true;
}

// Uses a map without slits, by ABF or barycentric, if one is sound and its stretch is small enough. Returns whether it
// did.
bool TakesFilled(const Candidate& c, const Charts& charts, bool is_small) {
  const double most = MostStretchWithHoles(c);
  const bool has_map = Takes(c, charts, MapByAbf(c), most);
  const bool is_good = has_map && c.mapped->faults.stretch <= kStretchToLower;
  if (is_good || !is_small || c.execution.IsStopRequested()) return has_map;
  return Takes(c, charts, MapByMeans(c), has_map ? c.mapped->faults.stretch / kWorthMeans : most) || has_map;
}

}  // namespace

std::vector<Vec2> MapByBarycentres(const Topology& disc, const std::vector<Vec3>& places, const Execution& execution) {
  return BarycentricMap(disc, places).Run(execution);
}

void MapWithFixedBorders(const ChartSolve& solve, MappedChart* mapped) {
  const auto& [job, charts, number, limits, execution, reports] = solve;
  Candidate c = {solve, job, mapped, execution, limits.other_map, {}, *mapped->map.flatten, std::nullopt};
  if (!mapped->is_slit() && !c.is_no_use()) return;
  c.measured = AnglesToKeep(mapped->chart, charts.AnglesOf(job->mesh, mapped->chart, execution));
  if (mapped->is_slit()) c.filled = FillHoles(job->mesh, mapped->chart, execution);
  const std::int32_t num_faces = c.topology().num_faces();
  const bool is_small = num_faces <= kMostFacesForBarycentres;
  const double before = mapped->work;
  // With filled holes the chart needs no slit; once it has such a map, the search ends.
  if (c.filled && TakesFilled(c, charts, is_small)) return;
  if (execution.IsStopRequested()) return;
  // ABF with a convex outline, unless the caller has requested that anyway.
  const bool is_free = job->options.flatten.boundary == BoundaryType::kFree;
  c.work_left -= static_cast<std::int64_t>(mapped->work - before);
  const bool was_no_use = c.is_no_use();
  if (was_no_use && is_free && num_faces <= kMostFacesForConvex && c.work_left > 0 && !execution.IsStopRequested()) {
    Takes(c, charts, MapConvex(c), MostStretch(c, 1));
  }
  // A barycentric map within the slit outline.
  const bool is_good = !c.is_no_use() && mapped->faults.stretch <= kStretchToLower;
  if (was_no_use && !is_good && is_small && !execution.IsStopRequested()) {
    c.filled.reset();
    Takes(c, charts, MapByMeans(c), MostStretch(c, kWorthMeans));
  }
}

}  // namespace planish
