// What goes into an unwrap and what comes out: plain structs, the proto's messages with std types.
//
// Everything lives in namespace planish. The inline namespace carries the number of the binary interface, the 0 of
// libplanish.so.0, so that two versions of the library can be in one process; a program never names it.
#pragma once

#include <algorithm>
#include <chrono>
#include <cstddef>
#include <cstdint>
#include <iterator>
#include <map>
#include <optional>
#include <span>
#include <string>
#include <tuple>
#include <type_traits>
#include <utility>
#include <variant>
#include <vector>

#include "planish/error.h"

namespace planish::inline abi0 {

// A triangle mesh that belongs to the caller; nothing is copied. `positions` holds x, y, z per vertex in any unit;
// `triangles` holds three 0-based vertex ids per triangle, counter-clockwise seen from outside. Positions travel as
// float. Where that would lose digits of a mesh far from the origin, a common point is subtracted from all positions
// before, in double. Vertices without a triangle are allowed and ignored.
class MeshView {
 public:
  using Positions = std::variant<std::span<const float>, std::span<const double>>;

  MeshView(Positions positions, std::span<const std::uint32_t> triangles)
      : positions_(positions), indices_(triangles) {}
  MeshView(Positions positions, std::span<const std::int32_t> triangles) : MeshView(positions, Unsigned(triangles)) {}

  // The same mesh with given seams: edges along which charts part, in addition to hard edges
  // (UnwrapOptions::hard_edge_degrees); what Seams adds to them is its own affair. By the two vertices of each edge,
  // two ids per edge in any order: a pair that no triangle has as an edge is refused (OPTIONS_INVALID, metadata
  // "edges").
  MeshView WithSeams(std::span<const std::uint32_t> pairs) const { return With(&MeshView::seam_vertices_, pairs); }
  MeshView WithSeams(std::span<const std::int32_t> pairs) const { return WithSeams(Unsigned(pairs)); }
  // By corners: number 3 t + k stands for the edge that corner k of triangle t faces, between its other two corners.
  // May be used beside WithSeams.
  MeshView WithSeamCorners(std::span<const std::int32_t> c) const { return With(&MeshView::seam_corners_, c); }
  // Edges, by corners in the same way, along which no seam is added. Given seams part charts all the same.
  MeshView WithUncutCorners(std::span<const std::int32_t> c) const { return With(&MeshView::uncut_corners_, c); }

  // The polygon that each triangle comes from: a number for each, below triangle_count(). A polygon stays in one piece,
  // so that each of its corners has one UV: no seam follows an edge between two of its triangles that run along it in
  // opposite directions, whatever other triangles have that edge.
  MeshView WithFacePolygons(std::span<const std::int32_t> p) const { return With(&MeshView::face_polygon_, p); }
  // The atlas that each triangle goes into: a number for each, from 0 on. Charts end where it differs;
  // UnwrapOptions::atlas_layout says where atlases go, and Atlas::atlases what became of each.
  MeshView WithFaceAtlas(std::span<const std::int32_t> atlas) const { return With(&MeshView::face_atlas_, atlas); }
  // So many times the texels per length: a number for each triangle, in [0.01, 100]. Charts end where it differs; with
  // Seams::kKeep they do not, and have the mean of their triangles by area.
  MeshView WithFaceWeights(std::span<const float> weights) const { return With(&MeshView::face_weights_, weights); }

  std::int64_t vertex_count() const {
    return std::visit([](auto numbers) { return static_cast<std::int64_t>(numbers.size()); }, positions_) / 3;
  }
  std::int64_t triangle_count() const { return static_cast<std::int64_t>(indices_.size()) / 3; }

 private:
  friend struct PackedMesh;
  // Signed and unsigned variants of one type may alias. Negative ids wrap, and are refused as out of range.
  static std::span<const std::uint32_t> Unsigned(std::span<const std::int32_t> ids) {
    return {reinterpret_cast<const std::uint32_t*>(ids.data()), ids.size()};
  }
  template <typename Member>
  MeshView With(Member MeshView::*member, Member value) const {
    MeshView view = *this;
    view.*member = value;
    return view;
  }

