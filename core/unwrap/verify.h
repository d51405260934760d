// The verifier: judges UV as delivered, of any origin, by exact predicates.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "core/base/execution.h"
#include "core/mesh/mesh.h"

namespace planish {

// UV as delivered: u and v of corner 3 f + k at 2 (3 f + k). Floats are stored as doubles.
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

// `uv` rounded to float.
CornerUv RoundToFloat(const CornerUv& uv, const Execution& execution = {});

// The most elements of each kind of fault that are named.
inline constexpr std::size_t kMaxNamed = 16;

struct OrientationFaults {
  std::int64_t flipped = 0;         // clockwise triangles
  std::int64_t degenerate = 0;      // collinear triangles
  std::vector<std::int32_t> faces;  // the first few of both, at most kMaxNamed

  // `other` has later faces.
  void Add(const OrientationFaults& other);
};

// Exact. O(F). Faces marked in `ignored` (empty: none) do not count. Incomplete after a cancellation.
OrientationFaults CheckOrientations(const CornerUv& uv, const Execution& execution = {},
                                    const std::vector<char>& ignored = {});

struct Overlaps {
  std::int64_t pairs = 0;           // triangles whose interiors meet; at least this many if `limited`
  bool limited = false;             // counting stopped at kMaxOverlaps or after too many tests, or was interrupted
  std::vector<std::int32_t> faces;  // of the first few pairs, two by two
};
inline constexpr std::int64_t kMaxOverlaps = 1'000'000;

// Exact, by looking at pairs of triangles whose boxes meet: O(F log F) where few do. Triangles may have either
// orientation; those without area have no interior, and those marked in `ignored` (empty: none) do not count. `pairs`
// gets the triangles of every pair that was counted, two by two. After `max_tests` pairs of boxes, or those of a few
// thousand triangles more, or after `max_pairs`, the search ends and `limited` is set. The same result for any team,
// but for a cancellation.
Overlaps FindOverlaps(const CornerUv& uv, std::int64_t max_tests, std::vector<std::int32_t>* pairs = nullptr,
                      const Execution& execution = {}, const std::vector<char>& ignored = {},
                      std::int64_t max_pairs = kMaxOverlaps);

// Exact, by a sweep: O(F log F) whatever the shapes, needles that fan out from one vertex included. At most one pair is
// found; then `limited` is set.
Overlaps FindOneOverlap(const CornerUv& uv, const Execution& execution = {}, const std::vector<char>& ignored = {});

// Whether outlines alone prove that no two triangles overlap, as CheckOverlaps() says. False where they do not, and
// where more than `max_tests` pairs of boxes would have to be looked at.
bool OutlinesProveNoOverlap(const std::vector<std::int32_t>& opposite, const CornerUv& uv,
                            const OrientationFaults& orientation, std::int64_t max_tests,
                            const Execution& execution = {}, const std::vector<char>& ignored = {});

// Exact. `opposite` tells which corners face the same edge (-1: none, an outline; Topology::opposite), and with it
// which faces make up a chart. Where every triangle keeps its orientation and outlines neither meet themselves nor each
// other, a chart is injective: every point is covered as often as its outlines wind round it, once (they are simple
// curves, one of which runs counter-clockwise round all the others, which run clockwise). Charts then overlap only if
// one lies inside another, which their winding numbers tell. This takes O(b log b) for b outline edges; only otherwise
// does FindOverlaps() look at pairs of triangles. Where too many boxes meet, as in large fans, FindOneOverlap()
// decides: O(F log F) in all. Triangles without area have no interior, and faces marked in `ignored` (empty: none)
// count neither way.
Overlaps CheckOverlaps(const std::vector<std::int32_t>& opposite, const CornerUv& uv,
                       const OrientationFaults& orientation, const Execution& execution = {},
                       const std::vector<char>& ignored = {}, std::int64_t max_pairs = kMaxOverlaps);

}  // namespace planish
