// Finds meshes that are mirror-symmetric, or nearly.
#pragma once

#include <cstdint>
#include <optional>
#include <vector>

#include "core/base/execution.h"
#include "core/mesh/mesh.h"

namespace planish {

struct Mirror {
  // Per corner: the corresponding corner of the face's mirror image; -1 if the face has no image. The image of an image
  // is the corner itself, and a face is never its own image.
  std::vector<std::int32_t> corner;
  std::vector<char> is_second;  // per face: whether it has an image and is on the second side of the plane

  bool has_image(std::int32_t f) const { return corner[3 * f] >= 0; }
};

// The best plane perpendicular to an axis, through the middle of the bounding box or through the centre of area, for
// which 99 % of the area has an image. Nothing if there is no such plane: with a smaller share (if diagonals of quads
// differ between the sides), the remaining faces make many small charts. Vertices may be off by a thousandth of the
// diagonal. `polygon`: per face the number of its polygon (empty: every face is one). A polygon has an image as a whole
// or not at all. O(n).
std::optional<Mirror> FindMirror(const Mesh& mesh, const std::vector<std::int32_t>& polygon,
                                 const Execution& execution = {});

}  // namespace planish