  Positions positions_;
  std::span<const std::uint32_t> indices_;
  std::span<const std::uint32_t> seam_vertices_;
  std::span<const std::int32_t> seam_corners_;
  std::span<const std::int32_t> uncut_corners_;
  std::span<const std::int32_t> face_polygon_;
  std::span<const std::int32_t> face_atlas_;
  std::span<const float> face_weights_;
};

enum class JobState { kUnspecified, kQueued, kRunning, kStopping, kSucceeded, kFailed, kCancelled, kExpired };
enum class Stage {
  kUnspecified,
  kUpload,
  kQueue,
  kDecode,
  kCharts,
  kSolve,
  kLayout,
  kPack,
  kVerify,
  kEncode,
  kDownload
};
enum class Seams {
  kNone,  // no edge is cut: the mesh must be a topological disc
  kKeep,  // the given seams; pieces with holes are slit where they have no other map (SEAMS_ADDED), closed ones refused
  kNeeded,  // the given seams, and more only where a piece is no disc or has no map that keeps its borders
            // (SEAMS_ADDED)
  kAuto,    // the given seams, and as many more as keep the stretch of every chart below max_stretch
};
enum class Prefer {
  kSeams,    // few, short and hidden seams
  kTexture,  // charts that pack well: more of them, cut at arms and necks, and less stretch
};
enum class Solver { kAuto, kUzawa, kMinres, kDirect };
enum class System { kAuto, kFull, kReduced };
enum class Preconditioner { kAuto, kNone, kJacobi, kCholesky, kAmg };
enum class Hessian { kConvex, kExact, kAuto };
enum class Boundary { kFree, kConvex };
enum class Precision { kAuto, kFloat, kDouble };
enum class Priority { kLow, kNormal, kHigh };
enum class AtlasLayout {
  kUdim,     // each atlas into UDIM tiles of its own, all at one texel density
  kStacked,  // all into the same tiles, as textures of their own, each as large as it fits there
};
enum class Effort {
  kFast,    // packing costs about a quarter of the rest of the unwrap
  kNormal,  // about a quarter of the rest, and 0.15 ms a chart
  kBest,    // with more charts: fifty times the rest, or a minute where that is more
};

template <typename Enum>
struct EnumNames {
  const char* of[11];  // by value; null beyond the last one
};
inline constexpr std::tuple kEnumNames = {
    EnumNames<JobState>{"unknown", "QUEUED", "RUNNING", "STOPPING", "SUCCEEDED", "FAILED", "CANCELLED", "EXPIRED"},
    EnumNames<Stage>{"unknown", "upload", "queue", "decode", "charts", "solve", "layout", "pack", "verify", "encode",
                     "download"},
    EnumNames<Seams>{"none", "keep", "needed", "auto"},
    EnumNames<Prefer>{"seams", "texture"},
    EnumNames<Solver>{"auto", "uzawa", "minres", "direct"},
    EnumNames<System>{"auto", "full", "reduced"},
    EnumNames<Preconditioner>{"auto", "none", "jacobi", "cholesky", "amg"},
    EnumNames<Hessian>{"convex", "exact", "auto"},
    EnumNames<Boundary>{"free", "convex"},
    EnumNames<Precision>{"auto", "float", "double"},
    EnumNames<Priority>{"low", "normal", "high"},
    EnumNames<AtlasLayout>{"udim", "stacked"},
    EnumNames<Effort>{"fast", "normal", "best"}};

// As the command line and the JSON report spell the enums above; "unknown" for a value that only a newer server knows.
template <typename Enum>
requires std::is_enum_v<Enum>
const char* ToString(Enum value) {
  const auto& names = std::get<EnumNames<Enum>>(kEnumNames).of;
  const auto i = static_cast<std::size_t>(value);
  return i < std::size(names) && names[i] != nullptr ? names[i] : "unknown";
}

// Whether a job in this state will never change again.
inline bool IsTerminal(JobState state) {
  return state >= JobState::kSucceeded && state <= JobState::kExpired;
}

// How Newton's method goes about the angles of a chart. What is chosen changes cost, hardly the map.
struct SolverOptions {
  Solver method = Solver::kAuto;  // of the linear system of a Newton step
  System system = System::kAuto;
  Preconditioner preconditioner = Preconditioner::kAuto;
  Hessian hessian = Hessian::kAuto;
  double tolerance = 0;           // radians per angle, in (0, 1e-2]; 0: the server's default, 1e-9
  int max_newton_iterations = 0;  // in [1, 1000]; 0: the server's default, 100
};

struct UnwrapOptions {
  Seams seams = Seams::kAuto;
  Prefer prefer = Prefer::kSeams;  // with kAuto
  double max_stretch = 0;  // of any chart (ChartReport::stretch_l2), with kAuto; in [1.001, 100]; 0: 1.25, 1.05 with
                           // Prefer::kTexture
  double hard_edge_degrees = 0;  // edges whose faces' normals are further apart are given seams; (0, 180], 0: none
  bool pack = true;              // false: charts as they were solved, at the surface's scale, one over the other
  int texture_size = 0;          // texels per side of a tile, in [16, 65536]; 0: 1024
  std::optional<int> padding;    // texels between charts, half as many at the rim, in [0, 64]; unset: 2
  int tiles = 0;                 // of each atlas: UDIM 1001, 1002, ..., ten in a row; in [1, 100]; 0: 1
  AtlasLayout atlas_layout = AtlasLayout::kUdim;  // with MeshView::WithFaceAtlas
  Effort effort = Effort::kNormal;                // of packing
  Boundary boundary = Boundary::kFree;            // kConvex: the outline of the map is a convex polygon
  Precision precision = Precision::kAuto;         // of the UV; kAuto: kFloat where floats keep the map
  int threads = 0;  // in [1, 256], at most what the server allows; 0: that many. The UV do not depend on it
  SolverOptions solver;
};

// When a job runs, and for how long. Does not change what comes out unless a limit is met.
struct Scheduling {
  // A waiting job counts as 10 minutes older with kHigh, younger with kLow; the oldest is next.
  Priority priority = Priority::kNormal;
  // From acceptance on: a job that has not ended then fails with DEADLINE_EXCEEDED, whoever waits for it; 0: none.
  Seconds timeout{0};
  // Of running: a job that runs longer is stopped, and delivers the best map it has then; 0: none.
  Seconds compute_budget{0};
  bool fresh = false;  // compute anew even if the server has the result for this mesh and these options
};

// Largest residual of each constraint family and of the scaled gradient, in radians (wheel: a logarithm).
struct Residual {
  double triangle = 0, vertex = 0, wheel = 0, gradient = 0;

