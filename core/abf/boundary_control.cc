#include "core/abf/boundary_control.h"

#include <algorithm>
#include <limits>
#include <numbers>
#include <set>
#include <utility>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "core/abf/newton.h"
#include "core/abf/topology.h"
#include "core/base/status_macros.h"
#include "core/mesh/half_edges.h"

namespace planish {

ActiveSet::ActiveSet(const Topology& topology, const TargetAngles& target)
    : topology_(topology), position_(topology.num_vertices, -1) {
  std::int32_t last = topology.num_corners() - 1;
  while (topology.opposite[last] >= 0) --last;
  ForEachOnLoop(FlatLinks{topology.opposite}, last, [&](std::int32_t c) {
    position_[Origin(topology.faces, c)] = num_vertices();
    vertices_.push_back(Origin(topology.faces, c));
  });
  active_.assign(vertices_.size(), 0);

  compliance_ = Eigen::VectorXd::Zero(num_vertices());
  for (std::int32_t c = 0; c < topology.num_corners(); ++c) {
    const std::int32_t at = position_[topology.faces[c / 3][c % 3]];
    if (at >= 0) compliance_[at] += 1 / (2 * target.weight[c]);
    if (topology.opposite[c] < 0) continue;
    // Each inner edge is visited as two half-edges, one for the stretch of the boundary on either side of it.
    const std::int32_t from = position_[Origin(topology.faces, c)], to = position_[Target(topology.faces, c)];
    if (from >= 0 && to >= 0) stretches_.push_back({from, to > from ? to : to + num_vertices()});
  }
  std::sort(stretches_.begin(), stretches_.end(), [](const Stretch& a, const Stretch& b) {
    return std::pair(a.last - a.first, a.first) < std::pair(b.last - b.first, b.first);
  });
}

std::int32_t ActiveSet::num_active() const {
  return static_cast<std::int32_t>(std::count(active_.begin(), active_.end(), 1));
}

Eigen::VectorXd ActiveSet::Pressures(const Eigen::VectorXd& x, const Multipliers& mu) const {
  Eigen::VectorXd pressures = Eigen::VectorXd::Constant(num_vertices(), -std::numbers::pi);
  for (std::int32_t c = 0; c < topology_.num_corners(); ++c) {
    const std::int32_t at = position_[topology_.faces[c / 3][c % 3]];
    if (at >= 0) pressures[at] += x[c];
  }
  std::int32_t row = topology_.num_interior;
  for (std::int32_t b = 0; b < num_vertices(); ++b) {
    if (active_[b]) pressures[b] += compliance_[b] * mu.pair[2 * row++];
  }
  return pressures;
}

Eigen::ArrayXd ActiveSet::Wrongness(const Eigen::VectorXd& pressures) const {
  Eigen::ArrayXd wrongness = pressures;
  for (std::int32_t b = 0; b < num_vertices(); ++b) wrongness[b] *= active_[b] ? -1 : 1;
  return wrongness;
}

std::int32_t ActiveSet::CountWrong(const Eigen::VectorXd& pressures, double tolerance) const {
  return static_cast<std::int32_t>((Wrongness(pressures) > tolerance).count());
}

double ActiveSet::Worst(const Eigen::VectorXd& pressures) const {
  return std::max(0.0, Wrongness(pressures).maxCoeff());
}

std::int32_t ActiveSet::Update(const Eigen::VectorXd& pressures, double tolerance, bool only_last) {
  const std::vector<char> before = active_;
  const Eigen::ArrayXd wrongness = Wrongness(pressures);
  for (std::int32_t b = num_vertices() - 1; b >= 0; --b) {
    if (wrongness[b] <= tolerance) continue;
    active_[b] = !active_[b];
    if (only_last) break;
  }
  ReleaseForPolygon(pressures);
  std::int32_t changed = 0;
  for (std::int32_t b = 0; b < num_vertices(); ++b) changed += active_[b] != before[b];
  return changed;
}

void ActiveSet::ReleaseForPolygon(const Eigen::VectorXd& pressures) {
  const std::int32_t n = num_vertices();
  std::set<std::int32_t> inactive;
  for (std::int32_t b = 0; b < n; ++b) {
    if (!active_[b]) inactive.insert(b);
  }
  // Deactivates the active position of least pressure in [first, end), modulo the number of vertices.
  const auto release_one = [&](std::int32_t first, std::int32_t end) {
    std::int32_t least = -1;
    for (std::int32_t i = first; i < end; ++i) {
      const std::int32_t b = i % n;
      if (active_[b] && (least < 0 || pressures[b] < pressures[least])) least = b;
    }
    active_[least] = 0;
    inactive.insert(least);
  };
  for (const Stretch& stretch : stretches_) {
    // The first inactive position after stretch.first, modulo the number of vertices.
    const auto next = inactive.upper_bound(stretch.first);
    const std::int32_t found =
        next != inactive.end() ? *next : (inactive.empty() ? stretch.last : *inactive.begin() + n);
    if (found >= stretch.last) release_one(stretch.first + 1, stretch.last);
  }
  while (inactive.size() < 3) release_one(0, n);
}

Topology ActiveSet::ConstrainedTopology() const {
  Topology constrained = topology_;
  std::vector<std::int32_t> rows = RowVertices(topology_);
  for (std::int32_t b = 0; b < num_vertices(); ++b) {
    if (active_[b]) rows.push_back(vertices_[b]);
  }
  AssignRows(rows, &constrained);
  return constrained;
}

Multipliers ActiveSet::Carry(const Multipliers& mu, const std::vector<char>& active_before) const {
  const Eigen::Index interior = 2 * Eigen::Index{topology_.num_interior};
  Multipliers carried = {mu.triangle, Eigen::VectorXd::Zero(interior + 2 * num_active())};
  carried.pair.head(interior) = mu.pair.head(interior);
  Eigen::Index from = interior, to = interior;
  for (std::int32_t b = 0; b < num_vertices(); ++b) {
    if (active_[b] && active_before[b]) carried.pair[to] = mu.pair[from];
    if (active_before[b]) from += 2;
    if (active_[b]) to += 2;
  }
  return carried;
}

namespace {

// One FlattenConvex() call.
class ActiveSetMethod {
 public:
  ActiveSetMethod(const Topology& topology, const TargetAngles& target, const FlattenOptions& options,
                  const FlattenControl& control)
      : topology_(topology),
        target_(target),
        options_(options),
        control_(control),
        set_(topology, target),
        iterate_{StartingAngles(target), Multipliers::Zero(topology)} {}

