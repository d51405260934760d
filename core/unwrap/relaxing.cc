#include "core/unwrap/relaxing.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <deque>
#include <limits>
#include <utility>

#include "Eigen/Core"
#include "Eigen/Geometry"
#include "Eigen/SparseCholesky"
#include "Eigen/SparseCore"
#include "core/mesh/half_edges.h"
#include "core/mesh/predicates.h"
#include "core/unwrap/verify.h"

namespace planish {
namespace {

constexpr int kMostSteps = 200, kMemory = 8, kMostShorter = 20, kMostOverlaps = 40;
constexpr std::int64_t kMostWork = 4'000'000;  // steps times faces
constexpr double kLeastGainOfSteps = 2e-3;     // of the energy, in kStepsWatched steps; less ends the search
constexpr int kStepsWatched = 10;
constexpr double kLeastAspect = 1e-6;  // altitude over longest edge; thinner faces do not count

class Relaxation {
 public:
  Relaxation(const Mesh& mesh, const Chart& chart, const ChartMap& map, const std::vector<char>& ignored,
             const Execution& execution)
      : topology_(*chart.topology),
        opposite_(OppositeWithClosedSlits(chart, map.closed_slits)),
        execution_(execution),
        x_(map.positions) {
    JoinVertices();
    own_ignored_.assign(topology_.num_faces(), 0);
    for (std::int32_t f = 0; f < topology_.num_faces(); ++f) {
      own_ignored_[f] = !ignored.empty() && ignored[chart.faces[f]] != 0;
      if (own_ignored_[f] || chart.is_widened(f)) continue;
      const auto q = TriangleOf(mesh.positions, mesh.faces[chart.faces[f]]);
      const Vec3 one = q[1] - q[0], two = q[2] - q[0];
      const double length = one.norm(), height = one.cross(two).norm() / std::max(length, 1e-300);
      if (!(height > kLeastAspect * std::max({length, two.norm(), (two - one).norm()}))) continue;
      Term term = {f, length * height / 2, {}};
      // The inverse of the matrix whose columns are the edges in the face's plane.
      const double along = one.dot(two) / length;
      term.inverse << 1 / length, -along / (length * height), 0, 1 / height;
      terms_.push_back(term);
    }
  }

  // Returns a position for each vertex of the chart's topology.
  std::vector<Vec2> Run() {
    if (!terms_.empty() && Factorize()) Descend();
    std::vector<Vec2> positions;
    for (const std::int32_t v : vertex_) positions.push_back(x_[v]);
    return positions;
  }

 private:
  struct Term {
    std::int32_t face;
    double area;
    Eigen::Matrix2d inverse;
  };
  struct Change {
    std::vector<Vec2> x, gradient;
    double product;
  };

  void Descend() {
    std::vector<Vec2> gradient;
    double energy = Energy(x_, &gradient);
    std::deque<double> last = {energy};
    const std::int64_t most = std::min<std::int64_t>(kMostSteps, kMostWork / std::ssize(faces_) + 1);
    for (std::int64_t step = 0; step < most && std::isfinite(energy); ++step) {
      if (execution_.IsStopRequested() || execution_.IsCancelled()) break;
      const std::vector<Vec2> direction = Direction(gradient);
      const double slope = Dot(direction, gradient);
      if (!(slope < 0)) {
        if (memory_.empty()) break;
        memory_.clear();
        continue;
      }
      if (!Advance(direction, slope, &energy, &gradient)) {
        if (memory_.empty()) break;
        memory_.clear();
        continue;
      }
      last.push_back(energy);
      if (std::ssize(last) <= kStepsWatched) continue;
      if (last.front() - energy < kLeastGainOfSteps * last.front()) break;
      last.pop_front();
    }
  }

  // Joins vertices on both sides of a closed slit.
  void JoinVertices() {
    const std::vector<Face> joined = FacesOfFans(opposite_, [](std::int32_t) {});
    vertex_.assign(topology_.num_vertices, -1);
    for (std::size_t f = 0; f < joined.size(); ++f) {
      for (int k = 0; k < 3; ++k) {
        vertex_[topology_.faces[f][k]] = joined[f][k];
        count_ = std::max(count_, joined[f][k] + 1);
      }
    }
    faces_ = joined;
    std::vector<Vec2> places(count_);
    for (std::int32_t v = 0; v < topology_.num_vertices; ++v) places[vertex_[v]] = x_[v];
    x_ = std::move(places);
    stays_.assign(count_, 0);
  }

