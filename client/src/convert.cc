#include "client/src/convert.h"

#include <cmath>

#include "client/src/errors.h"
#include "core/base/trace_context.h"

namespace planish {
inline namespace abi0 {

double SecondsFrom(const google::protobuf::Duration& duration) {
  return static_cast<double>(duration.seconds()) + 1e-9 * duration.nanos();
}

void SetSeconds(double seconds, google::protobuf::Duration* duration) {
  const double whole = std::floor(seconds);
  duration->set_seconds(static_cast<std::int64_t>(whole));
  duration->set_nanos(static_cast<std::int32_t>((seconds - whole) * 1e9));
}

namespace {

// The enums below number their values like the proto's, from SOMETHING_AUTO = 1 on. A value that only a newer
// server knows becomes one that ToString calls "unknown".
template <typename Enum>
Enum EnumFromProto(int value) {
  return static_cast<Enum>(value == 0 ? 0 : value - 1);
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
static_assert(static_cast<int>(Seams::kNone) + 1 == v1::SEAMS_NONE);
static_assert(static_cast<int>(Seams::kAuto) + 1 == v1::SEAMS_AUTO);
static_assert(static_cast<int>(Priority::kHigh) + 1 == v1::PRIORITY_HIGH);
static_assert(static_cast<int>(JobState::kExpired) == v1::JOB_STATE_EXPIRED);
static_assert(static_cast<int>(Stage::kDownload) == v1::STAGE_DOWNLOAD);

Job::Time TimeFrom(const google::protobuf::Timestamp& time) {
  return Job::Time(std::chrono::duration_cast<Job::Time::duration>(std::chrono::seconds(time.seconds()) +
                                                                   std::chrono::nanoseconds(time.nanos())));
}

Scheduling FromProto(const v1::Scheduling& proto) {
  Scheduling scheduling;
  if (proto.priority() != v1::PRIORITY_UNSPECIFIED) scheduling.priority = EnumFromProto<Priority>(proto.priority());
  scheduling.timeout_seconds = SecondsFrom(proto.timeout());
  scheduling.compute_budget_seconds = SecondsFrom(proto.compute_budget());
  scheduling.fresh = proto.fresh();
  return scheduling;
}

JobError FromProto(const google::rpc::Status& proto, const ids::Renumbering& renumbering) {
  const Error error = Renumbered(ErrorFrom(proto), renumbering);
  return {ToString(error.code()), error.reason(), error.what(), error.metadata()};
}

UnwrapOptions FromProto(const v1::UnwrapOptions& proto) {
  UnwrapOptions options;
  options.seams = proto.seams() == v1::SEAMS_UNSPECIFIED ? Seams::kAuto : EnumFromProto<Seams>(proto.seams());
  options.solver = EnumFromProto<Solver>(proto.solver());
  options.system = EnumFromProto<System>(proto.system());
  options.preconditioner = EnumFromProto<Preconditioner>(proto.preconditioner());
  options.hessian =
      proto.hessian() == v1::HESSIAN_UNSPECIFIED ? Hessian::kAuto : EnumFromProto<Hessian>(proto.hessian());
  options.boundary = EnumFromProto<Boundary>(proto.boundary());
  options.precision = EnumFromProto<Precision>(proto.precision());
  options.tolerance = proto.tolerance();
  options.max_newton_iterations = proto.max_newton_iterations();
  options.threads = proto.threads();
  options.max_stretch = proto.max_stretch();
  options.hard_edge_degrees = proto.hard_edge_degrees();
  options.pack = proto.pack() != v1::PACK_OFF;
  options.texture_size = proto.texture_size();
  if (proto.has_padding()) options.padding = proto.padding();
  options.tiles = proto.tiles();
  if (proto.effort() != v1::EFFORT_UNSPECIFIED) options.effort = EnumFromProto<Effort>(proto.effort());
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
  ChartReport chart;
  chart.triangles = proto.triangles();
  chart.method = proto.method();
  chart.solver = EnumFromProto<Solver>(proto.solver());
  chart.system = EnumFromProto<System>(proto.system());
  chart.preconditioner = EnumFromProto<Preconditioner>(proto.preconditioner());
  chart.preconditioner_note = proto.preconditioner_note();
  chart.hessian = EnumFromProto<Hessian>(proto.hessian());
  chart.converged = proto.converged();
  chart.newton_iterations = proto.newton_iterations();
  chart.linear_iterations = proto.linear_iterations();
  chart.residual = FromProto(proto.residual());
  chart.convexified_iterations = proto.convexified_iterations();
  chart.stop_message = proto.stop_message();
  chart.abf_energy = proto.abf_energy();
  chart.indefinite_iterations = proto.indefinite_iterations();
  chart.barrier = proto.barrier();
  if (proto.has_boundary()) chart.boundary = FromProto(proto.boundary());  // older servers know no boundary control
  chart.stretch_l2 = proto.stretch_l2();
  chart.chart = proto.chart();
  chart.newton_residuals.assign(proto.newton_residuals().begin(), proto.newton_residuals().end());
  return chart;
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
  return {proto.pack() != v1::PACK_OFF,
          proto.texture_size(),
          proto.padding(),
          proto.tiles(),
          proto.texels_per_unit(),
          proto.effort() == v1::EFFORT_UNSPECIFIED ? Effort::kNormal : EnumFromProto<Effort>(proto.effort())};
}

Quality FromProto(const v1::Quality& proto) {
  Quality quality;
  quality.flipped = proto.flipped();
  quality.degenerate = proto.degenerate();
  quality.overlapping = proto.overlapping();
  quality.angle_error_mean_deg = proto.angle_error_mean_deg();
  quality.angle_error_max_deg = proto.angle_error_max_deg();
  quality.abf_energy = proto.abf_energy();
  quality.conformal_distortion_mean = proto.conformal_distortion_mean();
  quality.conformal_distortion_max = proto.conformal_distortion_max();
  quality.stretch_l2 = proto.stretch_l2();
  quality.packing_efficiency = proto.packing_efficiency();
  quality.seam_length = proto.seam_length();
  return quality;
}

StageSeconds FromProto(const v1::StageTimes& proto) {
  StageSeconds seconds;
  seconds.queue = SecondsFrom(proto.queue());
  seconds.decode = SecondsFrom(proto.decode());
  seconds.charts = SecondsFrom(proto.charts());
  seconds.solve = SecondsFrom(proto.solve());
  seconds.layout = SecondsFrom(proto.layout());
  seconds.pack = SecondsFrom(proto.pack());
  seconds.verify = SecondsFrom(proto.verify());
  seconds.encode = SecondsFrom(proto.encode());
  return seconds;
}

}  // namespace

v1::UnwrapOptions ToProto(const UnwrapOptions& options) {
  v1::UnwrapOptions proto;
  proto.set_seams(EnumToProto<v1::Seams>(options.seams));
  proto.set_solver(EnumToProto<v1::Solver>(options.solver));
  proto.set_system(EnumToProto<v1::System>(options.system));
  proto.set_preconditioner(EnumToProto<v1::Preconditioner>(options.preconditioner));
  proto.set_hessian(EnumToProto<v1::Hessian>(options.hessian));
  proto.set_boundary(EnumToProto<v1::Boundary>(options.boundary));
  proto.set_precision(EnumToProto<v1::Precision>(options.precision));
  proto.set_tolerance(options.tolerance);
  proto.set_max_newton_iterations(options.max_newton_iterations);
  proto.set_threads(options.threads);
  proto.set_max_stretch(options.max_stretch);
  proto.set_hard_edge_degrees(options.hard_edge_degrees);
  proto.set_pack(options.pack ? v1::PACK_ON : v1::PACK_OFF);
  proto.set_texture_size(options.texture_size);
  if (options.padding) proto.set_padding(*options.padding);
  proto.set_tiles(options.tiles);
  proto.set_effort(EnumToProto<v1::Effort>(options.effort));
  return proto;
}

v1::Scheduling ToProto(const Scheduling& scheduling) {
  v1::Scheduling proto;
  proto.set_priority(EnumToProto<v1::Priority>(scheduling.priority));
  if (scheduling.timeout_seconds > 0) SetSeconds(scheduling.timeout_seconds, proto.mutable_timeout());
  if (scheduling.compute_budget_seconds > 0) {
    SetSeconds(scheduling.compute_budget_seconds, proto.mutable_compute_budget());
  }
  proto.set_fresh(scheduling.fresh);
  return proto;
}

Progress FromProto(const v1::Progress& proto) {
  Progress progress;
  progress.stage = static_cast<Stage>(proto.stage());
  progress.chart = proto.chart();
  progress.chart_count = proto.chart_count();
  progress.newton_iteration = proto.newton_iteration();
  progress.linear_iterations = proto.linear_iterations();
  progress.linear_residual = proto.linear_residual();
  progress.residual = FromProto(proto.residual());
  progress.energy = proto.energy();
  progress.step_length = proto.step_length();
  progress.elapsed_seconds = SecondsFrom(proto.elapsed());
  progress.tolerance = proto.tolerance();
  return progress;
}

Report FromProto(const v1::Report& proto, const ids::Renumbering& renumbering) {
  Report report;
  report.triangles = proto.input().triangles();
  report.vertices = proto.input().vertices();
  for (const v1::ChartReport& chart : proto.charts()) report.charts.push_back(FromProto(chart));
  report.chart_totals = FromProto(proto.chart_totals());
  report.atlas = FromProto(proto.atlas());
  report.quality = FromProto(proto.quality());
  report.seconds = FromProto(proto.times());
  report.peak_memory_bytes = proto.peak_memory_bytes();
  report.threads = proto.threads();
  for (const v1::Warning& warning : proto.warnings()) {
    report.warnings.push_back(
        {warning.reason(), ids::RenumberMessage(warning.message(), renumbering),
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
  if (proto.has_error()) job.error = FromProto(proto.error(), renumbering);
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
  estimate.run_seconds = SecondsFrom(proto.run_time());
  estimate.queue_seconds = SecondsFrom(proto.queue_time());
  if (proto.has_refusal()) estimate.refusal = FromProto(proto.refusal(), {});
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
  capabilities.reattach_grace_seconds = SecondsFrom(proto.reattach_grace());
  capabilities.durable = proto.durable();
  capabilities.isolated_workers = proto.isolated_workers();
  for (const int seams : proto.seams()) capabilities.seams.push_back(EnumFromProto<Seams>(seams));
  for (const v1::SolverCombination& solver : proto.solvers()) {
    capabilities.solvers.push_back({EnumFromProto<Solver>(solver.solver()), EnumFromProto<System>(solver.system()),
                                    EnumFromProto<Preconditioner>(solver.preconditioner())});
  }
  return capabilities;
}

}  // namespace abi0
}  // namespace planish