  double Worst() const { return std::max({triangle, vertex, wheel, gradient}); }
};

struct Progress {
  Stage stage = Stage::kUnspecified;
  int chart = 0;  // 0-based
  int chart_count = 0;
  int newton_iteration = 0;            // completed
  std::int64_t linear_iterations = 0;  // over all Newton steps so far
  double linear_residual = 0;          // relative, of the present linear solve; 0 between solves
  Residual residual;                   // after newton_iteration steps
  double energy = 0;
  double step_length = 0;     // fraction of the last Newton step taken
  Seconds elapsed{0};         // since the worker began
  double tolerance = 0;       // largest residual that ends the solve as converged
  double stage_fraction = 0;  // of the stage that is done, roughly; 0 in stages that do not tell
};

// How the boundary control of a chart went.
struct BoundaryReport {
  Boundary boundary = Boundary::kFree;  // as asked for
  // The rest is for kConvex only.
  int vertices = 0;     // boundary vertices
  int active = 0;       // of these, held straight in the end
  int set_changes = 0;  // times that the set of these changed
  bool settled = true;  // the set is right; otherwise warning BOUNDARY_NOT_SETTLED
};

struct ChartReport {
  std::int64_t triangles = 0;
  std::string method;  // "abf"
  Solver solver = Solver::kAuto;
  System system = System::kAuto;
  Preconditioner preconditioner = Preconditioner::kAuto;
  std::string preconditioner_note;  // what multigrid had to do without, and why; or empty
  Hessian hessian = Hessian::kConvex;
  bool converged = false;
  int newton_iterations = 0;
  std::int64_t linear_iterations = 0;
  Residual residual;
  int convexified_iterations = 0;  // Newton steps in which the Hessian of a face was made positive
  int indefinite_iterations = 0;   // Newton steps with the exact, indefinite Hessian, by MINRES whatever `solver` is
  std::string stop_message;        // one sentence with numbers
  double abf_energy = 0;           // as Quality::abf_energy, of the angles as solved, before any rounding
  double barrier = 0;              // above 0 where the ABF energy alone has no minimum (warning BARRIER_KEPT)
  BoundaryReport boundary;
  double stretch_l2 = 1;  // as Quality::stretch_l2, of this chart by itself
  int chart = 0;          // its number, 0-based
  // The largest residual where Newton's method began, and after each of its steps; older servers do not tell.
  std::vector<float> newton_residuals;
};

// Over all charts, however many.
struct ChartTotals {
  int charts = 0;
  int not_converged = 0;
  std::int64_t newton_iterations = 0, linear_iterations = 0;
  Residual residual;  // the largest of each family
  double stretch_l2_max = 1;
  std::vector<float> newton_residuals;  // the largest of any chart after so many steps
};

// One of several atlases.
struct AtlasPart {
  int atlas = 0;  // its number (MeshView::WithFaceAtlas)
  std::int64_t triangles = 0;
  int charts = 0;
  int first_tile = 0;             // 0 is UDIM 1001
  int tiles = 1;                  // from first_tile to the last that is used
  double texels_per_unit = 0;     // of length on the surface, at weight 1
  double packing_efficiency = 0;  // area of the triangles over that of the tiles
};

// Where the charts went, in texels of the texture that was asked for.
struct Atlas {
  bool pack = true;
  int texture_size = 0;
  int padding = 0;
  int tiles = 1;               // up to the last that is used
  double texels_per_unit = 0;  // of length on the surface, at weight 1, the least of all atlases; 0 without packing
  Effort effort = Effort::kNormal;
  AtlasLayout layout = AtlasLayout::kUdim;
  // With WithFaceAtlas: one for each number, ascending, 1024 at most; otherwise empty.
  std::vector<AtlasPart> atlases = {};
  double padding_kept = 0;  // texels that are free between charts: `padding`, or less where there was no room
};

// Measured on the delivered UV with exact predicates.
struct Quality {
  std::int64_t flipped = 0;
  std::int64_t degenerate = 0;
  std::int64_t overlapping = 0;  // pairs of UV triangles whose interiors meet
  double angle_error_mean_deg = 0, angle_error_max_deg = 0;
  double abf_energy = 0;
  double conformal_distortion_mean = 1, conformal_distortion_max = 1;
  double stretch_l2 = 1;
  double packing_efficiency = 0;
  double seam_length = 0;               // of the seams on the surface, over the square root of its area
  double visible_seam_length = 0;       // the same, each edge weighted by how much of its surroundings is open, 0 to 1
  double seam_turn_deg = 0;             // mean angle by which seams turn from edge to edge; 0: straight
  std::optional<double> seam_symmetry;  // share of the seams whose mirror image is a seam; empty without mirror plane
};

// Wall-clock time of each stage: upload (encode, send, accept), download and total as this client saw them, the others
// as the server did.
struct StageTimes {
  Seconds upload{0}, queue{0}, decode{0}, charts{0}, solve{0}, layout{0}, pack{0}, verify{0}, encode{0}, download{0};
  Seconds total{0};
};

// A promise that was not kept, or something the caller should know; reasons as in planish.v1.Warning.
struct Warning {
  std::string reason;
  std::string message;
  std::map<std::string, std::string> metadata;  // element ids are the caller's own
};

struct Report {
  std::int64_t triangles = 0, vertices = 0;
  // One per chart, ascending; of more than 1024 those that did not converge, then those of the largest stretch.
  std::vector<ChartReport> charts;
  ChartTotals chart_totals;
  Atlas atlas;
  Quality quality;
  StageTimes times;
  std::int64_t peak_memory_bytes = 0;
  int threads = 0;  // the job could use: UnwrapOptions::threads, or less where the server allowed less
  std::vector<Warning> warnings;
};

struct Job {
  using Time = std::chrono::system_clock::time_point;

