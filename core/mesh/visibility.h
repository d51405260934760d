// Visibility: how much of its surroundings each face of a surface sees, and so how visible it is from outside.
#pragma once

#include <cstdint>
#include <vector>

#include "core/base/execution.h"
#include "core/mesh/mesh.h"

namespace planish {

// Per face: the share of the hemisphere above it, weighted by the cosine, from which light reaches it without hitting a
// triangle, from either side. In [0, 1]. 1 for faces without area, and for all faces if a position is not finite. For
// edges see EdgeVisibility().
//
// Casts rays from some of the faces; the others get the smoothed values of the nearest ones along the surface. A coarse
// measure: at most 1 microsecond a triangle and 5 ms. The same for any number of threads. O(F log F). Invalid after a
// cancellation.
std::vector<float> FaceVisibility(const Mesh& mesh, const Execution& execution = {});

// Per place on the surface: the share of FaceVisibility(), measured more exactly, with rays from the place itself.
// `normals` point outwards, with any length; the share is 0 for a normal of 0. Of many places only some, evenly spaced,
// are sampled, within the same time; the others get the value of the last sampled place before them.
std::vector<float> VisibilityFrom(const Mesh& mesh, const std::vector<Vec3>& places, const std::vector<Vec3>& normals,
                                  const Execution& execution = {});

// The visibility of the edge between faces f and g: the mean.
inline double EdgeVisibility(const std::vector<float>& visibility, std::int32_t f, std::int32_t g) {
  return (static_cast<double>(visibility[f]) + static_cast<double>(visibility[g])) / 2;
}

}  // namespace planish
