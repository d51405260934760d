// UV that a mesh already has: its islands, and packing them anew.
#pragma once

#include <cstdint>
#include <vector>

#include "core/base/execution.h"
#include "core/mesh/mesh.h"
#include "core/pack/pack.h"

namespace planish {

// Per face the island that it belongs to, numbered from 0 in the order of their first faces. Faces are of one island
// if a chain of edges leads from one to the other, across each of which the places of both ends and their UV are the
// same: islands that lie on each other, and vertices that the file has twice for their normals, are told right.
// `corner_texcoord`: per corner 3 f + k an id, equal where UV are equal.
std::vector<std::int32_t> FindIslands(const Mesh& mesh, const std::vector<std::int32_t>& corner_texcoord);

enum class IslandDensity {
  kEqual,  // scaled so that all have the same length in the texture per length on the surface, on the average
  kKeep    // as large, relative to each other, as they are
};

struct Repacking {
  std::vector<double> corner_uv;          // (u, v) per corner
  std::vector<std::int32_t> face_island;  // FindIslands()
  Packing packing;                        // of the islands
};

// Each island moves as one: what is mirrored, or folded onto itself, stays so. `corner_uv` has finite numbers.
Repacking Repack(const Mesh& mesh, const std::vector<double>& corner_uv,
                 const std::vector<std::int32_t>& corner_texcoord, IslandDensity density, const PackOptions& options,
                 const Execution& execution = {});

}  // namespace planish
