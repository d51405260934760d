// Where the seams of a map lie: how much of them can be seen, how straight they are, and whether both sides are cut
// alike.
#pragma once

#include <optional>

#include "core/base/execution.h"
#include "core/mesh/mesh.h"
#include "core/unwrap/verify.h"

namespace planish {

// Seams here are edges of exactly two faces whose UV differ at an end of the edge.
struct SeamFigures {
  // Length of the seams, each edge weighted by the share of the hemisphere above its middle that is open
  // (VisibilityFrom() in core/mesh/visibility.h), over the square root of the surface's area.
  double visible_length = 0;
  // Mean angle by which seams turn at vertices where two of them meet, away from boundaries, weighted by the length
  // beside the vertex. Degrees: 0 where seams are straight.
  double turn_deg = 0;
  // Share of the length of the seams whose mirror image is a seam, for the best of six planes: across each axis,
  // through 0 and through the middle of the box. A plane counts where 95 % of the vertices have a vertex at their
  // mirror image, nearer than a thousandth of the box' diagonal; nothing if there is none, or too many vertices lie too
  // close to each other to tell. Seams without such vertices, and seams in the plane, do not count. 1 if no seam
  // counts.
  std::optional<double> symmetry;
};

// Faces that name a vertex twice are left out. O(F log F), and a bounded number of steps for the symmetry: of more than
// 20,000 vertices so many are looked at. Of no use after a cancellation.
SeamFigures MeasureSeams(const Mesh& mesh, const CornerUv& uv, const Execution& execution = {});

}  // namespace planish
