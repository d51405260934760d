// The mirror plane of a surface whose two sides have about the same shape.
#pragma once

#include "core/base/execution.h"
#include "core/mesh/mesh.h"
#include "core/mesh/surface_places.h"

namespace planish {

// A place of the surface lies near a mirror image within this distance, in diagonals of the mesh, and with this cosine
// between the normals.
inline constexpr double kNearImage = 0.015, kNearImageCosine = 0.7;

// In the coordinates of SurfacePlaces.
struct MirrorPlane {
  Vec3 normal = Vec3::UnitX();  // of length 1
  double place = 0;             // along the normal
  double share = 0;             // of the area that lies near its mirror image

  Vec3 Image(const Vec3& p) const { return p - 2 * (p.dot(normal) - place) * normal; }
  Vec3 ImageOfDirection(const Vec3& d) const { return d - 2 * d.dot(normal) * normal; }
};

// The plane with the most area near its mirror image, by samples. The surface must have an area. Candidates are planes
// perpendicular to an axis, and to the principal axes; each is moved to where the samples lie nearest to their mirror
// images (iterated closest points). The share is 0 if there is no plane with half of the samples near. After a
// cancellation: any plane.
MirrorPlane FindMirrorPlane(const SurfacePlaces& places, const Execution& execution);

}  // namespace planish