  double Energy(const std::vector<Vec2>& x, std::vector<Vec2>* gradient) const {
    double energy = 0;
    if (gradient != nullptr) gradient->assign(count_, Vec2::Zero());
    for (const auto& [f, area, inverse] : terms_) {
      const auto [a, b, c] = faces_[f];
      Eigen::Matrix2d edges;
      edges << x[b] - x[a], x[c] - x[a];
      const Eigen::Matrix2d j = edges * inverse;
      const double determinant = j.determinant(), square = j.squaredNorm();
      if (!(determinant > 0)) return std::numeric_limits<double>::infinity();
      const double inverse_square = 1 / (determinant * determinant);
      energy += area * square * (1 + inverse_square);
      if (gradient == nullptr) continue;
      Eigen::Matrix2d cofactor;
      cofactor << j(1, 1), -j(1, 0), -j(0, 1), j(0, 0);
      const Eigen::Matrix2d slope =
          area * (2 * (1 + inverse_square) * j - 2 * square * inverse_square / determinant * cofactor) *
          inverse.transpose();
      (*gradient)[b] += slope.col(0);
      (*gradient)[c] += slope.col(1);
      (*gradient)[a] -= slope.col(0) + slope.col(1);
    }
    return energy;
  }

  bool Factorize() {
    using Triplet = Eigen::Triplet<double>;
    std::vector<Triplet> entries;
    std::vector<double> diagonal(count_, 0);
    for (const auto& [f, area, inverse] : terms_) {
      Eigen::Matrix<double, 2, 3> slopes;  // of the three hat functions, in the face's plane
      slopes.col(1) = inverse.row(0).transpose();
      slopes.col(2) = inverse.row(1).transpose();
      slopes.col(0) = -slopes.col(1) - slopes.col(2);
      for (int i = 0; i < 3; ++i) {
        for (int k = 0; k < 3; ++k) {
          const double entry = 4 * area * slopes.col(i).dot(slopes.col(k));
          entries.emplace_back(faces_[f][i], faces_[f][k], entry);
          if (i == k) diagonal[faces_[f][i]] += entry;
        }
      }
    }
    double mean = 0;
    for (const double d : diagonal) mean += d / count_;
    for (std::int32_t v = 0; v < count_; ++v) {
      entries.emplace_back(v, v, 1e-8 * std::max(diagonal[v], mean) + (diagonal[v] > 0 ? 0 : mean));
    }
    Eigen::SparseMatrix<double> matrix(count_, count_);
    matrix.setFromTriplets(entries.begin(), entries.end());
    factor_.compute(matrix);
    return factor_.info() == Eigen::Success;
  }

  static double Dot(const std::vector<Vec2>& a, const std::vector<Vec2>& b) {
    double sum = 0;
    for (std::size_t i = 0; i < a.size(); ++i) sum += a[i].dot(b[i]);
    return sum;
  }

  // L-BFGS (Nocedal and Wright 2006, algorithm 7.4).
  std::vector<Vec2> Direction(std::vector<Vec2> q) const {
    std::vector<double> weights(memory_.size());
    const auto add = [](double factor, const std::vector<Vec2>& other, std::vector<Vec2>* to) {
      for (std::size_t i = 0; i < to->size(); ++i) (*to)[i] += factor * other[i];
    };
    for (std::size_t v = 0; v < q.size(); ++v) {
      if (stays_[v]) q[v].setZero();
    }
    for (std::size_t i = memory_.size(); i-- > 0;) {
      weights[i] = Dot(memory_[i].x, q) / memory_[i].product;
      add(-weights[i], memory_[i].gradient, &q);
    }
    Eigen::MatrixX2d right(count_, 2);
    for (std::int32_t v = 0; v < count_; ++v) right.row(v) = q[v].transpose();
    const Eigen::MatrixX2d solution = factor_.solve(right);
    for (std::int32_t v = 0; v < count_; ++v) q[v] = solution.row(v).transpose();
    for (std::size_t i = 0; i < memory_.size(); ++i) {
      add(weights[i] - Dot(memory_[i].gradient, q) / memory_[i].product, memory_[i].x, &q);
    }
    for (std::size_t v = 0; v < q.size(); ++v) q[v] = stays_[v] ? Vec2(Vec2::Zero()) : Vec2(-q[v]);
    return q;
  }

