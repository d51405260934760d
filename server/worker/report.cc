#include "server/worker/report.h"

#include <sys/resource.h>

#include <bit>
#include <cstring>

#include "server/worker/options.h"

namespace planish {
namespace {

static_assert(std::endian::native == std::endian::little, "UV bytes are copied as they lie in memory");

v1::Stage ToProto(UnwrapStage stage) {
  switch (stage) {
    case UnwrapStage::kCharts:
      return v1::STAGE_CHARTS;
    case UnwrapStage::kSolve:
      return v1::STAGE_SOLVE;
    case UnwrapStage::kLayout:
      return v1::STAGE_LAYOUT;
    case UnwrapStage::kPack:
      return v1::STAGE_PACK;
    case UnwrapStage::kVerify:
      return v1::STAGE_VERIFY;
  }
  return v1::STAGE_UNSPECIFIED;
}

v1::Residual ToProto(const Residual& residual) {
  v1::Residual proto;
  proto.set_triangle(residual.triangle);
  proto.set_vertex(residual.vertex);
  proto.set_wheel(residual.wheel);
  proto.set_gradient(residual.gradient);
  return proto;
}

v1::BoundaryReport ToProto(const BoundaryReport& boundary) {
  v1::BoundaryReport proto;
  proto.set_boundary(ToProto(boundary.type));
  proto.set_vertices(boundary.vertices);
  proto.set_active(boundary.active);
  proto.set_set_changes(boundary.set_changes);
  proto.set_settled(boundary.settled);
  return proto;
}

v1::ChartReport ToProto(const ChartReport& chart) {
  const FlattenSummary& flatten = chart.flatten;
  v1::ChartReport proto;
  proto.set_triangles(chart.triangles);
  proto.set_method("abf");
  proto.set_solver(ToProto(flatten.solver));
  proto.set_system(ToProto(flatten.system));
  proto.set_preconditioner(ToProto(flatten.preconditioner));
  proto.set_hessian(ToProto(flatten.hessian));
  proto.set_converged(flatten.converged);
  proto.set_newton_iterations(flatten.newton_iterations);
  proto.set_linear_iterations(flatten.linear_iterations);
  *proto.mutable_residual() = ToProto(flatten.residual);
  proto.set_convexified_iterations(flatten.convexified_iterations);
  proto.set_stop_message(flatten.stop_message);
  proto.set_abf_energy(flatten.energy / (3.0 * static_cast<double>(chart.triangles)));
  proto.set_indefinite_iterations(flatten.indefinite_iterations);
  proto.set_barrier(flatten.barrier);
  *proto.mutable_boundary() = ToProto(flatten.boundary);
  return proto;
}

v1::Quality ToProto(const Quality& quality) {
  v1::Quality proto;
  proto.set_flipped(quality.flipped);
  proto.set_degenerate(quality.degenerate);
  proto.set_overlapping(quality.overlapping);
  proto.set_angle_error_mean_deg(quality.angle_error_mean_deg);
  proto.set_angle_error_max_deg(quality.angle_error_max_deg);
  proto.set_abf_energy(quality.abf_energy);
  proto.set_conformal_distortion_mean(quality.conformal_distortion_mean);
  proto.set_conformal_distortion_max(quality.conformal_distortion_max);
  proto.set_stretch_l2(quality.stretch_l2);
  proto.set_packing_efficiency(quality.packing_efficiency);
  return proto;
}

v1::Warning ToProto(const UnwrapWarning& warning) {
  v1::Warning proto;
  proto.set_reason(warning.reason);
  proto.set_message(warning.message);
  proto.mutable_metadata()->insert(warning.metadata.begin(), warning.metadata.end());
  return proto;
}

}  // namespace

v1::Progress ToProto(const UnwrapProgress& progress) {
  const FlattenProgress& flatten = progress.flatten;
  v1::Progress proto;
  proto.set_stage(ToProto(progress.stage));
  proto.set_chart(progress.chart);
  proto.set_chart_count(progress.chart_count);
  proto.set_newton_iteration(flatten.newton_iteration);
  proto.set_linear_iterations(flatten.linear_iterations);
  proto.set_linear_residual(flatten.linear_residual);
  *proto.mutable_residual() = ToProto(flatten.residual);
  proto.set_energy(flatten.energy);
  proto.set_step_length(flatten.step_length);
  return proto;
}

v1::Report ToProto(const UnwrapResult& result, const Mesh& mesh) {
  v1::Report proto;
  proto.mutable_input()->set_triangles(mesh.num_faces());
  proto.mutable_input()->set_vertices(mesh.num_vertices());
  for (const ChartReport& chart : result.charts) *proto.add_charts() = ToProto(chart);
  *proto.mutable_quality() = ToProto(result.quality);
  v1::StageSeconds* seconds = proto.mutable_seconds();
  seconds->set_charts(result.seconds.charts);
  seconds->set_solve(result.seconds.solve);
  seconds->set_layout(result.seconds.layout);
  seconds->set_pack(result.seconds.pack);
  seconds->set_verify(result.seconds.verify);
  for (const UnwrapWarning& warning : result.warnings) *proto.add_warnings() = ToProto(warning);
  return proto;
}

std::string PackUv(const std::vector<double>& uv, Precision precision) {
  std::string bytes;
  if (precision == Precision::kFloat) {
    const std::vector<float> rounded(uv.begin(), uv.end());
    bytes.resize(rounded.size() * sizeof(float));
    std::memcpy(bytes.data(), rounded.data(), bytes.size());
  } else {
    bytes.resize(uv.size() * sizeof(double));
    std::memcpy(bytes.data(), uv.data(), bytes.size());
  }
  return bytes;
}

std::int64_t PeakMemoryBytes() {
  rusage usage = {};
  getrusage(RUSAGE_SELF, &usage);
  return std::int64_t{usage.ru_maxrss} * 1024;
}

}  // namespace planish
