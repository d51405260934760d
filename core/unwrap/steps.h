// The steps of an unwrap in their order, and what passes between them. Unwrap() calls one after the other; each
// announces itself to the caller and measures its time.
//
//   Segment()               a mesh            -> Charts: a surface, cut into discs, each in the solver's arrays
//     ImproveSeams()        estimates of maps -> discs that are glued, and borders that are moved
//     RefineEstimated()     estimates of maps -> discs that are cut before they are solved for
//     JoinEstimated()       estimates of maps -> discs that are joined
//   SolveCharts()           some charts       -> angles (ABF), positions in the plane, and the faults of these maps
//     MapWithFixedBorders() one chart         -> another map, if no seam may be added and the first map is unusable
//   Refine()                all charts        -> charts that were cut once more, for SolveCharts()
//   JoinCharts()            all charts        -> fewer charts, solved
//   PackCharts()            all charts        -> Atlas: UV of every corner of the mesh
//   Deliver()               UV                -> Delivery: the UV in the type for delivery, and flipped faces
//     ShakeCharts()         a draft's UV      -> the UV with charts rotated so that faces collapse, if any can
//     NudgeCharts()         Delivery          -> the UV with charts moved slightly, if that removes faults
//     WidenCharts()         charts, faults    -> charts with faces too thin for the type, for SolveCharts()
//     FindOverlaps()        Delivery          -> faces that overlap
//     RefineDelivered()     charts, faults    -> the charts at fault as delivered, cut, for SolveCharts()
//   Report()                all of that       -> UnwrapResult
#pragma once

#include <cstdint>
#include <deque>
#include <map>
#include <memory>
#include <optional>
#include <vector>

#include "absl/status/statusor.h"
#include "core/base/execution.h"
#include "core/charts/seam_cost.h"
#include "core/charts/segmentation.h"
#include "core/charts/surface.h"
#include "core/pack/necks.h"
#include "core/unwrap/chart.h"
#include "core/unwrap/chart_estimate.h"
#include "core/unwrap/polygons.h"
#include "core/unwrap/unwrap.h"
#include "core/unwrap/verify.h"

namespace planish {

// One call of Unwrap(): its arguments, and its warnings and times so far.
struct Job {
  const Mesh& mesh;
  const UnwrapOptions& options;
  const UnwrapControl& control;
  const Execution execution;
  const Polygons polygons;
  UnwrapProgress progress = {};
  std::vector<UnwrapWarning> warnings = {};
  UnwrapSeconds seconds = {};
  bool is_folded = false;              // the mesh is one side of another mesh, and its mirror image (segment_folded.cc)
  std::vector<float> visibility = {};  // Visibility(), once it is known

  // Announces a stage. CANCELLED after a cancellation.
  absl::Status Enter(UnwrapStage stage);
  // Receives Execution::Report(): the fraction of the stage of charts that is done. Other stages do not report.
  void Reach(double fraction);
  // FaceVisibility() of the mesh, measured at the first call.
  const std::vector<float>& Visibility();
  // Whether the packer places the charts.
  bool packs() const { return options.pack && options.seams.policy != SeamPolicy::kNone; }
  bool may_split() const {
    return options.seams.policy == SeamPolicy::kAuto || options.seams.policy == SeamPolicy::kNeeded;
  }
};

struct MappedChart {
  Chart chart;
  // Whether it has at least three faces, of more than one polygon. Other charts are always solved to the end, since a
  // cut may not help.
  bool is_worth_cutting = false;
  std::unique_ptr<Flattening> flattening;  // from solve to layout; null for a triangle as measured
  ChartMap map;
  ChartFaults faults;   // of the map; not computed with SeamPolicy::kNone, unless the solve was stopped
  double work = 0;      // FlattenWork::work of all solves of the last SolveCharts()
  absl::Status status;  // of solve and layout

