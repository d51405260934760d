#include "core/unwrap/barycentric.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <numbers>
#include <utility>

#include "Eigen/Geometry"
#include "Eigen/SparseCore"
#include "Eigen/SparseLU"
#include "core/base/error.h"
#include "core/base/portable_math.h"
#include "core/base/status_macros.h"
#include "core/mesh/half_edges.h"
#include "core/unwrap/distortion.h"

namespace planish {
namespace {

constexpr int kMostSolves = 30;
constexpr double kLeastGain = 1e-3;  // in stretch, for one more solve
// Of angles (radians) and lengths (of the mean one), where triangles have next to no area.
constexpr double kLeastAngle = 1e-3, kLeastLength = 1e-4;

class BarycentricMap {
 public:
  BarycentricMap(const Topology& disc, const std::vector<Vec3>& places) : disc_(disc), places_(places) {
    PutOutlineOnCircle();
    row_.assign(disc.num_vertices, -1);
    for (std::int32_t v = 0; v < disc.num_vertices; ++v) {
      if (!is_outline_[v]) row_[v] = rows_++;
    }
    AddMeanValueWeights();
  }

  std::vector<Vec2> Run(const Execution& execution) {
    std::vector<double> draws(disc_.num_vertices, 1);  // what the weights towards a vertex are multiplied by
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
    is_outline_.assign(disc_.num_vertices, 0);
    std::vector<std::pair<std::int32_t, double>> outline;  // vertices, and the way to each
    double length = 0;
    const Loops<std::int32_t> loops = BoundaryLoops(FlatLinks{disc_.opposite});
    for (const std::int32_t c : loops.loop(0)) {
      const std::int32_t from = Origin(disc_.faces, c), to = Target(disc_.faces, c);
      outline.emplace_back(from, length);
      length += std::max((places_[to] - places_[from]).norm(), 1e-300);
    }
    // No two at one place, however short the edge between them.
    const double even = kLeastLength * length / static_cast<double>(outline.size());
    const double whole = length + even * static_cast<double>(outline.size());
    for (std::size_t i = 0; i < outline.size(); ++i) {
      const double turn = 2 * std::numbers::pi * (outline[i].second + even * static_cast<double>(i)) / whole;
      positions_[outline[i].first] = Vec2(portable::Cos(turn), portable::Sin(turn));
      is_outline_[outline[i].first] = 1;
    }
  }

  // Floater's tan(half of the angle at i) / length, from both sides of the edge from i to j.
  void AddMeanValueWeights() {
    double mean = 0;
    for (std::int32_t c = 0; c < disc_.num_corners(); ++c) {
      mean += (places_[Target(disc_.faces, c)] - places_[Origin(disc_.faces, c)]).norm() / disc_.num_corners();
    }
    const double shortest = std::max(kLeastLength * mean, 1e-300);
    for (const Face& face : disc_.faces) {
      for (int k = 0; k < 3; ++k) {
        const std::int32_t i = face[k];
        if (is_outline_[i]) continue;
        const Vec3 to_next = places_[face[(k + 1) % 3]] - places_[i], to_last = places_[face[(k + 2) % 3]] - places_[i];
        const double angle = portable::Atan2(to_next.cross(to_last).norm(), to_next.dot(to_last));
        const double half = portable::Tan(std::clamp(angle, kLeastAngle, std::numbers::pi - kLeastAngle) / 2);
        weights_.push_back({i, face[(k + 1) % 3], half / std::max(to_next.norm(), shortest)});
        weights_.push_back({i, face[(k + 2) % 3], half / std::max(to_last.norm(), shortest)});
      }
    }
  }

  // Every row divided by its sum. Nothing if the matrix is singular in double precision.
  std::vector<Vec2> Solve(const std::vector<double>& draws) {
    if (rows_ == 0) return positions_;
    std::vector<double> sum(rows_, 0);
    for (const Weight& w : weights_) sum[row_[w.from]] += w.weight * draws[w.to];
    std::vector<Eigen::Triplet<double>> entries;
    Eigen::MatrixX2d right = Eigen::MatrixX2d::Zero(rows_, 2);
    for (std::int32_t i = 0; i < rows_; ++i) entries.emplace_back(i, i, 1);
    for (const Weight& w : weights_) {
      const std::int32_t row = row_[w.from];
      const double share = w.weight * draws[w.to] / sum[row];
      if (is_outline_[w.to]) {
        right.row(row) += share * positions_[w.to].transpose();
      } else {
        entries.emplace_back(row, row_[w.to], -share);
      }
    }
    Eigen::SparseMatrix<double> matrix(rows_, rows_);
    matrix.setFromTriplets(entries.begin(), entries.end());
    if (!is_analyzed_) solver_.analyzePattern(matrix);
    is_analyzed_ = true;
    solver_.factorize(matrix);
    if (solver_.info() != Eigen::Success) return {};
    const Eigen::MatrixX2d solution = solver_.solve(right);
    std::vector<Vec2> positions = positions_;
    for (std::int32_t v = 0; v < disc_.num_vertices; ++v) {
      if (row_[v] >= 0) positions[v] = solution.row(row_[v]).transpose();
    }
    return positions;
  }

  struct Weight {
    std::int32_t from, to;
    double weight;
  };

  const Topology& disc_;
  const std::vector<Vec3>& places_;
  std::vector<Vec2> positions_;  // of the outline
  std::vector<char> is_outline_;
  std::vector<std::int32_t> row_;  // of the matrix, per vertex; -1 on the outline
  std::int32_t rows_ = 0;
  std::vector<Weight> weights_;
  Eigen::SparseLU<Eigen::SparseMatrix<double>> solver_;
  bool is_analyzed_ = false;
};

}  // namespace

std::vector<Vec2> MapByBarycentres(const Topology& disc, const std::vector<Vec3>& places, const Execution& execution) {
  return BarycentricMap(disc, places).Run(execution);
}

absl::StatusOr<ChartMap> MapByBarycentres(const Mesh& mesh, const Chart& chart, const FilledChart& filled,
                                          const Eigen::VectorXd& measured, FlattenSummary summary,
                                          const Execution& execution) {
  const std::vector<Vec2> drawn = MapByBarycentres(filled.topology, filled.places, execution);
  if (execution.IsCancelled()) return absl::CancelledError("cancelled");
  if (drawn.empty()) {
    return MakeError(absl::StatusCode::kInternal, "SOLVER_FAILED", "there is no barycentric map in double precision");
  }
  summary.barrier = 0;
  summary.converged = true;
  PLANISH_ASSIGN_OR_RETURN(ChartMap map,
                           PlaceFilled(mesh, chart, filled, drawn, measured, std::move(summary), execution));
  map.is_barycentric = true;
  return map;
}

}  // namespace planish
