// Judges the map that a mesh has already, from any tool: its faults and its quality.
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

// How the corners of a map hang together (UvIslands in client/files/uv_islands.h).
struct MapTopology {
  // Per corner, equal exactly where position and UV are, in [0, num_places).
  std::vector<std::int32_t> place_of_corner;
  std::int32_t num_places = 0;
  std::vector<std::int32_t> chart_of_face;
  std::int32_t num_charts = 0;
  std::vector<char> is_outline;  // per half-edge c (core/mesh/half_edges.h): the map ends there
  EdgeGroups edges;              // half-edges between the same two places
};

struct MapCheckOptions {
  int texture_size = 1024;   // texels per side of a tile
  int tiles = 1;             // charts may lie in so many: UDIM 1001, 1002, ..., ten in a row
  double min_padding = 0;    // texels: pairs of charts nearer than this are listed; 0: none
  bool with_spacing = true;  // false: MapCheck::spacing is left out, which takes time
  // Per face, in [0, num_materials), or -1: none. Empty: no face has a material.
  std::vector<std::int32_t> material_of_face;
  std::int32_t num_materials = 0;
};

// Bits of MapCheck::faults.
inline constexpr std::uint8_t kFlippedFace = 1;       // turned against the rest of its chart
inline constexpr std::uint8_t kDegenerateFace = 2;    // collinear in the map
inline constexpr std::uint8_t kOverlappingFace = 4;   // its interior meets that of another triangle
inline constexpr std::uint8_t kOutsideFace = 8;       // in none of the tiles, or in several
inline constexpr std::uint8_t kFaceWithoutArea = 16;  // on the surface: it counts as none of the first three

struct ChartCheck {
  std::int64_t triangles = 0;
  bool is_mirrored = false;  // its area in the map is negative
  std::int32_t tile = -1;    // the tile that holds all of it, 0 for UDIM 1001; -1: none
  double uv_area = 0;        // without sign
  double surface_area = 0;
  double stretch_l2 = 1;  // as Quality::stretch_l2, of this chart by itself
  double angle_error_mean_deg = 0;
  double texels_per_unit = 0;  // of length on the surface: the root of texels per area
};

// Texels per unit of length on the surface, of the faces of one material that have area there and in the map.
struct DensityCheck {
  std::int32_t material = -1;
  std::int64_t triangles = 0;
  double mean = 0;           // of all their area
  double low = 0, high = 0;  // a twentieth of their area on the surface has less, and a twentieth more
};

struct MapCheck {
  std::int64_t flipped = 0, degenerate = 0, outside = 0;
  std::int64_t without_area = 0;  // on the surface: no map can give it room, as Unwrap() says in FACES_WITHOUT_AREA
  std::int64_t mirrored_charts = 0, mirrored_triangles = 0;  // that are turned as their mirrored chart is
  Overlaps overlaps;
  std::vector<std::int32_t> overlapping_pairs;  // faces, two by two; all that were counted
  std::int64_t overlapping = 0;                 // triangles that are in one of them
  std::vector<std::uint8_t> faults;             // per face
  std::vector<ChartCheck> charts;
  ChartSpacing spacing;                 // distances in texels; `reach` is kSpacingReach or min_padding if that is more
  std::vector<DensityCheck> densities;  // ascending by material, those without a material first
  double stretch_l2 = 1;                // of the whole map, its scale that of the whole
  double angle_error_mean_deg = 0, angle_error_max_deg = 0;  // of faces with area here and there
  double seam_length = 0;                                    // on the surface, over the square root of its area
  SeamFigures seams;
  std::vector<float> face_visibility;  // FaceVisibility(): how much of its surroundings is open
  double surface_area = 0, uv_area = 0;
  int tiles_used = 1;             // that hold a face; at least 1
  double packing_efficiency = 0;  // uv_area over the area of these tiles; what overlaps counts as often as it is there
  // Per face: log2 of the larger of its singular values from the surface to the map and of the inverse of its smaller
  // one, relative to the scale of the whole map: 0 is no stretch. Faces without area, there or here: infinity.
  std::vector<float> face_stretch;
  std::vector<float> face_angle_error;  // largest of its three, degrees; 0 without area
};
inline constexpr double kSpacingReach = 64;  // texels
// Pairs of boxes that are looked at: some ten seconds of one core at most.
inline constexpr std::int64_t kMaxOverlapTests = 200'000'000, kMaxSpacingTests = 100'000'000;

// All faces have finite positions and UV. Exact are the counts of flipped, degenerate, overlapping and outside faces.
// Faces without area, on the surface or in the map, do not count in stretch, angle errors and densities. Of no use
// after a cancellation.
MapCheck CheckMap(const Mesh& mesh, const CornerUv& uv, const MapTopology& topology, const MapCheckOptions& options,
                  const Execution& execution = {});

}  // namespace planish
