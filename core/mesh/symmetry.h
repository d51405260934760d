// Finds meshes that are mirror-symmetric, or nearly.
#pragma once

#include <cstdint>
#include <optional>
#include <vector>

#include "core/base/execution.h"
#include "core/mesh/mesh.h"

namespace planish {

struct Mirror {
  enum class Side : char { kFirst, kSecond, kAcross };  // kAcross: the face's polygon is its own image

  // Per corner: the corner that faces the mirror image of the edge that it faces, from within; -1 if that edge has no
  // image, or the corner's polygon has none. The image of an image is the corner itself.
  std::vector<std::int32_t> corner;
  // Per face: a face of its polygon's image; -1 if there is none. For faces of the second side without an image: one of
  // the first side that lies about where their image would be.
  std::vector<std::int32_t> face;
  std::vector<Side> side;  // per face
  // Per face: its polygon. Triangles that match only in pairs, since the diagonal is another on the other side, are one
  // polygon.
  std::vector<std::int32_t> polygon;
  double share = 0;  // of the area that has an image
};

// A plane across an axis, through the middle of the box round the mesh or through its centre of area, for which 90 % of
// the area has an image: the best of these planes. Vertices may be off by a thousandth of the diagonal. `polygon`, per
// face (empty: every face is one): polygons match as a whole, even with other diagonals. O(n log n).
std::optional<Mirror> FindMirror(const Mesh& mesh, const std::vector<std::int32_t>& polygon,
                                 const Execution& execution = {});

}  // namespace planish