  // Whether the chart is not a disc, so that its map has a slit.
  bool is_slit() const { return map.closed_slits.size() < chart.slits.size(); }
};

// The data passed between the steps. Several steps read each member.
struct Charts {
  // The surface and its segmentation. Null for SeamPolicy::kNone: the mesh is a disc, and only its one chart is kept.
  std::unique_ptr<const Surface> surface;
  std::optional<Segmentation> segmentation;
  // Per chart of the segmentation: its mirror image, maybe the chart itself; -1 without an image. Empty if no chart has
  // one, and after the first cut.
  std::vector<std::int32_t> image;
  std::optional<Mirror> mirror;  // of the surface, as long as both sides are cut alike
  bool are_alike = false;        // Segment() has cut both sides alike, or nearly
  // What ImproveSeams() may do: a share of its usual work, and whether it mends charts. It then glues none, and also
  // moves seams of charts that are not sound.
  double search_work = 1;
  bool are_mended = false;
  double cost = 0;                    // result of ImproveSeams()
  std::optional<double> folded_cost;  // the same for the folded mesh, if charts are like its charts (SegmentFolded())
  std::vector<char> ignored;          // per face: has no area and is excluded from all promises; empty if no face is
  double total_area = 0;              // of the surface
  double drawn_area = 0;              // the same with `reduction`, which shrinks long needles to almost nothing
  // Per atlas (AtlasOf()): the size of its content. If all atlases have one texel density, the largest content of any
  // atlas. The square root of the area is a length to compare the lengths of charts with.
  struct AtlasSize {
    double area = 0;     // as drawn
    double longest = 0;  // length of the longest polygon, as drawn; sets the scale if longer than the texture
  };
  std::map<std::int32_t, AtlasSize> atlas_size;
  // Approximate rounding unit of UV, in the units of the surface: `resolution` for float, or for double if double is
  // certain; `grain` for the last type that is tried, for which faces are widened.
  double resolution = 0, grain = 0;
  std::vector<double> least_angle;  // per face, as Chart::least_angle; empty: no face is widened
  std::vector<double> reduction;    // per face: the scale of a long needle (long_needles.h), else 1; empty: all 1
  std::vector<std::int32_t> place;  // per face: its number in the chart that it was last extracted with
  double work = 0;                  // work of all solves so far, each weighted by the faces of its chart
  // With SeamPolicy::kNeeded: charts that were cut because their solves took too much work.
  std::int64_t given_up = 0;
  int widenings = 0;               // calls of WidenCharts() that found something
  std::deque<MappedChart> charts;  // a vector would move many large charts when charts are added
  // Whether slits are moved from the edges of the segmentation to short paths: with SeamPolicy::kKeep and kNeeded.
  bool slits_are_moved = false;
  bool are_joined = false;  // JoinCharts() has been called