  absl::StatusOr<Flattening> operator()() {
    PLANISH_RETURN_IF_ERROR(Settle());
    Flattening result = {iterate_.x, summary_};
    bool flat = flat_;
    if (!summary_.converged && !summary_.stopped && !OutOfIterations()) {
      iterate_ = {StartingAngles(target_), Multipliers::Zero(set_.ConstrainedTopology())};
      // Angles collapse: solve under a strong barrier first, then under weaker ones, then without.
      std::vector<double> barriers = BarrierSequence(options_.tuning.newton.barrier);
      barriers.push_back(0);
      for (const double tau : barriers) {
        iterate_.barrier = tau;
        PLANISH_RETURN_IF_ERROR(Settle());
        if (tau > 0 || summary_.boundary.settled) {
          result = {iterate_.x, summary_};
          flat = flat_;
        }
        if (!usable_ || summary_.stopped) break;
      }
      if (summary_.stopped) {
        result.summary.stopped = true;
        result.summary.converged = result.summary.boundary.settled = false;
      }
    }
    if (result.summary.stopped && !flat) {
      // Stopped before the angles were flat: solves without boundary control, because a map with a free outline takes
      // fewer steps.
      Newton newton(topology_, target_, options_, control_);
      PLANISH_ASSIGN_OR_RETURN(summary_, newton.Run());
      ++solves_;
      summary_.boundary = {BoundaryType::kConvex, set_.num_vertices(), 0, set_changes_, false};
      summary_.stopped = true;
      summary_.converged = false;
      result = {newton.x(), summary_};
    }
    static_cast<FlattenWork&>(result.summary) = summary_;
    const BoundaryReport& boundary = result.summary.boundary;
    absl::StrAppend(
        &result.summary.stop_message,
        absl::StrFormat(
            "; %d sets solved for, %d of %d boundary vertices are straight, the active set %s after %d changes",
            solves_, boundary.active, boundary.vertices, boundary.settled ? "settled" : "has not settled",
            boundary.set_changes));
    return result;
  }

 private:
  // Changes the set until it is right for the barrier of iterate_; summary_ says how that ended.
  absl::Status Settle() {
    const double rough = std::max(tuning().rough_tolerance, options_.tolerance);
    const double goal = iterate_.barrier > options_.tuning.newton.barrier.weakest ? rough : options_.tolerance;
    least_wrong_ = std::numeric_limits<std::int32_t>::max();
    patience_ = tuning().patience;
    double tolerance = rough;
    bool same_set = false, out_of_sets = false, right = false;
    while (true) {
      PLANISH_RETURN_IF_ERROR(same_set ? Polish(tolerance) : Solve(tolerance));
      usable_ = summary_.converged || (IsRoughlyRight(rough) && !(same_set && tolerance < rough));
      const bool done = same_set && tolerance <= options_.tolerance && summary_.converged;
      if (control_.IsStopRequested() && !done && !summary_.stopped) {
        // Good enough to stop (FlattenControl::flat_enough), even if the outline is not convex yet.
        summary_.stopped = true;
        summary_.converged = false;
        summary_.stop_message = absl::StrCat("stopped; ", summary_.stop_message);
      }
      if (!usable_ || summary_.stopped) break;
      const Eigen::VectorXd pressures = set_.Pressures(iterate_.x, iterate_.mu);
      right = set_.CountWrong(pressures, options_.tolerance) == 0;
      same_set = right || out_of_sets;
      if (!same_set) {
        const double worst = set_.Worst(pressures);
        same_set = out_of_sets = !ChangeSet(pressures);
        if (!same_set) tolerance = std::clamp(tuning().rough_part * worst, goal, rough);
      }
      if (same_set) {
        if (tolerance == goal) break;
        tolerance = goal;
      }
    }
    summary_.boundary = {BoundaryType::kConvex, set_.num_vertices(), set_.num_active(), set_changes_,
                         summary_.converged && right};
    return absl::OkStatus();
  }

