// Inputs and outputs of an unwrap: plain structs, the proto's messages with std types.
//
// Everything is in namespace planish. The inline namespace has the number of the binary interface, the 0 of
// libplanish.so.0, so that two versions of the library can be in one process. Programs never name it.
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

// A triangle mesh that the caller owns; nothing is copied. `positions` has x, y, z per vertex in any unit; `triangles`
// has three 0-based vertex ids per triangle, counter-clockwise seen from outside. Positions are sent as float. If that
// would lose digits of a mesh far from the origin, a common point is first subtracted from all positions, in double.
// Vertices without a triangle are ignored.
class MeshView {
 public:
  using Positions = std::variant<std::span<const float>, std::span<const double>>;

  MeshView(Positions positions, std::span<const std::uint32_t> triangles)
      : positions_(positions), indices_(triangles) {}
  MeshView(Positions positions, std::span<const std::int32_t> triangles) : MeshView(positions, Unsigned(triangles)) {}

  // The same mesh with given seams: edges at which charts end, in addition to hard edges
  // (UnwrapOptions::hard_edge_degrees). UnwrapOptions::seams says whether further seams are added. Two vertex ids per
  // edge, in any order. A pair that is not an edge of any triangle is refused (OPTIONS_INVALID, metadata "edges").
  MeshView WithSeams(std::span<const std::uint32_t> pairs) const { return With(&MeshView::seam_vertices_, pairs); }
  MeshView WithSeams(std::span<const std::int32_t> pairs) const { return WithSeams(Unsigned(pairs)); }
  // Seams by corners: number 3 t + k is the edge that corner k of triangle t faces, between its other two corners. May
  // be combined with WithSeams.
  MeshView WithSeamCorners(std::span<const std::int32_t> c) const { return With(&MeshView::seam_corners_, c); }
  // Edges along which no seam is added, given as corners in the same way. Charts still end at given seams.
  MeshView WithUncutCorners(std::span<const std::int32_t> c) const { return With(&MeshView::uncut_corners_, c); }

  // The polygon that each triangle is a part of: a number per triangle, below triangle_count(). A polygon is not cut,
  // so each of its corners has one UV: no seam follows an edge between two of its triangles that run along the edge in
  // opposite directions, even if further triangles have that edge.
  MeshView WithFacePolygons(std::span<const std::int32_t> p) const { return With(&MeshView::face_polygon_, p); }
  // The atlas of each triangle: a number per triangle, from 0 on. Charts end between triangles of different atlases.
  // UnwrapOptions::atlas_layout says where atlases go; Atlas::atlases describes each.
  MeshView WithFaceAtlas(std::span<const std::int32_t> atlas) const { return With(&MeshView::face_atlas_, atlas); }
  // The factor of each triangle's texel density (texels per length): a number per triangle, in [0.01, 100]. Charts end
  // between triangles of different weights. With Seams::kKeep they do not: a chart gets the mean weight of its
  // triangles by area.
  MeshView WithFaceWeights(std::span<const float> weights) const { return With(&MeshView::face_weights_, weights); }

  std::int64_t vertex_count() const {
    return std::visit([](auto numbers) { return static_cast<std::int64_t>(numbers.size()); }, positions_) / 3;
  }
  std::int64_t triangle_count() const { return static_cast<std::int64_t>(indices_.size()) / 3; }

 private:
  friend struct PackedMesh;
  // The cast is allowed: signed and unsigned variants of one type may alias. Negative ids become large ones, which are
  // refused as out of range.
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
  kNone,    // no edge is cut: the mesh must be a topological disc
  kKeep,    // only the given seams; a piece with holes is slit if it cannot be mapped otherwise (SEAMS_ADDED), a closed
            // piece or one with handles is refused
  kNeeded,  // the given seams, and more only where a piece is not a disc or cannot be mapped without a further cut
            // (SEAMS_ADDED)
  kAuto,    // the given seams, and as many more as keep the stretch of every chart below max_stretch
};
enum class Prefer {
  kSeams,    // few, short and hidden seams
  kTexture,  // more charts, which pack better and stretch less; arms and necks are cut off
};
enum class Solver { kAuto, kUzawa, kMinres, kDirect };
enum class System { kAuto, kFull, kReduced };
enum class Preconditioner { kAuto, kNone, kJacobi, kCholesky, kAmg };
enum class Hessian { kConvex, kExact, kAuto };
enum class Boundary { kFree, kConvex };
enum class Precision { kAuto, kFloat, kDouble };
enum class Priority { kLow, kNormal, kHigh };
enum class AtlasLayout {
  kUdim,     // each atlas has its own UDIM tiles; all atlases have the same texel density
  kStacked,  // all atlases use the same tiles, each for textures of its own, and each is scaled to fill its tiles
};
enum class Effort {
  kFast,    // packing takes about a quarter of the rest of the unwrap
  kNormal,  // about a quarter of the rest, plus 0.15 ms for each chart
  kBest,    // also makes more charts; 50 times the rest, or a minute if that is longer (2 s a chart if they are few)
};

