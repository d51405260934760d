// Puts UV into a Draco mesh.
#pragma once

#include <cstdint>
#include <vector>

#include "core/base/corner_split.h"
#include "core/draco/points.h"

namespace planish {

// Splits the points and replaces attribute `old_uv` (a unique id; -1: there is none) by split.uv as floats, not
// quantized. The new attribute is the last one; it has the id of the old one, or a new id. `indices`: per corner of the
// faces, the new point.
void ReplaceDracoUv(const CornerSplit& split, const std::vector<std::int32_t>& indices, std::int64_t old_uv,
                    DracoPoints* points);

}  // namespace planish
