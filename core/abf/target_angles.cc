#include "core/abf/target_angles.h"

#include <numbers>

namespace planish {

TargetAngles MakeTargetAngles(const Topology& topology, const Eigen::VectorXd& measured, const Execution& execution) {
  TargetAngles target;
  target.angle = measured;
  target.weight.resize(measured.size());
  execution.ForEach(topology.num_interior, [&](std::int64_t v) {
    const std::int32_t first = topology.row_corner_begin[v], last = topology.row_corner_begin[v + 1];
    double sum = 0;
    for (std::int32_t i = first; i < last; ++i) sum += measured[topology.row_corner[i]];
    const double scale = 2 * std::numbers::pi / sum;
    for (std::int32_t i = first; i < last; ++i) target.angle[topology.row_corner[i]] *= scale;
  });
  execution.ForEach(measured.size(),
                    [&](std::int64_t c) { target.weight[c] = 1 / (target.angle[c] * target.angle[c]); });
  return target;
}

Eigen::VectorXd StartingAngles(const TargetAngles& target, ThreadTeam& team) {
  Eigen::VectorXd start(target.angle.size());
  team.ForEach(start.size() / 3, [&](std::int64_t f) {
    const auto a = target.angle.segment<3>(3 * f);
    // The results are positive: by Cauchy and Schwarz (sum - pi) a_i < a_1^2 + a_2^2 + a_3^2 wherever a_i < 2 pi.
    const Eigen::Vector3d give = target.weight.segment<3>(3 * f).cwiseInverse();
    start.segment<3>(3 * f) = a + (std::numbers::pi - a.sum()) / give.sum() * give;
  });
  return start;
}

}  // namespace planish
