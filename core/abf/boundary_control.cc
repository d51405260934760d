#include "core/abf/boundary_control.h"

#include <algorithm>
#include <cstdio>
#include <cstdlib>
#include <numbers>
#include <numeric>
#include <set>
#include <utility>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "core/abf/newton.h"
#include "core/base/status_macros.h"
#include "core/mesh/half_edges.h"

namespace planish {

ActiveSet::ActiveSet(const Topology& topology, const TargetAngles& target)
    : topology_(topology), position_(topology.num_vertices, -1) {
  std::vector<std::int32_t> following(topology.num_vertices, -1);
  std::int32_t start = -1;
  for (std::int32_t c = 0; c < topology.num_corners(); ++c) {
    if (topology.opposite[c] >= 0) continue;
    start = Origin(topology.faces, c);
    following[start] = Target(topology.faces, c);
  }
  for (std::int32_t v = start; position_[v] < 0; v = following[v]) {
    position_[v] = num_vertices();
    vertices_.push_back(v);
  }
  active_.assign(vertices_.size(), 0);

  compliance_ = Eigen::VectorXd::Zero(num_vertices());
  for (std::int32_t c = 0; c < topology.num_corners(); ++c) {
    const std::int32_t at = position_[topology.faces[c / 3][c % 3]];
    if (at >= 0) compliance_[at] += 1 / (2 * target.weight[c]);
    if (topology.opposite[c] < 0) continue;
    // Each inner edge is seen from both of its ends, and has a stretch of the boundary on either side.
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

std::int32_t ActiveSet::CountWrong(const Eigen::VectorXd& pressures, double tolerance) const {
  std::int32_t wrong = 0;
  for (std::int32_t b = 0; b < num_vertices(); ++b) {
    if (active_[b] ? pressures[b] < -tolerance : pressures[b] > tolerance) ++wrong;
  }
  return wrong;
}

std::int32_t ActiveSet::Update(const Eigen::VectorXd& pressures, double tolerance, bool only_last) {
  const std::vector<char> before = active_;
  for (std::int32_t b = num_vertices() - 1; b >= 0; --b) {
    if (!(active_[b] ? pressures[b] < -tolerance : pressures[b] > tolerance)) continue;
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
  const auto release = [&](std::int32_t b) {
    active_[b] = 0;
    inactive.insert(b);
  };
  for (const Stretch& stretch : stretches_) {
    // The first inactive position after stretch.first, counted round and round.
    const auto next = inactive.upper_bound(stretch.first);
    const std::int32_t found =
        next != inactive.end() ? *next : (inactive.empty() ? stretch.last : *inactive.begin() + n);
    if (found < stretch.last) continue;
    std::int32_t least = stretch.first + 1;
    for (std::int32_t b = least; b < stretch.last; ++b) {
      if (pressures[b % n] < pressures[least % n]) least = b;
    }
    release(least % n);
  }
  while (inactive.size() < 3) {
    std::int32_t least = -1;
    for (std::int32_t b = 0; b < n; ++b) {
      if (active_[b] && (least < 0 || pressures[b] < pressures[least])) least = b;
    }
    release(least);
  }
}

Topology ActiveSet::ConstrainedTopology() const {
  Topology constrained = topology_;
  for (std::int32_t b = 0; b < num_vertices(); ++b) {
    if (active_[b]) constrained.vertex_row[vertices_[b]] = constrained.num_rows++;
  }
  for (std::int32_t c = 0; c < topology_.num_corners(); ++c) {
    constrained.corner_row[c] = constrained.vertex_row[topology_.faces[c / 3][c % 3]];
  }
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

double Env(const char* name, double fallback) {
  const char* v = std::getenv(name);
  return v ? std::atof(v) : fallback;
}

absl::StatusOr<Flattening> FlattenConvex(const Topology& topology, const TargetAngles& target,
                                         const FlattenOptions& options, const FlattenControl& control) {
  const double rough_tolerance = Env("ROUGH", 1e-2), rough_wrong = Env("WRONG", 1e-2);
  ActiveSet set(topology, target);
  NewtonIterate iterate = {target.angle, Multipliers::Zero(topology)};
  Eigen::VectorXd pressures = set.Pressures(iterate.x, iterate.mu);
  int stage = 0;
  if (Env("FREEFIRST", 0) == 0) {
    const int c = set.Update(pressures, rough_wrong, false);
    std::fprintf(stderr, "start: n %d active %d changed %d\n", set.num_vertices(), set.num_active(), c);
    iterate.mu = set.Carry(iterate.mu, std::vector<char>(set.num_vertices(), 0));
  }
  Flattening result;
  int newton = 0;
  std::int64_t linear = 0;
  for (int outer = 0; outer < 40; ++outer) {
    const Topology constrained = set.ConstrainedTopology();
    FlattenOptions o = options;
    o.tolerance = stage == 0 ? std::max(rough_tolerance, options.tolerance) : options.tolerance;
    Newton solver(constrained, target, o, control);
    PLANISH_ASSIGN_OR_RETURN(result.summary, solver.Run({std::move(iterate.x), std::move(iterate.mu)}));
    newton += result.summary.newton_iterations;
    linear += result.summary.linear_iterations;
    iterate = {solver.x(), solver.mu()};
    pressures = set.Pressures(iterate.x, iterate.mu);
    const double tol = stage == 0 ? std::max(rough_wrong, options.tolerance) : options.tolerance;
    const int wrong = set.CountWrong(pressures, tol);
    std::fprintf(stderr, "outer %d stage %d active %d newton %d linear %lld energy %g barrier %g wrong %d  %s\n", outer,
                 stage, set.num_active(), result.summary.newton_iterations, static_cast<long long>(result.summary.linear_iterations),
                 result.summary.energy, result.summary.barrier, wrong, result.summary.stop_message.c_str());
    if (wrong == 0) {
      if (stage == 1) break;
      stage = 1;
      continue;
    }
    const std::vector<char> before = set.active();
    const int changed = set.Update(pressures, tol, false);
    if (changed == 0) { std::fprintf(stderr, "blocked\n"); if (stage == 1) break; stage = 1; continue; }
    iterate.mu = set.Carry(iterate.mu, before);
  }
  result.summary.newton_iterations = newton;
  result.summary.linear_iterations = linear;
  result.angles = iterate.x;
  return result;
}

}  // namespace planish