template <typename Enum>
struct EnumNames {
  const char* of[11];  // by value; null after the last one
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

// Names of the enum values, as on the command line and in JSON; "unknown" for values of newer servers.
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

// How Newton's method solves for the angles of a chart. These options change the run time, but hardly the map.
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
  Prefer prefer = Prefer::kSeams;  // for Seams::kAuto
  double max_stretch = 0;  // of any chart (ChartReport::stretch_l2), with kAuto; in [1.001, 100]; 0: 1.25, 1.05 with
                           // Prefer::kTexture
  double hard_edge_degrees = 0;  // edges whose faces' normals differ by more are given seams; in (0, 180], 0: none
  bool pack = true;              // false: charts stay unpacked, at the surface's scale, on top of each other
  int texture_size = 0;          // texels per side of a tile, in [16, 65536]; 0: 1024, or what texels_per_unit needs
  double texels_per_unit = 0;    // texels per length on the surface, in (0, 1e9]; 0: as many as there is room for
  std::optional<int> padding;    // free texels between charts; half as many at the edge of a tile; [0, 64]; unset: 2
  int tiles = 0;                 // that each atlas may use: UDIM 1001, 1002, ..., ten in a row; in [1, 100]; 0: 1
  AtlasLayout atlas_layout = AtlasLayout::kUdim;  // with MeshView::WithFaceAtlas
  Effort effort = Effort::kNormal;                // of packing
  Boundary boundary = Boundary::kFree;            // kConvex: the outline of the map is a convex polygon
  Precision precision = Precision::kAuto;  // of the UV; kAuto: kFloat, unless rounding would flip or collapse triangles
  int threads = 0;  // in [1, 256], and at most what the server allows; 0: as many as it allows. Does not change the UV
  SolverOptions solver;
};

// When a job runs, and for how long. Changes the result only if a limit is reached.
struct Scheduling {
  // The oldest waiting job of a tenant is next. With kHigh a job counts as 10 minutes older, with kLow as 10 minutes
  // younger.
  Priority priority = Priority::kNormal;
  // Counted from acceptance: a job that has not ended by then fails with DEADLINE_EXCEEDED; 0: no limit.
  Seconds timeout{0};
  // A job that runs longer is stopped, and delivers its best map so far; 0: no limit.
  Seconds compute_budget{0};
  bool fresh = false;  // compute again even if the server has the result for this mesh and these options
};

// Largest residual of each kind of constraint, and largest entry of the scaled gradient, in radians (`wheel` is a
// logarithm).
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
  double linear_residual = 0;          // relative, of the current linear solve; 0 between solves
  Residual residual;                   // after newton_iteration steps
  double energy = 0;
  double step_length = 0;     // fraction of the last Newton step taken
  Seconds elapsed{0};         // since the worker began
  double tolerance = 0;       // the solve has converged when the largest residual is at most this
  double stage_fraction = 0;  // rough fraction of the stage that is done; 0 in stages that do not report it
};

// The outcome of the boundary control of a chart.
struct BoundaryReport {
  Boundary boundary = Boundary::kFree;  // as requested
  // The following members are for kConvex only.
  int vertices = 0;     // boundary vertices
  int active = 0;       // boundary vertices that are straight at the end
  int set_changes = 0;  // changes of the set of straight vertices
  bool settled = true;  // whether the set is right; otherwise warning BOUNDARY_NOT_SETTLED
};

