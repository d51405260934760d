// Puts UV into a Draco mesh.
#pragma once

#include <cstdint>
#include <vector>

#include "core/base/corner_split.h"
#include "core/draco/points.h"

namespace planish {

// Splits the points as in `split`, and replaces the UV attribute with the unique id `old_uv` (-1: there is none) by
// split.uv as floats, not quantized. The new attribute comes last, and has the id of the old one or a free id.
// `indices`: per corner of the faces, the new point.
void ReplaceDracoUv(const CornerSplit& split, const std::vector<std::int32_t>& indices, std::int64_t old_uv,
                    DracoPoints* points);

}  // namespace planish
