// Boundary control (section 5 of the paper): a convex boundary by an active set.
//
// At every boundary vertex b the planar angles must add up to at most pi, h_b(x) = sum - pi <= 0 with a multiplier
// mu_b >= 0. Vertices in the active set are equality constraints (one vertex row each, no wheel row: topology.h); those
// outside it have no row, so their multiplier is zero. The set is right when
//
//   active:    mu_b >= 0         inactive:  h_b(x) <= 0
//
// Both conditions are in one number, in radians: the pressure  p_b = h_b(x) + s_b mu_b  where s_b, the sum of 1 / (2
// w_i) over the angles at b, is the inverse of the energy's own resistance to opening b. One of the two terms is always
// zero, and the set is right when it equals { b : p_b > 0 }.
//
// The method: solve for a set, set active = { b : p_b > 0 }, and solve again from there. This is block principal
// pivoting, equivalently the primal-dual active set method, or Newton's method on the piecewise smooth system max(p_b,
// 0) = s_b mu_b. Few changes settle thousands of vertices, because the energy couples boundary vertices weakly. If the
// number of wrong vertices has not reached a new minimum for BoundaryTuning::patience changes, vertices change one at a
// time (the last wrong one, as in Murty's method) until it does: Portugal, Judice, Vicente 1994, "A comparison of block
// pivoting and interior-point algorithms for linear least squares problems with nonnegative variables". The method
// cannot cycle on a convex problem. This problem is convex only near its solution, so the number of changes is limited.
//
// For each set, Newton's method starts from the x and mu of the last one. It ends once its residual is a fraction of
// how wrong the last set was (Worst()). A set that looks right is solved for to the full tolerance. The first set is
// empty. If angles collapse, the set is settled under a strong barrier (objective.h) first, then under weaker ones,
// then without.
//
// Not every set has a map. With positive angles, a polygon whose straight vertices are given exists exactly when at
// least three vertices are not straight and no inner edge has both of its ends on one straight side (Floater 1997,
// reference [7]; the first condition also follows from Gauss-Bonnet). ActiveSet makes vertices inactive until such a
// polygon exists.
#pragma once

#include <cstdint>
#include <vector>

#include "Eigen/Core"
#include "absl/status/statusor.h"
#include "core/abf/flatten.h"
#include "core/abf/lagrangian.h"

namespace planish {

// The boundary vertices of a disc, in order, and which of them are active.
class ActiveSet {
 public:
  // No vertex is active. `topology` has no boundary rows and must outlive this.
  ActiveSet(const Topology& topology, const TargetAngles& target);

  std::int32_t num_vertices() const { return static_cast<std::int32_t>(vertices_.size()); }
  std::int32_t num_active() const;
  // Vertex ids along the boundary, counter-clockwise, and whether each is active.
  const std::vector<std::int32_t>& vertices() const { return vertices_; }
  const std::vector<char>& active() const { return active_; }

  // p_b of each boundary vertex, in their order. `mu` has the rows of ConstrainedTopology(), or only those of interior
  // vertices if no vertex was active.
  Eigen::VectorXd Pressures(const Eigen::VectorXd& x, const Multipliers& mu) const;
  // The number of vertices that belong on the other side: active with p_b < -tolerance or inactive with p_b >
  // tolerance.
  std::int32_t CountWrong(const Eigen::VectorXd& pressures, double tolerance) const;
  // The largest |p_b| among the vertices that CountWrong(pressures, 0) counts.
  double Worst(const Eigen::VectorXd& pressures) const;
  // Moves every wrong vertex, or only the last one, to the other side; then makes vertices inactive, those with the
  // least pressure first, until a polygon exists. Returns the number of vertices that changed.
  std::int32_t Update(const Eigen::VectorXd& pressures, double tolerance, bool only_last);

  // The topology with a row for each active vertex, in the order of the boundary.
  Topology ConstrainedTopology() const;
  // Multipliers for ConstrainedTopology() from those of another active set; zero for vertices that were not in it.
  Multipliers Carry(const Multipliers& mu, const std::vector<char>& active_before) const;

 private:
  // An inner edge between boundary vertices. The open stretch of the boundary from `first` to `last` (positions modulo
  // the number of vertices) must not be straight throughout.
  struct Stretch {
    std::int32_t first, last;
  };
  // How far each boundary vertex is on the wrong side; not positive for a right one.
  Eigen::ArrayXd Wrongness(const Eigen::VectorXd& pressures) const;
  void ReleaseForPolygon(const Eigen::VectorXd& pressures);

  const Topology& topology_;
  std::vector<std::int32_t> vertices_;
  std::vector<std::int32_t> position_;  // per vertex: its position in vertices_, or -1
  Eigen::VectorXd compliance_;          // s_b
  std::vector<char> active_;
  std::vector<Stretch> stretches_;  // short ones first
};

// FlattenAngles() with the constraints h_b <= 0. Of the types in `options` only `hessian` may be kAuto.
absl::StatusOr<Flattening> FlattenConvex(const Topology& topology, const TargetAngles& target,
                                         const FlattenOptions& options, const FlattenControl& control);

}  // namespace planish
