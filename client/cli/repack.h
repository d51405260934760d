// Packs the existing UV islands of a mesh: moves, rotates and scales them without changing their shapes.
#pragma once

#include <cstdint>
#include <vector>

#include "core/base/execution.h"
#include "core/mesh/mesh.h"
#include "core/pack/pack.h"

namespace planish::cli {

struct RepackOptions {
  PackOptions atlas;
  // True: islands keep their sizes relative to each other. False: islands are scaled so that the ratio of area in the
  // map to area on the surface is the same for all islands.
  bool keep_density = false;
  // Texels per unit of length on the surface that islands get, at weight 1; 0: as many as there is room for. Not with
  // keep_density. No effect if no island has area.
  double texels_per_unit = 0;
  // With texels_per_unit: atlas.texture_size is ignored; the texture gets the smallest power of two, in [16, 65536],
  // that has room for this density.
  bool finds_texture_size = false;
  // Weight of each face, above 0; empty: 1. The scale of an island is multiplied by the mean weight of its faces,
  // weighted by area on the surface (the plain mean if the island has no area there).
  std::vector<double> face_weights;
};

struct Repacking {
  std::vector<float> uv;              // as given, 6 numbers a face
  std::int64_t islands = 0;           // client/files/uv_islands.h
  std::int64_t mirrored = 0;          // islands of negative area in the map; packing does not change that
  std::int64_t without_area = 0;      // islands whose UV lie on a line or a point
  std::int64_t lost_to_rounding = 0;  // triangles that rounding to float collapses or flips
  double covered = 0;                 // share of the used tiles that islands cover, sampled at 1024^2 points per tile
  double texels_per_unit = 0;  // per length on the surface, at weight 1; 0 with keep_density or if no island has area
  int texture_size = 0;        // as given, or as found
  Packing packing;             // islands are numbered in the order of their first faces
};

// Islands keep their shapes: overlaps inside an island remain, and mirrored islands stay mirrored. Islands may overlap
// each other in the input, but not in the result. Islands without area in the map or on the surface are scaled by the
// lengths of their edges. `uv` and `polygon` are as for FindUvIslands(); UV and positions must be finite. The result is
// invalid after a cancellation of `execution`. Throws OPTIONS_INVALID if the texture has no room for texels_per_unit
// (metadata "most": the density that it has room for). Deterministic.
Repacking Repack(const Mesh& mesh, const std::vector<double>& uv, const std::vector<std::int64_t>& polygon,
                 const RepackOptions& options, const Execution& execution = {});

}  // namespace planish::cli
