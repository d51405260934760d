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

  // Per corner c: the corner that faces the mirror image of c's edge, on the side of the image of c's face; -1 if the
  // edge, or the polygon of c, has no image. The image of an image is the corner itself.
  std::vector<std::int32_t> corner;
  // Per face: a face of its polygon's image; -1 if there is none. For faces of the second side without an image: one of
  // the first side that lies about where their image would be.
  std::vector<std::int32_t> face;
  std::vector<Side> side;  // per face
  // Per face: its polygon. Two triangles that match only as a pair, because the mirrored quad has the other diagonal,
  // form one polygon.
  std::vector<std::int32_t> polygon;
  double share = 0;  // of the area that has an image
};

// Finds the plane for which most of the area has a mirror image, among the planes perpendicular to an axis through the
// middle of the bounding box or the centre of area. nullopt if no plane has images for 90 % of the area, if the mesh
// lies more than 1,000 of its diagonals from the origin, or after a cancellation. Vertices may be off by a thousandth
// of the diagonal. `polygon` has the polygon of each face (empty: every face is one); polygons match as a whole, even
// if their diagonals differ. O(n log n).
std::optional<Mirror> FindMirror(const Mesh& mesh, const std::vector<std::int32_t>& polygon,
                                 const Execution& execution = {});

}  // namespace planish
