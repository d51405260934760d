// The verifier: judges delivered UV, whoever made them, by exact predicates.
#pragma once

#include <cstdint>
#include <vector>

#include "core/base/execution.h"
#include "core/mesh/topology.h"

namespace planish {

// UV as delivered: u and v of corner 3 f + k at 2 (3 f + k). Floats are stored as doubles.
using CornerUv = std::vector<double>;

// `uv` rounded to float.
CornerUv RoundToFloat(const CornerUv& uv, const Execution& execution = {});

struct OrientationFaults {
  std::int64_t flipped = 0;         // clockwise triangles
  std::int64_t degenerate = 0;      // collinear triangles
  std::vector<std::int32_t> faces;  // the first few of both
};

// Exact. O(F). Incomplete after an interrupt.
OrientationFaults CheckOrientations(const CornerUv& uv, const Execution& execution = {});

struct Overlaps {
  std::int64_t pairs = 0;           // triangles whose interiors meet; at least this many if `limited`
  bool limited = false;             // counting stopped at kMaxOverlaps, or was interrupted
  std::vector<std::int32_t> faces;  // of the first few pairs, two by two
};
inline constexpr std::int64_t kMaxOverlaps = 1'000'000;

// Exact. A map without faults of orientation whose boundary is one closed curve that does not meet itself is injective
// (every point inside is covered as often as the curve winds round it, once), which takes O(b log b) for b boundary
// edges; only otherwise are pairs of triangles looked at. Degenerate triangles have no interior.
Overlaps CheckOverlaps(const Topology& topology, const CornerUv& uv, const OrientationFaults& orientation,
                       const Execution& execution = {});

}  // namespace planish
