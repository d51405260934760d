// The facade of the core: a triangle mesh in, verified UV and a report out.
//
//   planish::Mesh mesh = ...;
//   absl::StatusOr<planish::UnwrapResult> result = planish::Unwrap(mesh, {}, {});
#pragma once

#include <cstdint>
#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "core/abf/flatten.h"
#include "core/base/interrupter.h"
#include "core/charts/tuning.h"
#include "core/mesh/mesh.h"
#include "core/pack/pack.h"
#include "core/unwrap/distortion.h"

namespace planish {

// The type of the delivered UV.
enum class Precision {
  kAuto,  // float, unless rounding to float flips or collapses triangles that double keeps
  kFloat,
  kDouble,
};

// Which edges part charts, beside boundaries and edges that no chart can cross: edges between two faces of opposite
// winding. Where more than two faces meet, pairs of them stay joined, the flattest first, and charts end between
// others.
enum class SeamPolicy {
  kNone,  // none: the mesh must be a disc
  // The given seams, and slits in pieces with holes that have no other sound map with a stretch of 2 or less (warning
  // SEAMS_ADDED). Closed pieces, and pieces with handles, are refused.
  kKeep,
  kNeeded,  // the given seams, and more only where a piece is no disc or no map keeps its borders
  kAuto,    // the given seams, and as many more as keep stretch below max_stretch
};

// The purpose for which SeamPolicy::kAuto places seams.
enum class SeamPreference {
  kSeams,    // few, short and hidden seams (core/charts/seam_cost.h)
  kTexture,  // charts that pack well: more of them, cut at arms and necks, and less stretch
};

struct SeamOptions {
  SeamPolicy policy = SeamPolicy::kAuto;
  SeamPreference prefer = SeamPreference::kSeams;
  // Edges at which the normals of the two faces are further apart than this are seams. Degrees in (0, 180]; 0: none.
  double hard_edge_degrees = 0;
  // More seams: the edges that these corners face (corner 3 f + k faces the edge from v_{k+1} to v_{k+2}).
  std::vector<std::int32_t> corners;
  // Edges, in the same form, along which no seam is added, even if they are hard edges. Given seams and edges that no
  // chart can cross still separate charts.
  std::vector<std::int32_t> uncut_corners;
  // With kAuto, charts are cut until their root mean square stretch (Quality::stretch_l2 of the chart by itself) stays
  // below this, as far as cutting helps. In [1.001, 100]. Default: AtlasTuning::seams_stretch or texture_stretch.
  std::optional<double> max_stretch;
};

// Where several atlases go (UnwrapOptions::face_atlas).
enum class AtlasLayout {
  kUdim,     // each into its own tiles, from tile a * PackOptions::tiles on for atlas a; one texel density
  kStacked,  // all into the same tiles, as textures of their own, each at the largest scale that fits
};

struct UnwrapOptions {
  FlattenOptions flatten;
  SeamOptions seams;
  bool pack = true;   // false: charts stay where they were solved, at the surface's scale, and overlap
  PackOptions atlas;  // for each atlas; Unwrap() sets `atlases` itself
  // Texels per length on the surface that charts get, at weight 1, in (0, kMostTexelsPerUnit]; 0: as many as there is
  // room for. Requires `pack`.
  double texels_per_unit = 0;
  // With texels_per_unit: PackOptions::texture_size becomes the smallest power of two that holds it, in [16, 65536].
  bool finds_texture_size = false;
  // Per face: the number of the polygon that it is a triangle of, in [0, faces); empty: every face is a polygon. Each
  // polygon stays in one piece: no seam follows an edge between two of its triangles that run along it in opposite
  // directions, even if other faces share the edge (warning POLYGON_TORN where that was impossible).
  std::vector<std::int32_t> face_polygon;
  // Per face: the number of the atlas that it goes into, from 0 on; empty: one for all. Charts end where it differs.
  std::vector<std::int32_t> face_atlas;
  AtlasLayout layout = AtlasLayout::kUdim;
  // Per face: factor of the texel density, in [kLeastWeight, kMostWeight]; empty: 1. Charts end where it differs. With
  // SeamPolicy::kKeep they do not; a chart has the mean weight of its faces by area.
  std::vector<float> face_weights;
  AtlasTuning tuning;  // constants, for benches; results are promised for the defaults
  Precision precision = Precision::kAuto;
  // Threads the job may use, the calling one included. In [1, kMaxThreads]. The result is the same bytes for any
  // number.
  int threads = 1;

  // SeamOptions::max_stretch, or its default.
  double MaxStretch() const {
    const bool by_seams = seams.prefer == SeamPreference::kSeams;
    return seams.max_stretch.value_or(by_seams ? tuning.seams_stretch : tuning.texture_stretch);
  }
  // Whether charts are cut and joined to pack better.
  bool IsForPacker() const { return pack && seams.prefer == SeamPreference::kTexture; }

