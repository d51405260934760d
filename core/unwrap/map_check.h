// Checks the existing map of a mesh, from any tool: its faults and its quality.
#pragma once

#include <cstdint>
#include <vector>

#include "core/base/execution.h"
#include "core/mesh/half_edges.h"
#include "core/mesh/mesh.h"
#include "core/unwrap/chart_spacing.h"
#include "core/unwrap/seam_figures.h"
#include "core/unwrap/verify.h"

namespace planish {

// The connectivity of a map's corners (UvIslands in client/files/uv_islands.h).
struct MapTopology {
  // Per corner an id in [0, num_places), equal exactly if position and UV are.
  std::vector<std::int32_t> place_of_corner;
  std::int32_t num_places = 0;
  std::vector<std::int32_t> chart_of_face;
  std::int32_t num_charts = 0;
  std::vector<char> is_outline;  // per half-edge c (core/mesh/half_edges.h): the map ends there
  EdgeGroups edges;              // half-edges between the same two places
};

struct MapCheckOptions {
  int texture_size = 1024;   // texels per side of a tile
  int tiles = 1;             // charts may be in this many tiles: UDIM 1001, 1002, ..., ten in a row
  double min_padding = 0;    // texels: lists pairs of charts nearer than this; 0: none
  bool with_spacing = true;  // false: skips MapCheck::spacing, which takes time
  // Per face, in [0, num_materials), or -1: none. Empty: no face has a material.
  std::vector<std::int32_t> material_of_face;
  std::int32_t num_materials = 0;
};

// Bits of MapCheck::faults.
inline constexpr std::uint8_t kFlippedFace = 1;       // orientation opposite to the rest of its chart
inline constexpr std::uint8_t kDegenerateFace = 2;    // collinear in the map
inline constexpr std::uint8_t kOverlappingFace = 4;   // its interior intersects another triangle
inline constexpr std::uint8_t kOutsideFace = 8;       // in none of the tiles, or in several
inline constexpr std::uint8_t kFaceWithoutArea = 16;  // no area on the surface; excludes the first three faults

struct ChartCheck {
  std::int64_t triangles = 0;
  bool is_mirrored = false;  // its signed area in the map is negative
  std::int32_t tile = -1;    // the tile that holds all of it, 0 for UDIM 1001; -1: none
  double uv_area = 0;        // without sign
  double surface_area = 0;
  double stretch_l2 = 1;  // as Quality::stretch_l2, of this chart alone
  double angle_error_mean_deg = 0;
  double texels_per_unit = 0;  // per length on the surface: the square root of texels per area
};

// Texels per length on the surface, for the faces of one material that have area both on the surface and in the map.
struct DensityCheck {
  std::int32_t material = -1;
  std::int64_t triangles = 0;
  double mean = 0;           // over all of their area
  double low = 0, high = 0;  // a twentieth of their area on the surface has less, and a twentieth more
};

struct MapCheck {
  std::int64_t flipped = 0, degenerate = 0, outside = 0;
  std::int64_t without_area = 0;  // on the surface: no map can give them area (Unwrap()'s warning FACES_WITHOUT_AREA)
  std::int64_t mirrored_charts = 0, mirrored_triangles = 0;  // mirrored_triangles: oriented as their chart
  Overlaps overlaps;
  std::vector<std::int32_t> overlapping_pairs;  // pairs of faces; all that were counted
  std::int64_t overlapping = 0;                 // triangles that are in a pair
  std::vector<std::uint8_t> faults;             // per face
  std::vector<ChartCheck> charts;
  ChartSpacing spacing;                 // distances in texels, up to max(kSpacingReach, min_padding)
  std::vector<DensityCheck> densities;  // ascending by material, those without a material first
  double stretch_l2 = 1;                // of the whole map, at a common scale
  double angle_error_mean_deg = 0, angle_error_max_deg = 0;  // of faces with area on the surface and in the map
  double seam_length = 0;                                    // on the surface, over the square root of its area
  SeamFigures seams;
  std::vector<float> face_visibility;  // FaceVisibility()
  double surface_area = 0, uv_area = 0;
  int tiles_used = 1;             // tiles with a face; at least 1
  double packing_efficiency = 0;  // uv_area over the area of these tiles; overlaps count several times
  // Per face: log2 of the larger of its larger singular value (from the surface to the map) and the inverse of its
  // smaller one, relative to the scale of the whole map; 0: no stretch. Infinity for faces without area on either side.
  std::vector<float> face_stretch;
  std::vector<float> face_angle_error;  // largest of its three, degrees; 0 without area
};
inline constexpr double kSpacingReach = 64;  // texels
// Limits on tested pairs of boxes: about ten seconds of one core.
inline constexpr std::int64_t kMaxOverlapTests = 200'000'000, kMaxSpacingTests = 100'000'000;

// Positions and UV of all faces must be finite. The counts of flipped, degenerate, overlapping and outside faces are
// exact. Faces without area, on the surface or in the map, do not count in stretch, angle errors and densities. Invalid
// after a cancellation.
MapCheck CheckMap(const Mesh& mesh, const CornerUv& uv, const MapTopology& topology, const MapCheckOptions& options,
                  const Execution& execution = {});

}  // namespace planish