  // Newton's method for the current set, from the last iterate.
  absl::Status Solve(double tolerance) {
    const FlattenSummary before = summary_;
    const Topology constrained = set_.ConstrainedTopology();
    FlattenOptions options = options_;
    options.tolerance = tolerance;
    if (tolerance > options_.tolerance) {
      const int rough = before.newton_iterations + static_cast<int>(tuning().rough_steps);
      options.max_newton_iterations = std::min(options.max_newton_iterations, rough);
    }
    Newton newton(constrained, target_, options, control_);
    PLANISH_ASSIGN_OR_RETURN(summary_, newton.RunFrom(std::move(iterate_), before));
    iterate_ = {newton.x(), newton.mu(), summary_.barrier, newton.z()};
    flat_ = newton.IsFlat() || summary_.converged;
    ++solves_;
    options_.preconditioner = summary_.preconditioner;
    summary_.preconditioner_changed |= before.preconditioner_changed;
    if (!before.multigrid_failure.empty()) summary_.multigrid_failure = before.multigrid_failure;
    return absl::OkStatus();
  }

  // Solves again, for a set that has been solved for to a rougher tolerance.
  absl::Status Polish(double tolerance) {
    const NewtonIterate start = iterate_;
    PLANISH_RETURN_IF_ERROR(Solve(tolerance));
    if (!summary_.converged && !summary_.stopped && !OutOfIterations() &&
        options_.preconditioner == PreconditionerType::kAmg && topology_.num_faces() <= kMostFallbackFaces) {
      // A solve that fails this near the solution fails because its linear solves were too inaccurate, not because
      // angles collapse.
      const std::string why = absl::StrCat("with multigrid, ", summary_.stop_message);
      iterate_ = start;
      options_.preconditioner = PreconditionerType::kCholesky;
      PLANISH_RETURN_IF_ERROR(Solve(tolerance));
      summary_.preconditioner_changed = true;
      summary_.multigrid_failure = why;
    }
    return absl::OkStatus();
  }

  // Moves to the next set; false if there is none to try.
  bool ChangeSet(const Eigen::VectorXd& pressures) {
    if (set_changes_ >= tuning().max_set_changes) return false;
    const std::int32_t wrong = set_.CountWrong(pressures, options_.tolerance);
    if (wrong < least_wrong_) {
      least_wrong_ = wrong;
      patience_ = tuning().patience;
    } else if (patience_ > 0) {
      --patience_;
    }
    const std::vector<char> before = set_.active();
    if (set_.Update(pressures, options_.tolerance, /*only_last=*/patience_ == 0) == 0) return false;
    iterate_.mu = set_.Carry(iterate_.mu, before);
    ++set_changes_;
    return true;
  }

  // Whether a solve that did not converge is accurate enough to judge the set.
  bool IsRoughlyRight(double rough) const {
    const Residual& r = summary_.residual;
    return !OutOfIterations() && std::max({r.triangle, r.vertex, r.wheel}) <= rough &&
           r.gradient <= tuning().max_gradient;
  }
  const BoundaryTuning& tuning() const { return options_.tuning.boundary; }
  bool OutOfIterations() const {
    return summary_.newton_iterations >= options_.max_newton_iterations || summary_.out_of_work;
  }

  const Topology& topology_;
  const TargetAngles& target_;
  FlattenOptions options_;
  const FlattenControl& control_;
  ActiveSet set_;
  NewtonIterate iterate_;
  FlattenSummary summary_;  // of the last solve, with the counts of all solves
  int solves_ = 0, set_changes_ = 0;
  bool flat_ = false;    // Newton::IsFlat() of the last solve
  bool usable_ = false;  // the last solve converged, or nearly if it was a rough one
  // Since Settle() began: the least number of wrong vertices, and the set changes left until vertices change one at a
  // time.
  std::int32_t least_wrong_ = 0;
  std::int64_t patience_ = 0;
};

}  // namespace

absl::StatusOr<Flattening> FlattenConvex(const Topology& topology, const TargetAngles& target,
                                         const FlattenOptions& options, const FlattenControl& control) {
  return ActiveSetMethod(topology, target, options, control)();
}

}  // namespace planish
