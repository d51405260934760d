// How far a map is from keeping angles and areas.
#pragma once

#include <cstdint>
#include <functional>
#include <vector>

#include "Eigen/Core"
#include "core/abf/target_angles.h"
#include "core/base/execution.h"
#include "core/mesh/mesh.h"
#include "core/unwrap/quality.h"
#include "core/unwrap/verify.h"

namespace planish {

// Sums over triangles mapped to the plane.
struct MapSums {
  double surface_area = 0, uv_area = 0;
  double conformal = 0, conformal_max = 1;  // ratio of singular values; the first weighted by area
  double stretch = 0;                       // mean square of the singular values of plane to surface, weighted by area

  // A triangle with the corners p in the plane and q on the surface.
  void Add(const Vec2 p[3], const Vec3 q[3]);
  void Add(const MapSums& other);
  // Quality::stretch_l2; 1 for surfaces without area.
  double StretchL2() const;
};

// Length of the seams on the surface, of the faces that `takes_part` marks (Quality::seam_length, before it is
// divided): an edge of n faces counts for each of its n / 2 pairs that are apart in the map. `is_joined`, per
// half-edge: the map goes on behind it.
double SeamLength(const Mesh& mesh, const std::function<bool(std::int32_t)>& is_joined,
                  const std::vector<char>& takes_part, const Execution& execution);

// Fills the distortion measures and packing_efficiency of `quality` (definitions at planish.v1.Quality; efficiency per
// unit square, as for one tile); leaves the counts alone. `measured` are the angles on the surface. Faces marked in
// `ignored` (empty: none) do not count. A UV triangle without area has infinite distortion. Changes nothing after a
// cancellation.
void MeasureDistortion(const Mesh& mesh, const Eigen::VectorXd& measured, const TargetAngles& target,
                       const CornerUv& uv, const std::vector<char>& ignored, Quality* quality,
                       const Execution& execution = {});

}  // namespace planish
