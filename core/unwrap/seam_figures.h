// Figures of a map's seams: how visible, how straight and how symmetric they are.
#pragma once

#include <optional>

#include "core/base/execution.h"
#include "core/mesh/mesh.h"
#include "core/unwrap/verify.h"

namespace planish {

// Seams here are edges of exactly two faces whose UV differ at an end of the edge.
struct SeamFigures {
  // Length of the seams, each edge weighted by the open share of the hemisphere above its middle (VisibilityFrom() in
  // core/mesh/visibility.h), over the square root of the surface's area.
  double visible_length = 0;
  // Mean angle by which seams turn at vertices where two of their edges meet, away from boundaries, weighted by the
  // length beside the vertex. In degrees; 0 for straight seams.
  double turn_deg = 0;
  // Share of the length of the seams whose mirror image is a seam, for the best of six planes: across each axis,
  // through 0 and through the middle of the box. A plane counts if 95 % of the vertices have a vertex at their mirror
  // image, nearer than a thousandth of the box's diagonal. Empty if no plane counts, or if too many vertices are too
  // close together. Seams at other vertices, and seams in the plane, do not count. 1 if no seam counts.
  std::optional<double> symmetry;
};

// Ignores faces that repeat a vertex. O(F log F), and a bounded number of steps for the symmetry: of more than 20,000
// vertices a sample of that size is used. Invalid after a cancellation.
SeamFigures MeasureSeams(const Mesh& mesh, const CornerUv& uv, const Execution& execution = {});

}  // namespace planish