  std::string name;  // "jobs/..."
  JobState state = JobState::kUnspecified;
  std::map<std::string, std::string> labels;  // as given by whoever created it
  UnwrapOptions options;
  std::optional<Time> create_time, start_time, end_time;
  std::int64_t mesh_bytes = 0;
  int queue_position = 0;            // jobs ahead while QUEUED
  std::optional<Progress> progress;  // while RUNNING or STOPPING
  std::optional<Error> error;        // when FAILED; ids in the order of the mesh as sent
  std::optional<Report> report;      // when SUCCEEDED
  Scheduling scheduling;
  int attempts = 0;                 // times a worker began with it; above 1 after a worker or the server died
  bool stop_requested = false;      // by StopJob, or its compute budget is used up
  bool cancel_requested = false;    // by CancelJob, or its caller went away
  std::string result_of;            // the job whose work it shares (same mesh and options); empty: its own
  std::int64_t memory_bytes = 0;    // reserved while it runs
  std::optional<Time> expire_time;  // when SUCCEEDED: its UV are dropped then at the latest
  std::string trace_id;             // of the W3C trace that created it, 32 hex digits, as in the server's log
};

// What a job would need, and how long it would wait, before it is created.
struct JobEstimate {
  std::int64_t triangles = 0, vertices = 0;
  std::int64_t memory_bytes = 0;  // reserved while it runs
  Seconds run_time{0};            // on one idle core, roughly
  Seconds queue_time{0};          // until a job created now would start, roughly
  std::optional<Error> refusal;   // what CreateJob would be refused with now
};

// Something that happened to a job: exactly one of `job` (after a change of state) and `progress` is set.
struct Event {
  std::int64_t sequence = 0;  // 1, 2, 3, ... within a job; jumps where events were lost or the server was restarted
  Job::Time time;
  std::int64_t skipped = 0;  // events between the one before and this one that the server no longer had
  std::optional<Job> job;
  std::optional<Progress> progress;
};

// UV as float or double, whichever UnwrapOptions::precision asked for or, with kAuto, the server chose: of every corner
// in the caller's own order. Numbers 2 (3 f + k) and 2 (3 f + k) + 1 are (u, v) of corner k of triangle f.
class Uv {
 public:
  using Numbers = std::variant<std::vector<float>, std::vector<double>>;

