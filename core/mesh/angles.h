// Angles of triangles on the surface.
#pragma once

#include "Eigen/Core"
#include "core/mesh/mesh.h"

namespace planish {

// alpha*: the 3F measured angles, radians, corner k of face f at 3 f + k. Accurate for angles near 0 and pi, whatever
// the position and scale of the mesh. Faces must not be degenerate.
Eigen::VectorXd MeasuredAngles(const Mesh& mesh);

// The angle at `o` between the rays to `a` and `b`, in [0, pi].
template <typename Point>
double AngleAt(const Point& o, const Point& a, const Point& b);

}  // namespace planish