struct ChartReport {
  std::int64_t triangles = 0;
  std::string method;  // "abf"
  Solver solver = Solver::kAuto;
  System system = System::kAuto;
  Preconditioner preconditioner = Preconditioner::kAuto;
  std::string preconditioner_note;  // how and why multigrid was simplified; empty if it was not
  Hessian hessian = Hessian::kConvex;
  bool converged = false;
  int newton_iterations = 0;
  std::int64_t linear_iterations = 0;
  Residual residual;
  int convexified_iterations = 0;  // Newton steps in which the Hessian of a face was made positive
  int indefinite_iterations = 0;   // Newton steps with an indefinite Hessian, solved by MINRES for any `solver`
  std::string stop_message;        // why Newton's method stopped: one sentence with numbers
  double abf_energy = 0;           // as Quality::abf_energy, but of the solved angles, before any rounding
  double barrier = 0;              // weight of the barrier that was kept (warning BARRIER_KEPT); 0: none
  BoundaryReport boundary;
  double stretch_l2 = 1;  // as Quality::stretch_l2, of this chart alone
  int chart = 0;          // number of the chart, 0-based
  // The largest residual at the start of Newton's method and after each step. Older servers leave it empty.
  std::vector<float> newton_residuals;
};

// Totals over all charts.
struct ChartTotals {
  int charts = 0;
  int not_converged = 0;
  std::int64_t newton_iterations = 0, linear_iterations = 0;
  Residual residual;  // the largest of each family
  double stretch_l2_max = 1;
  std::vector<float> newton_residuals;  // at the start and after each step: the largest residual of any chart
};

// One of the atlases, if there are several.
struct AtlasPart {
  int atlas = 0;  // number of the atlas (MeshView::WithFaceAtlas)
  std::int64_t triangles = 0;
  int charts = 0;
  int first_tile = 0;             // 0 is UDIM 1001
  int tiles = 1;                  // from first_tile to the last one used
  double texels_per_unit = 0;     // per length on the surface, at weight 1
  double packing_efficiency = 0;  // UV area of the triangles, divided by the area of the tiles
};

// The packed charts. Lengths are in texels of the requested texture.
struct Atlas {
  bool pack = true;
  int texture_size = 0;
  int padding = 0;
  int tiles = 1;               // up to the last one used
  double texels_per_unit = 0;  // per length on the surface, at weight 1, the least of all atlases; 0 without packing
  Effort effort = Effort::kNormal;
  AtlasLayout layout = AtlasLayout::kUdim;
  // With MeshView::WithFaceAtlas: an entry for each atlas number, ascending, at most 1024; otherwise empty.
  std::vector<AtlasPart> atlases = {};
  double padding_kept = 0;  // texels kept free between charts: `padding`, or less if there was no room
};

// What the server measured on the delivered UV; flips and overlaps are found by exact predicates.
struct Quality {
  std::int64_t flipped = 0;
  std::int64_t degenerate = 0;
  std::int64_t overlapping = 0;  // pairs of UV triangles whose interiors intersect
  double angle_error_mean_deg = 0, angle_error_max_deg = 0;
  double abf_energy = 0;
  double conformal_distortion_mean = 1, conformal_distortion_max = 1;
  double stretch_l2 = 1;
  double packing_efficiency = 0;
  double seam_length = 0;               // on the surface, divided by the square root of the surface's area
  double visible_seam_length = 0;       // the same, each edge weighted by its visibility, 0 to 1
  double seam_turn_deg = 0;             // mean angle between consecutive edges of seams; 0: straight
  std::optional<double> seam_symmetry;  // share of the seams whose mirror image is a seam; empty: no mirror plane found
};

// Wall-clock time of each stage. This client measures upload (encode, send, accept), download and total; the server
// measures the other stages.
struct StageTimes {
  Seconds upload{0}, queue{0}, decode{0}, charts{0}, solve{0}, layout{0}, pack{0}, verify{0}, encode{0}, download{0};
  Seconds total{0};
};

// A promise that was not kept, or something the caller should know; for reasons see planish.v1.Warning.
struct Warning {
  std::string reason;
  std::string message;
  std::map<std::string, std::string> metadata;  // element ids are the caller's own
};

