// Needles that are longer than the texture.
//
// A face of 10,000 by 0.01 on a surface of 400 by 400 would determine the scale of the whole atlas, although no texture
// shows anything across it, and no cut makes it shorter. Such faces get charts of their own, which are drawn smaller
// than the others. Their shape, and so the stretch of each chart, does not change. The warning CHARTS_REDUCED counts
// and lists them. A polygon counts as a whole: needles in the triangulation of a broad polygon do not count.
#pragma once

#include <cstdint>
#include <vector>

#include "core/charts/tuning.h"
#include "core/mesh/mesh.h"
#include "core/unwrap/polygons.h"
#include "core/unwrap/unwrap.h"

namespace planish {

// Per face: 1 for triangles of needles (AtlasTuning::needle_aspect) longer than AtlasTuning::max_extent; if the mesh
// has such needles, also for needles longer than AtlasTuning::needle_length. Empty if the mesh has no long needles, or
// too little besides.
std::vector<char> FindLongNeedles(const Mesh& mesh, const Polygons& polygons, const AtlasTuning& tuning);

// Per face: the scale of a needle, small enough that the charts of all needles fit and leave room for others; 1 for
// other faces. Adds the warning.
std::vector<double> ReduceLongNeedles(const Mesh& mesh, const Polygons& polygons, const std::vector<char>& needles,
                                      const std::vector<std::vector<std::int32_t>>& charts,
                                      const UnwrapOptions& options, std::vector<UnwrapWarning>* warnings);

}  // namespace planish
