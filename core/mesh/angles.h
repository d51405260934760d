// Angles of triangles on the surface.
#pragma once

#include "Eigen/Core"
#include "core/base/execution.h"
#include "core/mesh/mesh.h"

namespace planish {

// alpha*: the 3F measured angles, radians, corner k of face f at 3 f + k. Accurate for angles near 0 and pi, whatever
// the position and scale of the mesh; those of a face add up to pi. Faces must not be degenerate. Of no use after an
// interrupt.
Eigen::VectorXd MeasuredAngles(const Mesh& mesh, const Execution& execution = {});

// The angle at `o` between the rays to `a` and `b`, in [0, pi].
template <typename Point>
double AngleAt(const Point& o, const Point& a, const Point& b);

// The angles of the triangle `p`, in [0, pi], corner k's in angles[k]. They add up to pi. If the triangle has no area,
// two are 0.
template <typename Point>
void TriangleAngles(const Point p[3], double angles[3]);

}  // namespace planish