struct Report {
  std::int64_t triangles = 0, vertices = 0;
  // One per chart, by ascending number. If there are more than 1024 charts, 1024 of them: charts that did not
  // converge are taken first, then charts with the largest stretch.
  std::vector<ChartReport> charts;
  ChartTotals chart_totals;
  Atlas atlas;
  Quality quality;
  StageTimes times;
  std::int64_t peak_memory_bytes = 0;
  int threads = 0;  // that the job could use: UnwrapOptions::threads, or less if the server allowed less
  std::vector<Warning> warnings;
};

struct Job {
  using Time = std::chrono::system_clock::time_point;

  std::string name;  // "jobs/..."
  JobState state = JobState::kUnspecified;
  std::map<std::string, std::string> labels;  // as given at its creation
  UnwrapOptions options;
  std::optional<Time> create_time, start_time, end_time;
  std::int64_t mesh_bytes = 0;
  int queue_position = 0;            // while QUEUED: the number of jobs that start before it
  std::optional<Progress> progress;  // while RUNNING or STOPPING
  std::optional<Error> error;        // when FAILED; ids in the order of the mesh as sent
  std::optional<Report> report;      // when SUCCEEDED
  Scheduling scheduling;
  int attempts = 0;                 // how often a worker began it; above 1 after a worker or the server died
  bool stop_requested = false;      // by StopJob, or because its compute budget is used up
  bool cancel_requested = false;    // by CancelJob, or because its caller disconnected
  std::string result_of;            // the job whose work it shares (same mesh and options); empty: it has its own work
  std::int64_t memory_bytes = 0;    // reserved while it runs
  std::optional<Time> expire_time;  // when SUCCEEDED: the latest time at which its UV are dropped
  std::string trace_id;             // of the W3C trace of the call that created it, 32 hex digits, as in server logs
};

// What a job would need, and how long it would wait.
struct JobEstimate {
  std::int64_t triangles = 0, vertices = 0;
  std::int64_t memory_bytes = 0;  // reserved while it runs
  Seconds run_time{0};            // rough time on one idle core
  Seconds queue_time{0};          // rough time until a job created now would start
  std::optional<Error> refusal;   // the error with which CreateJob would be refused now
};

// A change of a job: either `job` (after a change of state) or `progress` is set.
struct Event {
  std::int64_t sequence = 0;  // 1, 2, 3, ... within a job; may jump if events were lost or the server restarted
  Job::Time time;
  std::int64_t skipped = 0;  // number of events before this one that the server had dropped already
  std::optional<Job> job;
  std::optional<Progress> progress;
};

// UV of every corner, in the caller's order, as float or double according to UnwrapOptions::precision (with kAuto, the
// server chooses). Numbers 2 (3 f + k) and 2 (3 f + k) + 1 are (u, v) of corner k of triangle f.
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
  // All numbers as T, rounded if they are doubles and T is float.
  template <typename T>
  std::vector<T> As() const {
    return std::visit([](const auto& numbers) { return std::vector<T>(numbers.begin(), numbers.end()); }, numbers_);
  }
  // The numbers in their own type, for std::visit and std::get_if, so that nobody mistakes doubles for floats.
  const Numbers& numbers() const { return numbers_; }

 private:
  Numbers numbers_;
};

struct UnwrapResult {
  std::string job;       // name
  std::string trace_id;  // of the call's W3C trace, 32 hex digits, as in the server's log
  Uv uv;
  Report report;

  // Whether every chart converged and no UV triangle is flipped or degenerate. (Overlaps are warnings.)
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
  std::vector<SolverOptions> solvers;  // valid combinations of method, system and preconditioner
  int threads = 0;                     // maximal number for a job
  std::int64_t max_triangles = 0;
  std::int64_t memory_bytes = 0;        // limit of the reservations of all running jobs
  std::int64_t inline_mesh_bytes = 0;   // larger meshes are sent by a resumable upload; 0: no mesh is
  std::int64_t upload_chunk_bytes = 0;  // per message of an upload
  Seconds reattach_grace{0};            // how long the job of a disconnected caller waits for it
  bool durable = false;                 // whether jobs, meshes and results survive a restart of the server
  bool isolated_workers = false;        // whether jobs run in separate processes
};

}  // namespace planish::inline abi0
