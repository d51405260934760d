// What a delivered map is worth: exact validity and distortion.
#pragma once

#include <cstdint>

namespace planish {

// Fields as in planish.v1.Quality.
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
};

}  // namespace planish
