// The constraints h(x) = 0 of the paper and their Jacobian B.
//
// Per face f:                triangle consistency (eq. 1)  x_0 + x_1 + x_2 - pi
// Per interior vertex v:     vertex consistency (eq. 2)    sum of the angles at v, minus 2 pi
//                            wheel condition (eq. 6)       sum of log sin(beta) - log sin(gamma) over the faces at v
// Per active boundary vertex b (boundary_control.h):       sum of the angles at b, minus pi
// where beta is the angle after v and gamma the angle before v in each face, counter-clockwise.
//
// Multipliers and constraint values are ordered: F triangle entries, then one pair (vertex, wheel) per row of the
// topology. Boundary vertices have no wheel condition: the second of their pair has the value 0 and an empty row of B.
#pragma once

#include <array>
#include <cstdint>

#include "Eigen/Core"
#include "core/abf/topology.h"
#include "core/base/thread_team.h"

namespace planish {

struct ConstraintValues {
  Eigen::VectorXd triangle;  // F
  Eigen::VectorXd pair;      // 2 num_rows: entry 2 v is eq. 2 of row v, or the boundary's condition; 2 v + 1 is eq. 6
};

// Sine and cotangent of every angle; angles in [0, pi].
Eigen::VectorXd Sines(const Eigen::VectorXd& x, ThreadTeam& team = Alone());
Eigen::VectorXd Cotangents(const Eigen::VectorXd& x, ThreadTeam& team = Alone());

// h(x) with eq. 6; angles in (0, pi). `sine` are the sines of x. Eq. 6 is evaluated as the logarithm of a product.
ConstraintValues EvaluateConstraints(const Topology& topology, const Eigen::VectorXd& x, const Eigen::VectorXd& sine,
                                     ThreadTeam& team = Alone());

// For each angle of a face: the wheel multiplier of the vertex before it minus that of the vertex after it, both from
// `pair`; 0 for vertices without a wheel condition.
inline std::array<double, 3> WheelDifferences(const Topology& topology, std::int64_t face,
                                              const Eigen::Ref<const Eigen::VectorXd>& pair) {
  double wheel[3];
  for (int k = 0; k < 3; ++k) {
    const std::int32_t row = topology.corner_row[3 * face + k];
    wheel[k] = topology.has_wheel(row) ? pair[2 * row + 1] : 0;
  }
  return {wheel[2] - wheel[1], wheel[0] - wheel[2], wheel[1] - wheel[0]};
}

// y = J x, where J has the pair rows of B at the angles with cotangents `cot`. Overwrites y.
void ApplyPairRows(const Topology& topology, const Eigen::VectorXd& cot, const Eigen::VectorXd& x, Eigen::VectorXd* y,
                   ThreadTeam& team = Alone());

// x += J^t pair.
void AddPairRowsTransposed(const Topology& topology, const Eigen::VectorXd& cot,
                           const Eigen::Ref<const Eigen::VectorXd>& pair, Eigen::VectorXd* x,
                           ThreadTeam& team = Alone());

}  // namespace planish
