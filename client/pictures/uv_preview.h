// A drawing of a UV layout: charts, their outlines, and by how much every triangle grew or shrank.
#pragma once

#include <string>
#include <vector>

#include "client/pictures/canvas.h"
#include "core/mesh/mesh.h"

namespace planish {

struct UvPreviewOptions {
  // Draws one frame round all charts, wherever they lie: for charts that were not packed. This is also done if a chart
  // lies in no UDIM tile (t % 10, t / 10) + [0, 1]^2.
  bool fit = false;
};

// Charts are islands of the UV (uv_islands.h). Fill: log2 of a triangle's area in the map over that on the surface,
// relative to this ratio of the whole mesh, from blue (smaller in the map) over grey (as the whole) to red (larger);
// the scale ends at a factor of 2, 4 or 16, the first that holds 98 % of the surface. Triangles that face the other way
// than most of their chart are yellow. Outlines are dark; tiles in use stand side by side, 1001 at the top left. Below
// is the scale with a tick at every power of two.
//
// `uv` has (u, v) of every corner: 6 numbers a face. Positions and UV must be finite. Deterministic.
Image DrawUvPreview(const Mesh& mesh, const std::vector<double>& uv, const UvPreviewOptions& options = {});

// The drawing of DrawUvPreview() as the text of an SVG file, with words at the scale. Places are rounded to 1/4096 of a
// tile and triangles of one colour merged: some 3 bytes a triangle, 20 at most. If that leaves more than 400,000 edges
// between colours (meshes of some hundred thousand triangles), each chart has one colour, that of its whole area, and
// the words say so.
std::string UvPreviewSvg(const Mesh& mesh, const std::vector<double>& uv, const UvPreviewOptions& options = {});

}  // namespace planish
