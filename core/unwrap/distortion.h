// How far a map is from keeping angles and areas.
#pragma once

#include "Eigen/Core"
#include "core/abf/target_angles.h"
#include "core/base/execution.h"
#include "core/mesh/mesh.h"
#include "core/unwrap/quality.h"
#include "core/unwrap/verify.h"

namespace planish {

// Fills the distortion measures and packing_efficiency of `quality` (definitions at planish.v1.Quality); leaves the
// counts alone. `measured` are the angles on the surface. A UV triangle without area has infinite distortion.
// Changes nothing after an interrupt.
void MeasureDistortion(const Mesh& mesh, const Eigen::VectorXd& measured, const TargetAngles& target,
                       const CornerUv& uv, Quality* quality, const Execution& execution = {});

}  // namespace planish
