// Needles that are longer than the texture.
//
// A face of 10,000 by 0.01 on a surface of 400 by 400 would set the scale of the whole atlas, though no texture shows
// anything across it, and no cut makes it shorter. Such faces get charts of their own, which are drawn smaller than the
// others. Their shape, and with it the stretch of each chart, stays. The warning CHARTS_REDUCED counts and names them.
// A polygon counts as a whole: a needle in the triangulation of a broad polygon does not count.
#pragma once

#include <cstdint>
#include <vector>

#include "core/charts/tuning.h"
#include "core/mesh/mesh.h"
#include "core/unwrap/polygons.h"
#include "core/unwrap/unwrap.h"

namespace planish {

// Per face: 1 for the triangles of needles (AtlasTuning::needle_aspect) that are longer than AtlasTuning::max_extent,
// and, if there are any, of those longer than AtlasTuning::needle_length. Empty if there are none, or not enough else.
std::vector<char> FindLongNeedles(const Mesh& mesh, const Polygons& polygons, const AtlasTuning& tuning);

// Per face: how many times its length on the surface a needle is drawn, as much less than 1 as makes all their charts
// short enough and leaves room for the others; 1 for other faces. Adds the warning.
std::vector<double> ReduceLongNeedles(const Mesh& mesh, const Polygons& polygons, const std::vector<char>& needles,
                                      const std::vector<std::vector<std::int32_t>>& charts,
                                      const UnwrapOptions& options, std::vector<UnwrapWarning>* warnings);

}  // namespace planish
