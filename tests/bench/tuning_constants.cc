#include "tests/bench/tuning_constants.h"

#include <algorithm>
#include <cmath>

namespace planish::bench {

double TuningConstant::Value() const {
  return std::visit([](const auto* at) { return static_cast<double>(*at); }, number);
}

void TuningConstant::Multiply(double factor) const {
  const double value = Value();
  const double scaled = scale == Scale::kPlain ? factor * value : 1 + factor * (value - 1);
  if (double* const* real = std::get_if<double*>(&number)) {
    **real = scaled;
  } else {
    *std::get<std::int64_t*>(number) = std::max<std::int64_t>(1, static_cast<std::int64_t>(std::floor(scaled)));
  }
}

std::vector<TuningConstant> ConstantsOf(FlattenTuning* tuning) {
  ForcingTuning& forcing = tuning->newton.forcing;
  ConvexityTuning& convexity = tuning->newton.convexity;
  LineSearchTuning& line_search = tuning->newton.line_search;
  BarrierTuning& barrier = tuning->newton.barrier;
  StopTuning& stop = tuning->newton.stop;
  WorkTuning& work = tuning->newton.work;
  StepTuning& step = tuning->step;
  BoundaryTuning& boundary = tuning->boundary;
  LinearTuning& linear = tuning->linear;
  MultigridTuning& multigrid = tuning->multigrid;
  return {
      {"newton.forcing.error_of_residual", &forcing.error_of_residual},
      {"newton.forcing.max_error", &forcing.max_error},
      {"newton.forcing.constraints_left", &forcing.constraints_left},
      {"newton.forcing.violations_left", &forcing.violations_left},
      {"newton.forcing.max_last_error", &forcing.max_last_error},
      {"newton.forcing.tolerance_left", &forcing.tolerance_left},
      {"newton.forcing.of_residual", &forcing.of_residual},
      {"newton.forcing.max_term", &forcing.max_term},
      {"newton.forcing.max_last_term", &forcing.max_last_term},
      {"newton.forcing.of_tolerance", &forcing.of_tolerance},
      {"newton.forcing.min_term", &forcing.min_term},
      {"newton.convexity.min_curvature", &convexity.min_curvature},
      {"newton.convexity.min_magnitude", &convexity.min_magnitude},
      {"newton.convexity.weak_curvature", &convexity.weak_curvature},
      {"newton.convexity.near_solution", &convexity.near_solution},
      {"newton.convexity.very_near_solution", &convexity.very_near_solution},
      {"newton.convexity.fast_gain", &convexity.fast_gain},
      {"newton.convexity.usable_residual", &convexity.usable_residual},
      {"newton.line_search.fraction_to_boundary", &line_search.fraction_to_boundary, Scale::kBelowOne},
      {"newton.line_search.clipped_fraction", &line_search.clipped_fraction, Scale::kBelowOne},
      {"newton.line_search.penalty_factor", &line_search.penalty_factor, Scale::kAboveOne},
      {"newton.line_search.sufficient_decrease", &line_search.sufficient_decrease},
      {"newton.line_search.slope_noise", &line_search.slope_noise},
      {"newton.line_search.merit_rounding", &line_search.merit_rounding},
      {"newton.line_search.max_halvings", &line_search.max_halvings},
      {"newton.line_search.tiny_step", &line_search.tiny_step},
      {"newton.barrier.weakest", &barrier.weakest},
      {"newton.barrier.strongest", &barrier.strongest},
      {"newton.barrier.reduction", &barrier.reduction, Scale::kAboveOne},
      {"newton.barrier.rough_tolerance", &barrier.rough_tolerance},
      {"newton.barrier.collapsed", &barrier.collapsed},
      {"newton.barrier.narrow", &barrier.narrow},
      {"newton.barrier.narrow_steps", &barrier.narrow_steps},
      {"newton.barrier.fast_decrease", &barrier.fast_decrease},
      {"newton.barrier.collapsed_after", &barrier.collapsed_after},
      {"newton.barrier.cut_step", &barrier.cut_step},
      {"newton.barrier.short_step", &barrier.short_step},
      {"newton.barrier.short_steps", &barrier.short_steps},
      {"newton.barrier.min_start_ratio", &barrier.min_start_ratio},
      {"newton.barrier.multiplier_range", &barrier.multiplier_range, Scale::kAboveOne},
      {"newton.stop.min_steps", &stop.min_steps},
      {"newton.stop.step_faces", &stop.step_faces},
      {"newton.stop.min_iterations", &stop.min_iterations},
      {"newton.stop.iteration_faces", &stop.iteration_faces},
      {"newton.stop.tolerance", &stop.tolerance},
      {"newton.work.setup", &work.setup},
      {"newton.work.step", &work.step},
      {"newton.work.trial", &work.trial},
      {"step.multigrid_faces", &step.multigrid_faces},
      {"step.worn_out_factorization", &step.worn_out_factorization},
      {"step.worn_out_multigrid", &step.worn_out_multigrid},
      {"step.useless_factorization", &step.useless_factorization},
      {"step.max_multigrid_iterations", &step.max_multigrid_iterations},
      {"step.max_iterations_without_fallback", &step.max_iterations_without_fallback},
      {"step.iterations_to_give_up", &step.iterations_to_give_up},
      {"step.max_indefinite_iterations", &step.max_indefinite_iterations},
      {"step.indefinite_factor", &step.indefinite_factor},
      {"step.rows_per_weak_row", &step.rows_per_weak_row},
      {"boundary.rough_part", &boundary.rough_part},
      {"boundary.rough_tolerance", &boundary.rough_tolerance},
      {"boundary.rough_steps", &boundary.rough_steps},
      {"boundary.max_gradient", &boundary.max_gradient},
      {"boundary.patience", &boundary.patience},
      {"boundary.max_set_changes", &boundary.max_set_changes},
      {"linear.residual_slack", &linear.residual_slack, Scale::kAboveOne},
      {"linear.rough_slack", &linear.rough_slack, Scale::kAboveOne},
      {"linear.energy_slack", &linear.energy_slack},
      {"linear.residual_floor", &linear.residual_floor},
      {"linear.refined_tolerance", &linear.refined_tolerance},
      {"linear.refined_slack", &linear.refined_slack, Scale::kAboveOne},
      {"linear.max_refinements", &linear.max_refinements},
      {"linear.max_direct_refinements", &linear.max_direct_refinements},
      {"linear.slowest_rate", &linear.slowest_rate, Scale::kBelowOne},
      {"multigrid.strength", &multigrid.strength},
      {"multigrid.strength_ratio", &multigrid.strength_ratio},
      {"multigrid.second_ring_neighbours", &multigrid.second_ring_neighbours},
      {"multigrid.most_smoothed_couplings", &multigrid.most_smoothed_couplings},
      {"multigrid.slowest_coarsening", &multigrid.slowest_coarsening, Scale::kBelowOne},
      {"multigrid.coarsest_rows", &multigrid.coarsest_rows},
      {"multigrid.max_levels", &multigrid.max_levels},
      {"multigrid.max_dense_rows", &multigrid.max_dense_rows},
      {"multigrid.omega", &multigrid.omega},
      {"multigrid.eigenvalue_margin", &multigrid.eigenvalue_margin, Scale::kAboveOne},
      {"multigrid.power_iterations", &multigrid.power_iterations},
      {"multigrid.undamped_part", &multigrid.undamped_part, Scale::kBelowOne},
      {"multigrid.chunk_rows", &multigrid.chunk_rows},
      {"multigrid.coarse_chunk_rows", &multigrid.coarse_chunk_rows},
  };
}

}  // namespace planish::bench