  // INVALID_ARGUMENT with reason OPTIONS_INVALID and metadata "field" (as planish.v1 names it), or OK.
  absl::Status Validate() const;
  // Checks that seams.corners and seams.uncut_corners are corners of a mesh of `num_faces` faces, that face_polygon,
  // face_atlas and face_weights have a value for each face, and that they go with the other options; otherwise
  // OPTIONS_INVALID with metadata "field" ("seam_corners", "uncut_corners", ...) and "corner" or "face", the first that
  // is wrong.
  absl::Status ValidateFor(std::int64_t num_faces) const;
};
inline constexpr int kMaxThreads = 256;
inline constexpr int kMaxTiles = 100;
inline constexpr int kMinTextureSize = 16, kMaxTextureSize = 65536;
inline constexpr double kMostTexelsPerUnit = 1e9;
inline constexpr float kLeastWeight = 0.01F, kMostWeight = 100;

enum class UnwrapStage { kCharts, kSolve, kLayout, kPack, kVerify };

struct UnwrapProgress {
  UnwrapStage stage = UnwrapStage::kCharts;
  int chart = 0;  // 0-based
  int chart_count = 1;
  FlattenProgress flatten;    // meaningful from kSolve on
  double stage_fraction = 0;  // the approximate fraction of the stage that is done; 0 if unknown
};

// How a call is watched and ended. The callback runs on the calling thread, at the start of every stage, at every
// Newton iteration and every few dozen linear iterations; it must return quickly.
struct UnwrapControl {
  const Interrupter* cancel = nullptr;  // ends the call with CANCELLED
  // Requests the best valid map within reach. Any thread may set it at any time. `cancel` and `stop` must outlive the
  // call. From then on a linear solve under way is cut short, and Newton's method takes a few rough steps at most,
  // until the angles make a map without flips. Charts are no longer merged. They are cut only where they overlap
  // themselves, and each goes to the first place with room. The result is verified like any other, and has the warning
  // STOPPED (see Unwrap()). It depends on when the request came.
  const Interrupter* stop = nullptr;
  std::function<void(const UnwrapProgress&)> on_progress;
};

// A promise that was not kept, or something the caller should know; reasons as in planish.v1.Warning.
struct UnwrapWarning {
  std::string reason;
  std::string message;
  std::map<std::string, std::string> metadata;
  std::vector<std::int32_t> faces = {};  // all faces concerned; the first ones are "faces" in the metadata
};

// Wall-clock seconds of each stage.
struct UnwrapSeconds {
  double charts = 0;
  double solve = 0;
  double layout = 0;
  double pack = 0;
  double verify = 0;
};

struct ChartReport {
  std::int64_t triangles = 0;
  std::shared_ptr<const FlattenSummary> flatten;  // never null; charts that are single triangles share one
  bool is_barycentric = false;                    // its map is not by ABF: see the warning BARYCENTRIC_MAP
  double stretch_l2 = 1;                          // as Quality::stretch_l2, of this chart by itself
};

// The report of one of several atlases.
struct AtlasReport {
  std::int32_t atlas = 0;  // its number in UnwrapOptions::face_atlas
  std::int64_t faces = 0;
  std::int32_t charts = 0;  // 0 if none of its faces has a chart
  int first_tile = 0;
  int tiles = 1;                  // from first_tile to the last that is used
  double texels_per_unit = 0;     // at weight 1
  double packing_efficiency = 0;  // area of the faces divided by the area of the tiles
};

struct UnwrapResult {
  // (u, v) of every corner, 2 * 3F numbers: entries 2 (3 f + k) and 2 (3 f + k) + 1 belong to corner k of face f. In
  // [0, 1], or with several tiles in the squares of `tiles` (UDIM, ten in a row); without packing at least 0. When
  // precision is kFloat every number is a float exactly.
  std::vector<double> uv;
  Precision precision = Precision::kFloat;  // kFloat or kDouble
  std::vector<ChartReport> charts;
  std::vector<std::int32_t> face_chart;  // per face: its chart, an index into `charts`
  std::vector<std::int32_t> widened;     // faces too thin for `precision` that were widened, ascending (FACES_WIDENED)
  int tiles = 1;                         // of the texture, up to the last that is used
  int texture_size = 1024;               // texels per side of a tile
  // texture_size times UV length per length on the surface, at weight 1, the least of all atlases; 0 without packing.
  double texels_per_unit = 0;
  double padding = 0;  // texels that are free between charts: PackOptions::padding unless there was no room
  std::vector<AtlasReport> atlases;  // ascending; empty without UnwrapOptions::face_atlas
  Quality quality;                   // of `uv` as delivered
  UnwrapSeconds seconds;
  std::vector<UnwrapWarning> warnings;
};

// Cuts `mesh` into charts as SeamOptions::policy says, flattens and packs them, and verifies the result. With
// SeamPolicy::kNone the mesh must be a disc (CheckDisc() in core/mesh/diagnosis.h). Deterministic, but for stop
// requests. Thread-safe: calls share nothing, each has a team of threads of its own.
//
// Errors:
//   INVALID_ARGUMENT  a MESH_* reason; PIECE_NOT_A_DISC with SeamPolicy::kKeep; OPTIONS_INVALID from Validate() and
//                     ValidateFor(), or if the texture is too small for texels_per_unit (metadata "most": the density
//                     for which it has room)
//   CANCELLED         `control.cancel` was set; noticed within a few dozen linear iterations or a sparse factorization
//   ABORTED           STOPPED_EARLY: there was no map without flips yet when `control.stop` came
//   INTERNAL          SOLVER_FAILED: no finite map came out, or multigrid failed on a chart that is too large for a
//                     Cholesky factorization in its place
//
// A solve that ends before it has converged is no error: see FlattenSummary::converged and the warnings. The warning
// STOPPED says that `control.stop` was set before the verifier began; its metadata "charts_cut_short" counts the charts
// whose solves were ended early (maybe 0). A later stop request changes nothing.
absl::StatusOr<UnwrapResult> Unwrap(const Mesh& mesh, const UnwrapOptions& options, const UnwrapControl& control);

}  // namespace planish