  // The longest step without a collapsed triangle: the least positive root of their areas.
  double MostStep(const std::vector<Vec2>& d) const {
    double most = std::numeric_limits<double>::infinity();
    for (std::int32_t f = 0; f < static_cast<std::int32_t>(faces_.size()); ++f) {
      if (own_ignored_[f]) continue;
      const auto [a, b, c] = faces_[f];
      const Vec2 p = x_[b] - x_[a], q = x_[c] - x_[a], dp = d[b] - d[a], dq = d[c] - d[a];
      const auto cross = [](const Vec2& s, const Vec2& t) { return s.x() * t.y() - s.y() * t.x(); };
      const double zero = cross(p, q), one = cross(dp, q) + cross(p, dq), two = cross(dp, dq);
      const double discriminant = one * one - 4 * two * zero;
      if (discriminant < 0) continue;
      const double sum = -(one + std::copysign(std::sqrt(discriminant), one)) / 2;
      for (const double root : {sum / two, zero / sum}) {
        if (root > 0) most = std::min(most, root);
      }
    }
    return most;
  }

  Overlaps FindOverlap(const std::vector<Vec2>& x) const {
    CornerUv uv(6 * faces_.size());
    for (std::int32_t c = 0; c < 3 * std::ssize(faces_); ++c) SetUv(c, x[faces_[c / 3][c % 3]], &uv);
    const OrientationFaults orientation = CheckOrientations(uv, execution_, own_ignored_);
    Overlaps overlaps = CheckOverlaps(opposite_, uv, orientation, execution_, own_ignored_, /*max_pairs=*/1);
    if (orientation.flipped + orientation.degenerate > 0) {
      ++overlaps.pairs;
      overlaps.faces = orientation.faces;
    }
    return overlaps;
  }

  // Takes a step, or fixes the vertices of triangles that keep overlapping. False if it did neither.
  bool Advance(const std::vector<Vec2>& direction, double slope, double* energy, std::vector<Vec2>* gradient) {
    constexpr double kArmijo = 1e-4, kWayToCollapse = 0.8;
    double length = std::min(1.0, kWayToCollapse * MostStep(direction));
    std::vector<Vec2> x(count_), next_gradient;
    for (int shorter = 0; shorter < kMostShorter; ++shorter, length /= 2) {
      for (std::int32_t v = 0; v < count_; ++v) x[v] = x_[v] + length * direction[v];
      if (!(Energy(x, nullptr) <= *energy + kArmijo * length * slope)) continue;
      const Overlaps overlaps = FindOverlap(x);
      if (overlaps.pairs > 0) {
        constexpr int kPatience = 2;
        if (++overlapped_ % kPatience != 0) continue;
        if (overlapped_ > kPatience * kMostOverlaps) return false;
        for (const std::int32_t f : overlaps.faces) {
          for (const std::int32_t v : faces_[f]) stays_[v] = 1;
        }
        memory_.clear();
        return true;  // goes on in another direction
      }
      const double next = Energy(x, &next_gradient);
      Change change = {std::vector<Vec2>(count_), std::vector<Vec2>(count_), 0};
      for (std::int32_t v = 0; v < count_; ++v) {
        change.x[v] = x[v] - x_[v];
        change.gradient[v] = stays_[v] ? Vec2(Vec2::Zero()) : Vec2(next_gradient[v] - (*gradient)[v]);
      }
      change.product = Dot(change.x, change.gradient);
      if (change.product > 0) memory_.push_back(std::move(change));
      if (memory_.size() > kMemory) memory_.pop_front();
      x_ = x;
      *energy = next;
      *gradient = std::move(next_gradient);
      return true;
    }
    return false;
  }

  const Topology& topology_;
  const std::vector<std::int32_t> opposite_;
  const Execution& execution_;
  std::vector<std::int32_t> vertex_;  // per vertex of the topology
  std::vector<Face> faces_;
  std::int32_t count_ = 0;
  std::vector<Vec2> x_;
  std::vector<Term> terms_;
  std::vector<char> own_ignored_;  // per face of the chart
  std::vector<char> stays_;        // per vertex
  Eigen::SimplicialLDLT<Eigen::SparseMatrix<double>> factor_;
  std::deque<Change> memory_;
  int overlapped_ = 0;
};

}  // namespace

std::vector<Vec2> RelaxedPositions(const Mesh& mesh, const Chart& chart, const ChartMap& map,
                                   const std::vector<char>& ignored, const Execution& execution) {
  return Relaxation(mesh, chart, map, ignored, execution).Run();
}

}  // namespace planish
