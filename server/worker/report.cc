#include "server/worker/report.h"

#include <algorithm>
#include <bit>
#include <cstring>
#include <numeric>
#include <tuple>

#include "core/base/status_macros.h"
#include "server/link/duration.h"
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
  const FlattenSummary& flatten = *chart.flatten;
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
  proto.set_stretch_l2(chart.stretch_l2);
  proto.set_preconditioner_note(flatten.preconditioner_note);
  proto.mutable_newton_residuals()->Assign(flatten.residuals.begin(), flatten.residuals.end());
  return proto;
}

// The charts that a report describes, ascending: all, or, if there are too many, those that did not converge and then
// the most stretched ones.
std::vector<std::size_t> ReportedCharts(const std::vector<ChartReport>& charts) {
  std::vector<std::size_t> ids(charts.size());
  std::iota(ids.begin(), ids.end(), std::size_t{0});
  if (ids.size() <= kMaxChartReports) return ids;
  const auto kept = ids.begin() + static_cast<std::ptrdiff_t>(kMaxChartReports);
  std::partial_sort(ids.begin(), kept, ids.end(), [&](std::size_t a, std::size_t b) {
    return std::tuple(charts[a].flatten->converged, -charts[a].stretch_l2, a) <
           std::tuple(charts[b].flatten->converged, -charts[b].stretch_l2, b);
  });
  ids.erase(kept, ids.end());
  std::sort(ids.begin(), ids.end());
  return ids;
}

// The largest residual of any chart after each Newton step.
std::vector<float> LargestResiduals(const std::vector<ChartReport>& charts) {
  std::size_t most = 0;
  for (const ChartReport& chart : charts) most = std::max(most, chart.flatten->residuals.size());
  std::vector<float> largest(most), ended(most);  // ended[i]: the largest last residual of charts that ended there
  for (const ChartReport& chart : charts) {
    const std::vector<float>& residuals = chart.flatten->residuals;
    for (std::size_t i = 0; i < residuals.size(); ++i) largest[i] = std::max(largest[i], residuals[i]);
    if (!residuals.empty()) ended[residuals.size() - 1] = std::max(ended[residuals.size() - 1], residuals.back());
  }
  float last = 0;
  for (std::size_t i = 0; i < most; ++i) {
    largest[i] = std::max(largest[i], last);
    last = std::max(last, ended[i]);
  }
  return largest;
}

v1::ChartTotals Totals(const std::vector<ChartReport>& charts) {
  v1::ChartTotals totals;
  Residual worst;
  double stretch = 0;
  for (const ChartReport& chart : charts) {
    const FlattenSummary& flatten = *chart.flatten;
    totals.set_not_converged(totals.not_converged() + (flatten.converged ? 0 : 1));
    totals.set_newton_iterations(totals.newton_iterations() + flatten.newton_iterations);
    totals.set_linear_iterations(totals.linear_iterations() + flatten.linear_iterations);
    worst.triangle = std::max(worst.triangle, flatten.residual.triangle);
    worst.vertex = std::max(worst.vertex, flatten.residual.vertex);
    worst.wheel = std::max(worst.wheel, flatten.residual.wheel);
    worst.gradient = std::max(worst.gradient, flatten.residual.gradient);
    stretch = std::max(stretch, chart.stretch_l2);
  }
  totals.set_charts(static_cast<std::int32_t>(charts.size()));
  *totals.mutable_residual() = ToProto(worst);
  totals.set_stretch_l2_max(stretch);
  const std::vector<float> residuals = LargestResiduals(charts);
  totals.mutable_newton_residuals()->Assign(residuals.begin(), residuals.end());
  return totals;
}

v1::Atlas AtlasOf(const UnwrapResult& result, const UnwrapOptions& options) {
  v1::Atlas atlas = AtlasInEffect(options, result);
  atlas.set_padding_kept(result.padding);
  atlas.set_tiles(result.tiles);
  atlas.set_texels_per_unit(result.texels_per_unit);
  for (std::size_t i = 0; i < std::min(result.atlases.size(), kMaxAtlasParts); ++i) {
    const AtlasReport& report = result.atlases[i];
    v1::AtlasPart& part = *atlas.add_atlases();
    part.set_atlas(report.atlas);
    part.set_triangles(report.faces);
    part.set_charts(report.charts);
    part.set_first_tile(report.first_tile);
    part.set_tiles(report.tiles);
    part.set_texels_per_unit(report.texels_per_unit);
    part.set_packing_efficiency(report.packing_efficiency);
  }
  return atlas;
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
  proto.set_seam_length(quality.seam_length);
  proto.set_visible_seam_length(quality.visible_seam_length);
  proto.set_seam_turn_deg(quality.seam_turn_deg);
  if (quality.seam_symmetry) proto.set_seam_symmetry(*quality.seam_symmetry);
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
  proto.set_stage_fraction(progress.stage_fraction);
  return proto;
}

v1::Report ToProto(const UnwrapResult& result, const Mesh& mesh, const UnwrapOptions& options) {
  v1::Report proto;
  proto.mutable_input()->set_triangles(mesh.num_faces());
  proto.mutable_input()->set_vertices(mesh.num_vertices());
  for (const std::size_t chart : ReportedCharts(result.charts)) {
    *proto.add_charts() = ToProto(result.charts[chart]);
    proto.mutable_charts()->rbegin()->set_chart(static_cast<std::int32_t>(chart));
  }
  *proto.mutable_chart_totals() = Totals(result.charts);
  *proto.mutable_atlas() = AtlasOf(result, options);
  *proto.mutable_quality() = ToProto(result.quality);
  v1::StageTimes* times = proto.mutable_times();
  *times->mutable_charts() = ToDuration(result.seconds.charts);
  *times->mutable_solve() = ToDuration(result.seconds.solve);
  *times->mutable_layout() = ToDuration(result.seconds.layout);
  *times->mutable_pack() = ToDuration(result.seconds.pack);
  *times->mutable_verify() = ToDuration(result.seconds.verify);
  for (const UnwrapWarning& warning : result.warnings) *proto.add_warnings() = ToProto(warning);
  return proto;
}

absl::StatusOr<BlobPtr> PackUv(const std::vector<double>& uv, Precision precision) {
  const std::size_t size = precision == Precision::kFloat ? sizeof(float) : sizeof(double);
  PLANISH_ASSIGN_OR_RETURN(BlobWriter bytes, BlobWriter::Make(uv.size() * size));
  if (precision == Precision::kFloat) {
    float* const out = reinterpret_cast<float*>(bytes.data());
    std::transform(uv.begin(), uv.end(), out, [](double number) { return static_cast<float>(number); });
  } else if (!uv.empty()) {
    std::memcpy(bytes.data(), uv.data(), bytes.size());
  }
  return bytes.Finish();
}

}  // namespace planish
