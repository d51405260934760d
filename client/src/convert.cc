#include "client/src/convert.h"

#include <google/protobuf/util/time_util.h>

#include <bit>
#include <chrono>
#include <cstring>

#include "absl/strings/str_cat.h"
#include "client/src/errors.h"
#include "core/base/sha256.h"
#include "core/base/trace_context.h"

namespace planish {

using google::protobuf::util::TimeUtil;

Seconds SecondsFrom(const google::protobuf::Duration& duration) {
  return std::chrono::nanoseconds(TimeUtil::DurationToNanoseconds(duration));
}

google::protobuf::Duration ToProto(Seconds seconds) {
  return TimeUtil::MicrosecondsToDuration(std::chrono::duration_cast<std::chrono::microseconds>(seconds).count());
}

Job::Time TimeFrom(const google::protobuf::Timestamp& time) {
  return Job::Time(std::chrono::nanoseconds(TimeUtil::TimestampToNanoseconds(time)));
}

namespace {

static_assert(std::endian::native == std::endian::little, "UV travel little-endian");

// The enums below number their values like the proto's, from SOMETHING_AUTO = 1 on. A value that only a newer
// server knows becomes one that ToString calls "unknown"; one that is not there is `unspecified`.
template <typename Enum>
Enum EnumFromProto(int value, Enum unspecified = Enum()) {
  return value == 0 ? unspecified : static_cast<Enum>(value - 1);
}

template <typename ProtoEnum, typename Enum>
ProtoEnum EnumToProto(Enum value) {
  return static_cast<ProtoEnum>(static_cast<int>(value) + 1);
}

static_assert(static_cast<int>(Solver::kDirect) + 1 == v1::SOLVER_DIRECT);
static_assert(static_cast<int>(System::kReduced) + 1 == v1::SYSTEM_REDUCED);
static_assert(static_cast<int>(Preconditioner::kAmg) + 1 == v1::PRECONDITIONER_AMG);
static_assert(static_cast<int>(Hessian::kAuto) + 1 == v1::HESSIAN_AUTO);
static_assert(static_cast<int>(Boundary::kConvex) + 1 == v1::BOUNDARY_CONVEX);
static_assert(static_cast<int>(Precision::kDouble) + 1 == v1::PRECISION_DOUBLE);
static_assert(static_cast<int>(Effort::kBest) + 1 == v1::EFFORT_BEST);
static_assert(static_cast<int>(AtlasLayout::kStacked) + 1 == v1::ATLAS_LAYOUT_STACKED);
static_assert(static_cast<int>(Seams::kAuto) + 1 == v1::SEAMS_AUTO);
static_assert(static_cast<int>(Prefer::kTexture) + 1 == v1::PREFER_TEXTURE);
static_assert(static_cast<int>(Priority::kHigh) + 1 == v1::PRIORITY_HIGH);
static_assert(static_cast<int>(JobState::kExpired) == v1::JOB_STATE_EXPIRED);
static_assert(static_cast<int>(Stage::kDownload) == v1::STAGE_DOWNLOAD);

Scheduling FromProto(const v1::Scheduling& proto) {
  return {EnumFromProto(proto.priority(), Priority::kNormal), SecondsFrom(proto.timeout()),
          SecondsFrom(proto.compute_budget()), proto.fresh()};
}

UnwrapOptions FromProto(const v1::UnwrapOptions& proto) {
  UnwrapOptions options;
  options.seams = EnumFromProto(proto.seams(), Seams::kAuto);
  options.prefer = EnumFromProto(proto.prefer(), Prefer::kSeams);
  options.max_stretch = proto.max_stretch();
  options.hard_edge_degrees = proto.hard_edge_degrees();
  options.pack = proto.pack() != v1::PACK_OFF;
  options.texture_size = proto.texture_size();
  if (proto.has_padding()) options.padding = proto.padding();
  options.tiles = proto.tiles();
  options.effort = EnumFromProto(proto.effort(), Effort::kNormal);
  options.atlas_layout = EnumFromProto(proto.atlas_layout(), AtlasLayout::kUdim);
  options.boundary = EnumFromProto<Boundary>(proto.boundary());
  options.precision = EnumFromProto<Precision>(proto.precision());
  options.threads = proto.threads();
  options.solver = {EnumFromProto<Solver>(proto.solver()),
                    EnumFromProto<System>(proto.system()),
                    EnumFromProto<Preconditioner>(proto.preconditioner()),
                    EnumFromProto(proto.hessian(), Hessian::kAuto),
                    proto.tolerance(),
                    proto.max_newton_iterations()};
  return options;
}

Residual FromProto(const v1::Residual& proto) {
  return {proto.triangle(), proto.vertex(), proto.wheel(), proto.gradient()};
}

BoundaryReport FromProto(const v1::BoundaryReport& proto) {
  return {EnumFromProto<Boundary>(proto.boundary()), proto.vertices(), proto.active(), proto.set_changes(),
          proto.settled()};
}

ChartReport FromProto(const v1::ChartReport& proto) {
  return {.triangles = proto.triangles(),
          .method = proto.method(),
          .solver = EnumFromProto<Solver>(proto.solver()),
          .system = EnumFromProto<System>(proto.system()),
          .preconditioner = EnumFromProto<Preconditioner>(proto.preconditioner()),
          .preconditioner_note = proto.preconditioner_note(),
          .hessian = EnumFromProto<Hessian>(proto.hessian()),
          .converged = proto.converged(),
          .newton_iterations = proto.newton_iterations(),
          .linear_iterations = proto.linear_iterations(),
          .residual = FromProto(proto.residual()),
          .convexified_iterations = proto.convexified_iterations(),
          .indefinite_iterations = proto.indefinite_iterations(),
          .stop_message = proto.stop_message(),
          .abf_energy = proto.abf_energy(),
          .barrier = proto.barrier(),
          .boundary = proto.has_boundary() ? FromProto(proto.boundary()) : BoundaryReport(),
          .stretch_l2 = proto.stretch_l2(),
          .chart = proto.chart(),
          .newton_residuals = {proto.newton_residuals().begin(), proto.newton_residuals().end()}};
}

ChartTotals FromProto(const v1::ChartTotals& proto) {
  return {proto.charts(),
          proto.not_converged(),
          proto.newton_iterations(),
          proto.linear_iterations(),
          FromProto(proto.residual()),
          proto.stretch_l2_max(),
          {proto.newton_residuals().begin(), proto.newton_residuals().end()}};
}

Atlas FromProto(const v1::Atlas& proto) {
  Atlas atlas = {proto.pack() != v1::PACK_OFF,
                 proto.texture_size(),
                 proto.padding(),
                 proto.tiles(),
                 proto.texels_per_unit(),
                 EnumFromProto(proto.effort(), Effort::kNormal),
                 EnumFromProto(proto.layout(), AtlasLayout::kUdim),
                 {},
                 proto.padding_kept()};
  for (const v1::AtlasPart& part : proto.atlases()) {
    atlas.atlases.push_back({part.atlas(), part.triangles(), part.charts(), part.first_tile(), part.tiles(),
                             part.texels_per_unit(), part.packing_efficiency()});
  }
  return atlas;
}

Quality FromProto(const v1::Quality& proto) {
  return {.flipped = proto.flipped(),
          .degenerate = proto.degenerate(),
          .overlapping = proto.overlapping(),
          .angle_error_mean_deg = proto.angle_error_mean_deg(),
          .angle_error_max_deg = proto.angle_error_max_deg(),
          .abf_energy = proto.abf_energy(),
          .conformal_distortion_mean = proto.conformal_distortion_mean(),
          .conformal_distortion_max = proto.conformal_distortion_max(),
          .stretch_l2 = proto.stretch_l2(),
          .packing_efficiency = proto.packing_efficiency(),
          .seam_length = proto.seam_length(),
          .visible_seam_length = proto.visible_seam_length(),
          .seam_turn_deg = proto.seam_turn_deg(),
          .seam_symmetry = proto.has_seam_symmetry() ? std::optional(proto.seam_symmetry()) : std::nullopt};
}

Progress FromProto(const v1::Progress& proto) {
  return {.stage = static_cast<Stage>(proto.stage()),
          .chart = proto.chart(),
          .chart_count = proto.chart_count(),
          .newton_iteration = proto.newton_iteration(),
          .linear_iterations = proto.linear_iterations(),
          .linear_residual = proto.linear_residual(),
          .residual = FromProto(proto.residual()),
          .energy = proto.energy(),
          .step_length = proto.step_length(),
          .elapsed = SecondsFrom(proto.elapsed()),
          .tolerance = proto.tolerance(),
          .stage_fraction = proto.stage_fraction()};
}

template <typename Number>
std::vector<Number> Numbers(const std::string& bytes) {
  std::vector<Number> numbers(bytes.size() / sizeof(Number));
  std::memcpy(numbers.data(), bytes.data(), bytes.size());
  return numbers;
}

StageTimes FromProto(const v1::StageTimes& proto) {
  return {.queue = SecondsFrom(proto.queue()),
          .decode = SecondsFrom(proto.decode()),
          .charts = SecondsFrom(proto.charts()),
          .solve = SecondsFrom(proto.solve()),
          .layout = SecondsFrom(proto.layout()),
          .pack = SecondsFrom(proto.pack()),
          .verify = SecondsFrom(proto.verify()),
          .encode = SecondsFrom(proto.encode())};
}

}  // namespace

v1::UnwrapOptions ToProto(const UnwrapOptions& options) {
  v1::UnwrapOptions proto;
  proto.set_seams(EnumToProto<v1::Seams>(options.seams));
  proto.set_solver(EnumToProto<v1::Solver>(options.solver.method));
  proto.set_system(EnumToProto<v1::System>(options.solver.system));
  proto.set_preconditioner(EnumToProto<v1::Preconditioner>(options.solver.preconditioner));
  proto.set_hessian(EnumToProto<v1::Hessian>(options.solver.hessian));
  proto.set_boundary(EnumToProto<v1::Boundary>(options.boundary));
  proto.set_precision(EnumToProto<v1::Precision>(options.precision));
  proto.set_tolerance(options.solver.tolerance);
  proto.set_max_newton_iterations(options.solver.max_newton_iterations);
  proto.set_threads(options.threads);
  proto.set_prefer(EnumToProto<v1::Prefer>(options.prefer));
  proto.set_max_stretch(options.max_stretch);
  proto.set_hard_edge_degrees(options.hard_edge_degrees);
  proto.set_pack(options.pack ? v1::PACK_ON : v1::PACK_OFF);
  proto.set_texture_size(options.texture_size);
  if (options.padding) proto.set_padding(*options.padding);
  proto.set_tiles(options.tiles);
  proto.set_effort(EnumToProto<v1::Effort>(options.effort));
  proto.set_atlas_layout(EnumToProto<v1::AtlasLayout>(options.atlas_layout));
  return proto;
}

v1::Scheduling ToProto(const Scheduling& scheduling) {
  v1::Scheduling proto;
  proto.set_priority(EnumToProto<v1::Priority>(scheduling.priority));
  if (scheduling.timeout > Seconds(0)) *proto.mutable_timeout() = ToProto(scheduling.timeout);
  if (scheduling.compute_budget > Seconds(0)) *proto.mutable_compute_budget() = ToProto(scheduling.compute_budget);
  proto.set_fresh(scheduling.fresh);
  return proto;
}

Report FromProto(const v1::Report& proto, const ids::Renumbering& renumbering) {
  Report report;
  report.triangles = proto.input().triangles();
  report.vertices = proto.input().vertices();
  for (const v1::ChartReport& chart : proto.charts()) report.charts.push_back(FromProto(chart));
  report.chart_totals = FromProto(proto.chart_totals());
  report.atlas = FromProto(proto.atlas());
  report.quality = FromProto(proto.quality());
  report.times = FromProto(proto.times());
  report.peak_memory_bytes = proto.peak_memory_bytes();
  report.threads = proto.threads();
  for (const v1::Warning& warning : proto.warnings()) {
    report.warnings.push_back(
        {warning.reason(), warning.message(),
         ids::RenumberMetadata({warning.metadata().begin(), warning.metadata().end()}, renumbering)});
  }
  return report;
}

Job FromProto(const v1::Job& proto, const ids::Renumbering& renumbering) {
  Job job;
  job.name = proto.name();
  job.state = static_cast<JobState>(proto.state());
  job.labels = {proto.labels().begin(), proto.labels().end()};
  job.options = FromProto(proto.options());
  if (proto.has_create_time()) job.create_time = TimeFrom(proto.create_time());
  if (proto.has_start_time()) job.start_time = TimeFrom(proto.start_time());
  if (proto.has_end_time()) job.end_time = TimeFrom(proto.end_time());
  job.mesh_bytes = proto.mesh_bytes();
  job.queue_position = proto.queue_position();
  if (proto.has_progress()) job.progress = FromProto(proto.progress());
  if (proto.has_error()) job.error = Renumbered(ErrorFrom(proto.error()), renumbering).set_job(proto.name());
  if (proto.has_report()) job.report = FromProto(proto.report(), renumbering);
  job.scheduling = FromProto(proto.scheduling());
  job.attempts = proto.attempts();
  job.stop_requested = proto.stop_requested();
  job.cancel_requested = proto.cancel_requested();
  job.result_of = proto.result_of();
  job.memory_bytes = proto.memory_bytes();
  if (proto.has_expire_time()) job.expire_time = TimeFrom(proto.expire_time());
  job.trace_id = std::string(TraceIdOf(proto.traceparent()));
  return job;
}

Event FromProto(const v1::JobEvent& proto, const ids::Renumbering& renumbering) {
  Event event;
  event.sequence = proto.sequence();
  event.time = TimeFrom(proto.time());
  event.skipped = proto.skipped();
  if (proto.has_job()) event.job = FromProto(proto.job(), renumbering);
  if (proto.has_progress()) event.progress = FromProto(proto.progress());
  return event;
}

JobEstimate FromProto(const v1::JobEstimate& proto) {
  JobEstimate estimate;
  estimate.triangles = proto.size().triangles();
  estimate.vertices = proto.size().vertices();
  estimate.memory_bytes = proto.memory_bytes();
  estimate.run_time = SecondsFrom(proto.run_time());
  estimate.queue_time = SecondsFrom(proto.queue_time());
  if (proto.has_refusal()) estimate.refusal = ErrorFrom(proto.refusal());
  return estimate;
}

Capabilities FromProto(const v1::Capabilities& proto) {
  Capabilities capabilities;
  capabilities.version = proto.version();
  capabilities.max_mesh_bytes = proto.max_mesh_bytes();
  capabilities.workers = proto.workers();
  capabilities.queue_capacity = proto.queue_capacity();
  capabilities.threads = proto.threads();
  capabilities.max_triangles = proto.max_triangles();
  capabilities.memory_bytes = proto.memory_bytes();
  capabilities.inline_mesh_bytes = proto.inline_mesh_bytes();
  capabilities.upload_chunk_bytes = proto.upload_chunk_bytes();
  capabilities.reattach_grace = SecondsFrom(proto.reattach_grace());
  capabilities.durable = proto.durable();
  capabilities.isolated_workers = proto.isolated_workers();
  for (const int seams : proto.seams()) capabilities.seams.push_back(EnumFromProto<Seams>(seams));
  for (const v1::SolverCombination& solver : proto.solvers()) {
    capabilities.solvers.push_back({EnumFromProto<Solver>(solver.solver()), EnumFromProto<System>(solver.system()),
                                    EnumFromProto<Preconditioner>(solver.preconditioner())});
  }
  return capabilities;
}

Uv ParseUv(const v1::UvDescription& description, const std::string& bytes, const PackedMesh& mesh) {
  if (description.mesh_sha256() != mesh.sha256) {
    throw Error(ErrorCode::kFailedPrecondition, "MESH_MISMATCH",
                "the job was made from another mesh (the SHA-256 of the mesh bytes differs): give the same file");
  }
  const bool is_double = description.precision() == v1::PRECISION_DOUBLE;
  const std::size_t expected = static_cast<std::size_t>(6 * mesh.triangles) * (is_double ? 8 : 4);
  std::string fault;
  if (description.corner_count() != 3 * mesh.triangles) {
    fault =
        std::to_string(description.corner_count()) + " corners for " + std::to_string(mesh.triangles) + " triangles";
  } else if (bytes.size() != expected) {
    fault = absl::StrCat(bytes.size(), " bytes instead of ", expected);
  } else if (Sha256(bytes) != description.uv_sha256()) {
    fault = "their SHA-256 differs";
  }
  if (!fault.empty()) {
    throw Error(ErrorCode::kDataLoss, "UV_CORRUPT", "the UV that arrived are not the ones the server made: " + fault);
  }
  return is_double ? Uv(Numbers<double>(bytes)) : Uv(Numbers<float>(bytes));
}

}  // namespace planish