  std::int32_t count() const { return static_cast<std::int32_t>(charts.size()); }
  bool is_ignored(std::int64_t f) const { return !ignored.empty() && ignored[f] != 0; }
  // MeasuredAngles() of the faces of a chart of this mesh, from the surface if there is one.
  Eigen::VectorXd AnglesOf(const Mesh& mesh, const Chart& chart, const Execution& execution) const;
  // The least reduction of these faces.
  double ReductionOf(const std::vector<std::int32_t>& faces) const;
  // Per face of the mesh: its chart; -1 for faces without a chart (Surface::takes_part).
  std::vector<std::int32_t> FaceChart(const Mesh& mesh) const;
  // Per half-edge of the mesh: the half-edge joined to it in its chart, also at closed slits; -1 on outlines.
  std::vector<std::int32_t> Opposite(const Mesh& mesh) const;
};

// Imports the mesh and cuts it into discs as SeamOptions::policy says. Errors: those of CheckDisc() for kNone, of
// MakeSurface() otherwise; PIECE_NOT_A_DISC for kKeep (closed, or with a handle); CANCELLED. Warnings:
// FACES_WITHOUT_AREA, EDGES_NON_MANIFOLD, ORIENTATION_INCONSISTENT.
absl::StatusOr<Charts> Segment(Job* job);

// Makes chart i of its faces in the segmentation.
void ExtractChart(std::int32_t i, const Execution& execution, Charts* charts);

// Maps these charts, small charts in parallel. Errors as Unwrap(). If a chart may be split, a failed solve is not an
// error, but is recorded in MappedChart::status.
absl::Status SolveCharts(Job* job, std::vector<std::int32_t> todo, Charts* charts);

// How much work the maps of charts may take (AtlasTuning::most_work and following).
struct WorkLimits {
  std::int64_t solve = 0;      // FlattenControl::most_work of a chart that may be cut
  std::int64_t other_map = 0;  // of each map that MapWithFixedBorders() tries; 0: it is not called
  bool gives_up = false;       // FlattenControl::gives_up
};
// The limits of the next SolveCharts(), for these charts.
WorkLimits WorkLimitsFor(const Job& job, const Charts& charts, const std::vector<std::int32_t>& todo);

// The arguments of the solve of one chart. If `reports`, the solve runs on the caller's thread and reports its
// progress.
struct ChartSolve {
  Job* job;
  const Charts& charts;
  std::int32_t number;  // of the chart
  WorkLimits limits;
  const Execution& execution;
  bool reports;
};

// Solves one chart by ABF, and adds to its `work`. ControlOf() makes the control for that, and for solves of the chart
// with another topology.
absl::StatusOr<Flattening> FlattenWith(const ChartSolve& solve, BoundaryType boundary, std::int64_t most_work,
                                       MappedChart* mapped);
FlattenControl ControlOf(const ChartSolve& solve);

// Limit of the root mean square stretch of a map that keeps the given borders.
inline constexpr double kMostStretchForBorders = 100;

// If the map of a chart overlaps itself, needs a slit, or is stretched beyond use by a barrier, replaces it by the
// first of a list of other maps (fixed_borders.cc) that does not overlap and is stretched less.
void MapWithFixedBorders(const ChartSolve& solve, MappedChart* mapped);

// Cuts charts in `todo`, which were solved last, if their maps are unusable. Returns whether it cut any; `todo` then
// lists the charts to solve. CANCELLED after a cancellation.
absl::StatusOr<bool> Refine(Job* job, std::vector<std::int32_t>* todo, Charts* charts);

// Before charts are solved for: cuts charts whose estimated maps are unusable, and then charts that pack better in
// parts. CANCELLED after a cancellation; charts and estimates must not be used then. After a stop request some charts
// have no estimates. `are_known`: the estimates are up to date.
absl::Status RefineEstimated(const Job& job, const Execution& execution, ChartEstimates* estimates, Charts* charts,
                             bool are_known = false);

// With SeamPreference::kSeams, before charts are solved for: glues charts and moves seams as long as that lowers the
// cost of seams. After a stop request nothing changes. CANCELLED after a cancellation. Returns the cost of all seams
// and charts at the end.
absl::StatusOr<double> ImproveSeams(Job* job, const SeamCost& cost, const Execution& execution,
                                    ChartEstimates* estimates, Charts* charts);

// Makes charts of one side of a symmetric surface, and their mirror images on the other side. Sets `segmentation`,
// `image` and `mirror`, with which ImproveSeams() keeps both sides alike. Returns the share of the area that has a
// mirror image. Returns 0 and changes nothing for other surfaces, or if seams are given. `seams`: the argument with
// which `charts->surface` was made.
absl::StatusOr<double> SegmentMirrored(Job* job, GivenSeams seams, const Execution& execution, Charts* charts);

// The same for a surface whose sides have about the same shape, but other triangles: makes charts of one side and its
// mirror image (FoldNearlySymmetric()), and like charts of the whole surface (Segmentation::Like()). Sets
// `segmentation`, `search_work` and `folded_cost`. Meshes of less than 500 faces are left alone. `seams`: as for
// SegmentMirrored(), but without any given ones.
absl::StatusOr<double> SegmentFolded(Job* job, const GivenSeams& seams, const Execution& execution, Charts* charts);

// Measures the areas with which charts are compared: sets `drawn_area` and `atlas_size`.
void MeasureAtlases(const Job& job, Charts* charts);

// The tuning of merging and of estimates for the job's SeamPreference.
AtlasTuning ChartTuning(const UnwrapOptions& options);
// The limit of stretch of the first merging of charts. ImproveSeams() continues from its result.
double FirstStretch(const UnwrapOptions& options);

// Whether the map of a chart is unusable and the chart must be cut. Only charts of two faces or more can be cut.
bool IsToSplit(const Job& job, const Charts& charts, const MappedChart& mapped);

// Whether the estimated map of chart i of the segmentation is unusable and the chart must be cut.
bool IsToSplit(const Job& job, const Charts& charts, std::int32_t i, const ChartEstimate& estimate);

// The tuning of cuts for the job's PackEffort.
const PackerCuts& PackerCutsFor(const UnwrapOptions& options);

// The gain that a cut at a neck must have for the packer.
NeckOptions NecksOf(const Charts& charts, const UnwrapOptions& options);

// Joins two charts wherever the map of the joined chart is sound and the packer loses less area than a cut there would
// have to save. So charts that cuts have left small get other neighbours. Only with SeamPolicy::kAuto. Charts with
// widened faces, and charts that are drawn larger or smaller than others, are not joined. Work is bounded by a share of
// the faces (AtlasTuning). After a stop request all charts stay. CANCELLED after a cancellation.
absl::Status JoinCharts(Job* job, Charts* charts);
// Joins charts like JoinCharts(), but by estimates of their maps, before any chart is solved for.
absl::Status JoinEstimated(Job* job, ChartEstimates* estimates, Charts* charts);

// The number of the atlas of a face and its chart.
std::int32_t AtlasOf(const UnwrapOptions& options, std::int32_t face);

// The mean of UnwrapOptions::face_weights over a chart, by area; the plain mean if its faces have no area.
double WeightOf(const UnwrapOptions& options, const Surface& surface, const Chart& chart);

// The result of packing.
struct Atlas {
  CornerUv uv;  // as packed, before rounding
  int tiles = 1;
  int texture_size = 1024;
  double scale = 1;    // UV length per length on the surface, at weight 1; the least of all atlases
  double padding = 0;  // texels that are free between charts, PackOptions::padding unless there is no room
  std::map<std::int32_t, AtlasReport> atlases;  // by AtlasReport::atlas; faces and efficiency are not set
};

// Packs the charts (core/pack/pack.h). The one chart of SeamPolicy::kNone is scaled to fit the unit square, without
// padding: it has no neighbours, and scales that vary over many orders of magnitude survive rounding best next to 0.
// Without UnwrapOptions::pack leaves charts as they are, the lowest u and v of each at 0. Faces without a chart
// (Surface::takes_part) get the UV of one of their edges in a chart of their atlas, or else of one of their vertices,
// or else of a tile's corner. With UnwrapOptions::texels_per_unit charts have that density. OPTIONS_INVALID: the
// texture (with finds_texture_size, the largest) has no room for that density. `is_draft`: the placement only serves to
// find out what rounding does to each chart. In a draft after a packing `before`, charts that were solved since are put
// in one place at its scale; in a draft without one, all charts are packed with the fewest trials. CANCELLED after a
// cancellation.
absl::StatusOr<Atlas> PackCharts(Job* job, const Atlas* before, bool is_draft, Charts* charts);

// Writes the UV of the chart's corners, rounded to this type, as the map has been placed.
void WriteUv(const MappedChart& mapped, Precision precision, const Execution& execution, CornerUv* uv);

// A chart whose stretch as delivered exceeds this times SeamOptions::max_stretch is cut, or a warning names it.
// Rounding to float alone adds less.
inline constexpr double kStretchTolerance = 1.001;

// The UV in the type in which they are delivered, and their faults.
struct Delivery {
  CornerUv uv;
  Precision precision = Precision::kFloat;  // kFloat or kDouble
  std::int64_t lost = 0;  // triangles that rounding to float flips or collapses, or would: then `precision` is kDouble
  std::vector<std::int32_t> lost_faces;  // the first few
  OrientationFaults orientation;
  Overlaps overlaps;     // by FindOverlaps()
  bool stopped = false;  // UnwrapControl::stop had come before they were judged; a later stop changes nothing
};

// Pairs of triangles of these charts that overlap by UV of the mesh's corners, as delivered.
Overlaps OverlapsWithin(const std::vector<const MappedChart*>& charts, const CornerUv& uv,
                        const std::vector<char>& ignored, const Execution& execution);

// Rounds the UV as UnwrapOptions::precision says and judges their orientation. CANCELLED after a cancellation.
absl::StatusOr<Delivery> Deliver(Job* job, const Charts& charts, CornerUv uv);

// Looks for triangles that overlap as delivered, which takes long where many of them are collapsed. `is_draft`: each
// chart by itself. CANCELLED after a cancellation.
absl::Status FindOverlaps(Job* job, const Charts& charts, bool is_draft, Delivery* delivery);

// In a draft: tries several angles for each chart, and rotates it to an angle at which faces collapse or flip as
// delivered. Later steps widen these faces, or cut the charts, as if the packer had chosen that angle.
void ShakeCharts(const Job& job, Charts* charts, Delivery* delivery);

// Moves charts by at most kFreeMove if, as delivered, a few of their faces are collapsed or flipped or (after
// FindOverlaps()) overlap, and if the move removes the fault. Returns whether any chart was moved; FindOverlaps() must
// then be called again.
bool NudgeCharts(const Job& job, Charts* charts, Delivery* delivery);

// Widens thin faces that are collapsed or flipped as delivered (widening.h), and sets `todo` to their charts. Returns
// whether there are such charts; false after kMostWidenings such calls in a job.
bool WidenCharts(Job* job, const Atlas& atlas, const Delivery& delivery, std::vector<std::int32_t>* todo,
                 Charts* charts);

// Cuts charts that overlap themselves as delivered, as rounding can make an outline do that touches itself. Cuts charts
// that are stretched beyond kStretchTolerance times the limit as delivered, by rounding, or because faces too thin for
// the type do not count there. Separates faces from their charts that are still flipped or collapsed because widening
// has not helped. Returns the same as Refine().
absl::StatusOr<bool> RefineDelivered(Job* job, const Atlas& atlas, const Delivery& delivery,
                                     std::vector<std::int32_t>* todo, Charts* charts);

// Measures the delivered UV and makes the report, including the job's warnings and seconds. CANCELLED after a
// cancellation.
absl::StatusOr<UnwrapResult> Report(Job* job, const Charts& charts, const Atlas& atlas, Delivery delivery);

// ---- What callers are told about a result, in words and as data (warnings.cc). Messages count polygons, since these
// are the caller's faces; "count" in the metadata counts triangles, and UnwrapWarning::faces has their numbers.
// Each function adds only the warnings that apply.

// Adds FACES_WITHOUT_AREA, EDGES_NON_MANIFOLD, ORIENTATION_INCONSISTENT. `ignored` marks the faces without area.
void WarnOfSurface(const Surface& surface, const Polygons& polygons, const std::vector<char>& ignored,
                   std::vector<UnwrapWarning>* warnings);

// Adds FACES_WIDENED. `widened`: the faces that are too thin for `precision`, and that the map therefore widens;
// ascending.
void WarnOfWidened(const std::vector<std::int32_t>& widened, const Polygons& polygons, Precision precision,
                   std::vector<UnwrapWarning>* warnings);

// Adds POLYGON_TORN. `first_faces`: the first face of each such polygon.
void WarnOfTornPolygons(const std::vector<std::int32_t>& first_faces, std::vector<UnwrapWarning>* warnings);

// Counts of seams that were added to the given ones.
struct AddedSeams {
  std::int64_t with_holes = 0;           // charts with holes that were slit open
  std::int64_t others = 0;               // charts that are closed or have handles, and were slit open
  std::int64_t slit_edges = 0;           // edges of the slits of all these charts
  std::int64_t split = 0;                // charts that came from splitting others
  std::int64_t given_up = 0;             // charts that were split because their solves took too much work
  std::vector<std::int32_t> faces = {};  // one on each slit edge
};
// Counts the added seams; only for SeamPolicy::kKeep and kNeeded. `first_count`: the number of charts before any was
// split.
AddedSeams FindAddedSeams(const Mesh& mesh, const Charts& charts, std::int32_t first_count);

// Adds SEAMS_ADDED.
void WarnOfAddedSeams(const AddedSeams& added, SeamPolicy policy, std::vector<UnwrapWarning>* warnings);

// Adds NOT_CONVERGED, PRECONDITIONER_CHANGED, LINEAR_SOLVES_FAILED, BOUNDARY_NOT_SETTLED, BARRIER_KEPT,
// BARYCENTRIC_MAP, STRETCH_ABOVE_LIMIT: one warning for all charts concerned. `max_stretch` 0: no limit. `stopped`:
// charts may have been left without the cuts that they need.
void WarnOfCharts(const std::vector<ChartReport>& charts, double max_stretch, bool stopped,
                  std::vector<UnwrapWarning>* warnings);

// STRETCH_HIGH names charts that are stretched more than this, if the caller's seams decide and not
// SeamOptions::max_stretch.
inline constexpr double kMuchStretch = 2;
// Adds STRETCH_HIGH. Per chart: its stretch, and its most stretched face.
void WarnOfMuchStretch(const std::vector<double>& stretch, const std::vector<std::int32_t>& worst_face,
                       SeamPolicy policy, std::vector<UnwrapWarning>* warnings);

// Adds two warnings. DENSITY_VARIES: charts whose texel density in `uv`, the UV as delivered, differs from
// AtlasReport's, without those that CHARTS_REDUCED names. FACES_TOO_LONG: polygons so long that they set the density of
// all (density.cc).
void WarnOfDensity(const Job& job, const Charts& charts, const Atlas& atlas, const CornerUv& uv,
                   std::vector<UnwrapWarning>* warnings);

// Adds STOPPED: the caller asked for the best map found by then.
void WarnOfStop(const std::vector<ChartReport>& charts, std::vector<UnwrapWarning>* warnings);

// Adds UV_FLIPPED, UV_DEGENERATE, UV_OVERLAPPING.
void WarnOfFaults(const OrientationFaults& orientation, const Overlaps& overlaps, std::vector<UnwrapWarning>* warnings);

// The first kMaxNamed of these faces, "2,3,5": "faces" in metadata.
std::string FirstFaces(const std::vector<std::int32_t>& faces);

}  // namespace planish
