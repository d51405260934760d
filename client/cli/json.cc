#include "client/cli/json.h"

#include <cmath>
#include <cstdio>
#include <ctime>

#include "client/cli/text.h"

namespace planish::cli {
namespace {

// RFC 3339 with microseconds, UTC.
std::string TimeText(Job::Time time) {
  const auto since = std::chrono::duration_cast<std::chrono::microseconds>(time.time_since_epoch()).count();
  const std::time_t seconds = static_cast<std::time_t>(since / 1000000);
  std::tm parts = {};
  gmtime_r(&seconds, &parts);
  char date[32], text[48];
  std::strftime(date, sizeof date, "%Y-%m-%dT%H:%M:%S", &parts);
  std::snprintf(text, sizeof text, "%s.%06dZ", date, static_cast<int>(since % 1000000));
  return text;
}

Json ResidualJson(const Residual& residual) {
  return {{"triangle", residual.triangle},
          {"vertex", residual.vertex},
          {"wheel", residual.wheel},
          {"gradient", residual.gradient}};
}

Json ProgressJson(const Progress& progress) {
  return {{"stage", ToString(progress.stage)},
          {"chart", progress.chart},
          {"chart_count", progress.chart_count},
          {"newton_iteration", progress.newton_iteration},
          {"linear_iterations", progress.linear_iterations},
          {"linear_residual", progress.linear_residual},
          {"residual", ResidualJson(progress.residual)},
          {"energy", progress.energy},
          {"step_length", progress.step_length},
          {"elapsed_seconds", progress.elapsed.count()},
          {"tolerance", progress.tolerance}};
}

Json BoundaryJson(const BoundaryReport& boundary) {
  return {{"type", ToString(boundary.boundary)},
          {"vertices", boundary.vertices},
          {"active", boundary.active},
          {"set_changes", boundary.set_changes},
          {"settled", boundary.settled}};
}

// Four digits are enough to draw.
Json ResidualsJson(const std::vector<float>& residuals) {
  Json json = Json::array();
  for (const float residual : residuals) json.push_back(Json::parse(Significant(residual, 4)));
  return json;
}

Json ChartsJson(const std::vector<ChartReport>& charts) {
  Json json = Json::array();
  for (const ChartReport& chart : charts) {
    json.push_back({{"chart", chart.chart},
                    {"triangles", chart.triangles},
                    {"method", chart.method},
                    {"solver", ToString(chart.solver)},
                    {"system", ToString(chart.system)},
                    {"preconditioner", ToString(chart.preconditioner)},
                    {"preconditioner_note", chart.preconditioner_note},
                    {"hessian", ToString(chart.hessian)},
                    {"converged", chart.converged},
                    {"newton_iterations", chart.newton_iterations},
                    {"linear_iterations", chart.linear_iterations},
                    {"convexified_iterations", chart.convexified_iterations},
                    {"indefinite_iterations", chart.indefinite_iterations},
                    {"residual", ResidualJson(chart.residual)},
                    {"newton_residuals", ResidualsJson(chart.newton_residuals)},
                    {"stop_message", chart.stop_message},
                    {"abf_energy", chart.abf_energy},
                    {"barrier", chart.barrier},
                    {"stretch_l2", chart.stretch_l2},
                    {"boundary", BoundaryJson(chart.boundary)}});
  }
  return json;
}

Json TotalsJson(const ChartTotals& totals) {
  return {{"charts", totals.charts},
          {"not_converged", totals.not_converged},
          {"newton_iterations", totals.newton_iterations},
          {"linear_iterations", totals.linear_iterations},
          {"residual", ResidualJson(totals.residual)},
          {"newton_residuals", ResidualsJson(totals.newton_residuals)},
          {"stretch_l2_max", totals.stretch_l2_max}};
}

Json AtlasJson(const Atlas& atlas) {
  return {{"pack", atlas.pack ? "on" : "off"}, {"texture_size", atlas.texture_size},
          {"padding", atlas.padding},          {"tiles", atlas.tiles},
          {"effort", ToString(atlas.effort)},  {"texels_per_unit", atlas.texels_per_unit}};
}

Json QualityJson(const Quality& quality) {
  return {{"flipped", quality.flipped},
          {"degenerate", quality.degenerate},
          {"overlapping", quality.overlapping},
          {"angle_error_mean_deg", quality.angle_error_mean_deg},
          {"angle_error_max_deg", quality.angle_error_max_deg},
          {"abf_energy", quality.abf_energy},
          {"conformal_distortion_mean", quality.conformal_distortion_mean},
          {"conformal_distortion_max", quality.conformal_distortion_max},
          {"stretch_l2", quality.stretch_l2},
          {"packing_efficiency", quality.packing_efficiency},
          {"seam_length", quality.seam_length}};
}

Json SecondsJson(const StageTimes& times) {
  return {{"upload", times.upload.count()},     {"queue", times.queue.count()},   {"decode", times.decode.count()},
          {"charts", times.charts.count()},     {"solve", times.solve.count()},   {"layout", times.layout.count()},
          {"pack", times.pack.count()},         {"verify", times.verify.count()}, {"encode", times.encode.count()},
          {"download", times.download.count()}, {"total", times.total.count()}};
}

Json WarningsJson(const std::vector<Warning>& warnings) {
  Json json = Json::array();
  for (const Warning& warning : warnings) {
    Json entry = {{"reason", warning.reason}, {"message", warning.message}};
    if (!warning.metadata.empty()) entry["metadata"] = warning.metadata;
    json.push_back(entry);
  }
  return json;
}

void AddReport(const Report& report, Json& json) {
  json["input"] = {{"triangles", report.triangles}, {"vertices", report.vertices}};
  json["charts"] = ChartsJson(report.charts);
  json["chart_totals"] = TotalsJson(report.chart_totals);
  json["atlas"] = AtlasJson(report.atlas);
  json["quality"] = QualityJson(report.quality);
  json["seconds"] = SecondsJson(report.times);
  json["peak_memory_bytes"] = report.peak_memory_bytes;
  json["threads"] = report.threads;
  json["warnings"] = WarningsJson(report.warnings);
}

Json ErrorJson(const Error& error) {
  return {{"code", ToString(error.code())},
          {"reason", error.reason()},
          {"message", error.what()},
          {"metadata", error.metadata()}};
}

}  // namespace

std::string ToLine(const Json& json) {
  return json.dump(-1, ' ', false, Json::error_handler_t::replace);
}

std::string ToText(const Json& json) {
  return json.dump(2, ' ', false, Json::error_handler_t::replace) + "\n";
}

std::string ValidUtf8(const std::string& text) {
  return Json::parse(ToLine(Json(text))).get<std::string>();
}

Json ToJson(const Job& job) {
  Json json = {{"job", job.name}, {"state", ToString(job.state)}, {"labels", Json(job.labels)}};
  if (!job.trace_id.empty()) json["trace_id"] = job.trace_id;
  if (job.create_time) json["create_time"] = TimeText(*job.create_time);
  if (job.start_time) json["start_time"] = TimeText(*job.start_time);
  if (job.end_time) json["end_time"] = TimeText(*job.end_time);
  json["mesh_bytes"] = job.mesh_bytes;
  if (job.state == JobState::kQueued) json["queue_position"] = job.queue_position;
  if (job.progress) json["progress"] = ProgressJson(*job.progress);
  json["scheduling"] = {{"priority", ToString(job.scheduling.priority)},
                        {"deadline_seconds", job.scheduling.timeout.count()},
                        {"budget_seconds", job.scheduling.compute_budget.count()},
                        {"fresh", job.scheduling.fresh}};
  json["attempts"] = job.attempts;
  json["stop_requested"] = job.stop_requested;
  json["cancel_requested"] = job.cancel_requested;
  json["memory_bytes"] = job.memory_bytes;
  if (!job.result_of.empty()) json["result_of"] = job.result_of;
  if (job.expire_time) json["expire_time"] = TimeText(*job.expire_time);
  if (job.error) json["error"] = ErrorJson(*job.error);
  if (job.report) AddReport(*job.report, json);
  return json;
}

Json ToJson(const Event& event) {
  Json json = {{"sequence", event.sequence}, {"time", TimeText(event.time)}, {"skipped", event.skipped}};
  if (event.job) json["job"] = ToJson(*event.job);
  if (event.progress) json["progress"] = ProgressJson(*event.progress);
  return json;
}

Json ToJson(const JobEstimate& estimate) {
  Json json = {{"triangles", estimate.triangles},
               {"vertices", estimate.vertices},
               {"memory_bytes", estimate.memory_bytes},
               {"run_seconds", estimate.run_time.count()},
               {"queue_seconds", estimate.queue_time.count()},
               {"accepted", !estimate.refusal.has_value()}};
  if (estimate.refusal) json["refusal"] = ErrorJson(*estimate.refusal);
  return json;
}

Json ToJson(const Capabilities& capabilities) {
  Json solvers = Json::array();
  for (const SolverCombination& combination : capabilities.solvers) {
    solvers.push_back({{"solver", ToString(combination.solver)},
                       {"system", ToString(combination.system)},
                       {"preconditioner", ToString(combination.preconditioner)}});
  }
  Json seams = Json::array();
  for (const Seams policy : capabilities.seams) seams.push_back(ToString(policy));
  return {{"version", capabilities.version},
          {"max_mesh_bytes", capabilities.max_mesh_bytes},
          {"workers", capabilities.workers},
          {"threads", capabilities.threads},
          {"max_triangles", capabilities.max_triangles},
          {"memory_bytes", capabilities.memory_bytes},
          {"inline_mesh_bytes", capabilities.inline_mesh_bytes},
          {"upload_chunk_bytes", capabilities.upload_chunk_bytes},
          {"reattach_grace_seconds", capabilities.reattach_grace.count()},
          {"durable", capabilities.durable},
          {"isolated_workers", capabilities.isolated_workers},
          {"queue_capacity", capabilities.queue_capacity},
          {"seams", seams},
          {"solvers", solvers}};
}

Json ReportJson(const UnwrapResult& result, const Report& report, const std::string& output) {
  Json json = {{"job", result.job}, {"state", ToString(JobState::kSucceeded)}};
  AddReport(report, json);
  json["trace_id"] = result.trace_id;
  json["precision"] = ToString(result.uv.precision());
  if (!output.empty()) json["output"] = output;
  return json;
}

Failure FailureOf(const Error& error) {
  Failure failure;
  failure.job = error.job();
  failure.trace_id = error.trace_id();
  failure.state = error.code() == ErrorCode::kCancelled ? JobState::kCancelled : JobState::kFailed;
  failure.code = ToString(error.code());
  failure.reason = error.reason();
  failure.message = error.what();
  failure.metadata = error.metadata();
  return failure;
}

Json ReportJson(const Failure& failure) {
  Json json = {{"job", failure.job},
               {"state", ToString(failure.state)},
               {"error",
                {{"code", failure.code},
                 {"reason", failure.reason},
                 {"message", failure.message},
                 {"metadata", failure.metadata}}},
               {"input", {{"triangles", failure.triangles}, {"vertices", failure.vertices}}},
               {"charts", Json::array()},
               {"seconds", {{"total", failure.total_seconds}}},
               {"warnings", Json::array()}};
  if (!failure.trace_id.empty()) json["trace_id"] = failure.trace_id;
  return json;
}

}  // namespace planish::cli
