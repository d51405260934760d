// The verifier: checks delivered UV of any origin by exact predicates.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "core/base/execution.h"
#include "core/mesh/mesh.h"

namespace planish {

// Delivered UV: u and v of corner 3 f + k at 2 (3 f + k). Floats are stored as doubles.
using CornerUv = std::vector<double>;

inline Vec2 UvOf(const CornerUv& uv, std::int32_t corner) {
  return {uv[2 * corner], uv[2 * corner + 1]};
}

inline void SetUv(std::int64_t corner, const Vec2& p, CornerUv* uv) {
  (*uv)[2 * corner] = p.x();
  (*uv)[2 * corner + 1] = p.y();
}

inline std::array<Vec2, 3> TriangleOf(const CornerUv& uv, std::int64_t face) {
  const auto c = static_cast<std::int32_t>(3 * face);
  return {UvOf(uv, c), UvOf(uv, c + 1), UvOf(uv, c + 2)};
}

// `uv` rounded to float. With `flips`, v is rounded so that 1 - v is a float too: glTF counts v downwards, and a glTF
// file must hold the verified map. For maps in [0, 1] only, since steps of v are then 2^-24 even near 0.
CornerUv RoundToFloat(const CornerUv& uv, bool flips, const Execution& execution = {});

// The maximal number of listed elements of each kind of fault.
inline constexpr std::size_t kMaxNamed = 16;

struct OrientationFaults {
  std::int64_t flipped = 0;         // clockwise triangles
  std::int64_t degenerate = 0;      // collinear triangles
  std::vector<std::int32_t> faces;  // the first few of both, at most kMaxNamed

  // `other` must hold the faults of later faces.
  void Add(const OrientationFaults& other);
};

// Finds triangles that are not counter-clockwise. Exact. O(F). Ignores faces marked in `ignored` (empty: none).
// Incomplete after a cancellation.
OrientationFaults CheckOrientations(const CornerUv& uv, const Execution& execution = {},
                                    const std::vector<char>& ignored = {});

struct Overlaps {
  std::int64_t pairs = 0;           // of triangles whose interiors intersect; a lower bound if `limited`
  bool limited = false;             // counting stopped at kMaxOverlaps or after too many tests, or was interrupted
  std::vector<std::int32_t> faces;  // of the first few pairs, two by two
};
inline constexpr std::int64_t kMaxOverlaps = 1'000'000;

// Counts overlapping pairs exactly, by testing pairs of triangles whose boxes intersect: O(F log F) if few do.
// Triangles may have either orientation; those without area have no interior, and those marked in `ignored` (empty:
// none) do not count. `pairs` gets the triangles of every counted pair. After about `max_tests` pairs of boxes, or
// after `max_pairs`, the search ends and `limited` is set. The same result for any team, except after a cancellation.
Overlaps FindOverlaps(const CornerUv& uv, std::int64_t max_tests, std::vector<std::int32_t>* pairs = nullptr,
                      const Execution& execution = {}, const std::vector<char>& ignored = {},
                      std::int64_t max_pairs = kMaxOverlaps);

// Decides exactly whether triangles overlap, by a sweep: O(F log F) for any shapes, including needles that fan out from
// one vertex. Finds at most one pair; then `limited` is set.
Overlaps FindOneOverlap(const CornerUv& uv, const Execution& execution = {}, const std::vector<char>& ignored = {});

// Whether the outlines alone prove that no two triangles overlap (see CheckOverlaps()). False if they do not, or if
// that would take more than `max_tests` tests of boxes.
bool OutlinesProveNoOverlap(const std::vector<std::int32_t>& opposite, const CornerUv& uv,
                            const OrientationFaults& orientation, std::int64_t max_tests,
                            const Execution& execution = {}, const std::vector<char>& ignored = {});

// Counts overlapping pairs of triangles, exactly. `opposite` says which corners face the same edge (-1: none, an
// outline; Topology::opposite), and so which faces form a chart. If every triangle keeps its orientation and outlines
// intersect neither themselves nor each other, a chart is injective: every point is covered as often as the chart's
// outlines wind round it, which is once (they are simple curves, one of which runs counter-clockwise round all the
// others, which run clockwise). Charts then overlap only if one is inside another, which winding numbers show. This
// takes O(b log b) for b outline edges. Otherwise FindOverlaps() tests pairs of triangles; if too many boxes intersect,
// as in large fans, FindOneOverlap() decides, in O(F log F) in all. Triangles without area have no interior, and faces
// marked in `ignored` (empty: none) are left out.
Overlaps CheckOverlaps(const std::vector<std::int32_t>& opposite, const CornerUv& uv,
                       const OrientationFaults& orientation, const Execution& execution = {},
                       const std::vector<char>& ignored = {}, std::int64_t max_pairs = kMaxOverlaps);

}  // namespace planish
