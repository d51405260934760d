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

// A plane across an axis, through the middle of the box round the mesh or through its centre of area, for which 99 % of
// the area has an image: the best of these planes. Vertices may be off by a thousandth of the diagonal. With less
// (where diagonals of quads lie otherwise on the other side) what is left over makes many small charts. `polygon`, per
// face (empty: every face is one): a polygon has an image as a whole, or none. O(n).
std::optional<Mirror> FindMirror(const Mesh& mesh, const std::vector<std::int32_t>& polygon,
                                 const Execution& execution = {});

}  // namespace planish
