#include "core/abf/target_angles.h"

#include <numbers>

namespace planish {

TargetAngles MakeTargetAngles(const Topology& topology, const Eigen::VectorXd& measured) {
  Eigen::VectorXd sum = Eigen::VectorXd::Zero(topology.num_interior);
  for (std::int32_t c = 0; c < topology.num_corners(); ++c) {
    if (const std::int32_t v = topology.corner_row[c]; topology.has_wheel(v)) sum[v] += measured[c];
  }
  TargetAngles target;
  target.angle = measured;
  for (std::int32_t c = 0; c < topology.num_corners(); ++c) {
    if (const std::int32_t v = topology.corner_row[c]; topology.has_wheel(v)) {
      target.angle[c] *= 2 * std::numbers::pi / sum[v];
    }
  }
  target.weight = target.angle.array().square().inverse();
  return target;
}

}  // namespace planish