  Uv() = default;
  explicit Uv(Numbers numbers) : numbers_(std::move(numbers)) {}

  // kFloat or kDouble.
  Precision precision() const { return numbers_.index() == 0 ? Precision::kFloat : Precision::kDouble; }
  std::size_t size() const {
    return std::visit([](const auto& numbers) { return numbers.size(); }, numbers_);
  }
  // Number i < size(), whatever the type.
  double operator[](std::size_t i) const {
    return std::visit([i](const auto& numbers) -> double { return numbers[i]; }, numbers_);
  }
  // All of them as T, rounded where T is float and they are not.
  template <typename T>
  std::vector<T> As() const {
    return std::visit([](const auto& numbers) { return std::vector<T>(numbers.begin(), numbers.end()); }, numbers_);
  }
  // As they came, for std::visit and std::get_if: nobody reads floats where there are doubles.
  const Numbers& numbers() const { return numbers_; }

 private:
  Numbers numbers_;
};

struct UnwrapResult {
  std::string job;       // name
  std::string trace_id;  // of the call's W3C trace, 32 hex digits, as in the server's log
  Uv uv;
  Report report;

  // Every chart converged and no UV triangle is flipped or degenerate. (Overlaps are warnings.)
  bool IsUsable() const {
    return report.chart_totals.not_converged == 0 && report.quality.flipped == 0 && report.quality.degenerate == 0;
  }
};

struct Capabilities {
  std::string version;
  std::int64_t max_mesh_bytes = 0;
  int workers = 0;
  int queue_capacity = 0;
  std::vector<Seams> seams;
  std::vector<SolverOptions> solvers;  // the method, system and preconditioner that go together
  int threads = 0;                     // a job may use at most
  std::int64_t max_triangles = 0;
  std::int64_t memory_bytes = 0;        // that running jobs may reserve together
  std::int64_t inline_mesh_bytes = 0;   // larger meshes travel by a resumable upload; 0: none do
  std::int64_t upload_chunk_bytes = 0;  // in a message of an upload
  Seconds reattach_grace{0};            // that the job of a caller that went away waits for it to come back
  bool durable = false;                 // jobs, meshes and results outlive a restart of the server
  bool isolated_workers = false;        // jobs run in processes of their own
};

}  // namespace planish::inline abi0
