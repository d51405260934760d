// What UV alone say about charts, whoever made them.
#pragma once

#include <cstdint>
#include <vector>

#include "core/mesh/mesh.h"
#include "core/unwrap/verify.h"

namespace planish::bench {

struct UvIslands {
  std::vector<std::int32_t> opposite;  // as Topology::opposite, across edges that the map does not open
  std::vector<std::int32_t> chart;     // per face, from 0; -1 for those left out
  std::int32_t count = 0;
};

// Two triangles with opposite directions along an edge are in one chart if both of its ends have the same (u, v) in
// both. Faces marked in `ignored` are in none. Faces must name three different vertices.
UvIslands FindUvIslands(const Mesh& mesh, const CornerUv& uv, const std::vector<char>& ignored);

// Pairs of charts whose outlines meet or come nearer to each other than `distance`, in units of UV. One inside of
// another, far from its outline, is left to CheckOverlaps().
std::int64_t CountTooNear(const UvIslands& islands, const CornerUv& uv, double distance);

}  // namespace planish::bench
