// How much of its surroundings each face of a surface sees: what a viewer from outside can see of it.
#pragma once

#include <cstdint>
#include <vector>

#include "core/base/execution.h"
#include "core/mesh/mesh.h"

namespace planish {

// Per face: the share of the hemisphere above it, weighted by the cosine, from which light comes in without meeting a
// triangle, from either side. In [0, 1]; 1 for faces without area, and for all where a position of a face is not
// finite. Of an edge: EdgeVisibility().
//
// Rays from some of the faces; others take what those nearest along the surface have, smoothed. A coarse measure: at
// most 1 microsecond a triangle and 5 ms. The same for any number of threads. O(F log F). Of no use after a
// cancellation.
std::vector<float> FaceVisibility(const Mesh& mesh, const Execution& execution = {});

// The same share as seen from places on the surface, more exactly: rays from the places themselves. `normals`:
// outwards, of any length; 0: the share is 0. Of many places only some are looked at, evenly among them, within the
// same time; the others have the share of the last one before them.
std::vector<float> VisibilityFrom(const Mesh& mesh, const std::vector<Vec3>& places, const std::vector<Vec3>& normals,
                                  const Execution& execution = {});

// Of the edge between faces f and g: the mean.
inline double EdgeVisibility(const std::vector<float>& visibility, std::int32_t f, std::int32_t g) {
  return (static_cast<double>(visibility[f]) + static_cast<double>(visibility[g])) / 2;
}

}  // namespace planish
