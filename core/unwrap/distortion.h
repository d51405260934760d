// Measures how well a map keeps angles and areas.
#pragma once

#include <cstdint>
#include <functional>
#include <optional>
#include <vector>

#include "Eigen/Core"
#include "core/abf/target_angles.h"
#include "core/base/execution.h"
#include "core/mesh/mesh.h"
#include "core/unwrap/verify.h"

namespace planish {

// The quality of a delivered map: exact validity and distortion. Fields as in planish.v1.Quality.
struct Quality {
  std::int64_t flipped = 0;
  std::int64_t degenerate = 0;
  std::int64_t overlapping = 0;
  double angle_error_mean_deg = 0;
  double angle_error_max_deg = 0;
  double abf_energy = 0;  // mean over all angles of ((x - a) / a)^2
  double conformal_distortion_mean = 1;
  double conformal_distortion_max = 1;
  double stretch_l2 = 1;
  double packing_efficiency = 0;
  double seam_length = 0;  // over the square root of the surface's area
  // As in SeamFigures (seam_figures.h).
  double visible_seam_length = 0, seam_turn_deg = 0;
  std::optional<double> seam_symmetry = {};
};

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

// Length of the seams on the surface (Quality::seam_length, not normalized): an edge of n faces counts for each of its
// n / 2 pairs that are separated in the map. `half_edges`: all half-edges of the surface, in any order; two joined
// half-edges of one edge may be left out. `is_joined`, per half-edge: whether the map continues across it. O(n).
double SeamLength(const Mesh& mesh, const std::vector<std::int32_t>& half_edges,
                  const std::function<bool(std::int32_t)>& is_joined);

// Sums for the distortion measures of a Quality.
struct DistortionSums {
  double angle_error = 0, angle_error_max = 0;  // radians, over all angles
  double energy = 0;                            // of ABF
  std::int64_t faces = 0;
  MapSums map;

  void Add(const DistortionSums& other);
  // Sets the distortion measures and packing_efficiency (per unit square, for one tile) of `quality`, but no other
  // fields. Without faces, sets nothing.
  void Fill(Quality* quality) const;
};

// Measures `faces` of the mesh. `measured` (angles on the surface) and `target` have the angle of corner k of faces[i]
// at index 3 i + k. Ignores faces marked in `ignored` (per face of the mesh; empty: none). A UV triangle without area
// has infinite distortion. Incomplete after a cancellation.
DistortionSums MeasureDistortion(const Mesh& mesh, const std::vector<std::int32_t>& faces,
                                 const Eigen::VectorXd& measured, const TargetAngles& target, const CornerUv& uv,
                                 const std::vector<char>& ignored, const Execution& execution = {});

}  // namespace planish
