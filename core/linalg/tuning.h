// Constants of the linear solvers and of the multigrid that were chosen rather than derived. Each has its unit, the
// effect of smaller and larger values, and its source. They are passed in, so that tests and benches can vary them.
//
// "Sweep" is tests/bench/tuning_sweep.cc: each constant halved and doubled, on discs by formula
// (tests/bench/results/tuning.md). All members are double or std::int64_t, which lets the sweep check that it covers
// all of them. If a comment does not mention the sweep, halving and doubling changed little or nothing on these discs.
#pragma once

#include <cstdint>

namespace planish {

// How a linear solve ends, and which of its claims the wrapper accepts (linear_solver.h).
struct LinearTuning {
  // True residual over the tolerance, above which a convergence that the solver claims counts as stagnation. The
  // residual that a solver carries along drifts from the true one by rounding (Greenbaum 1997, "Estimating the
  // attainable accuracy of recursively computed residual methods"). Smaller: good solves are called failures.
  double residual_slack = 100;
  // Like residual_slack, but for the largest entry of the residual of a rough solve. Such a solve ends after few
  // iterations, far above rounding errors.
  double rough_slack = 2;
  // Relative difference between the decrease of the energy that Uzawa claims and the true one, above which a rough
  // solve counts as stagnated.
  double energy_slack = 0.05;
  // Relative to the right-hand side: true residuals below this are rounding errors, whatever the tolerance.
  double residual_floor = 1e-12;
  // Relative tolerance below which a solve with a matrix rounded to float (rounding unit 6e-8) is refined with the
  // exact one. With larger tolerances the rounding does not matter.
  double refined_tolerance = 1e-5;
  // A solve with a rounded matrix is refined until the true residual is at most this many times the tolerance, at most
  // `max_refinements` times (iterative refinement: Higham 2002, chapter 12).
  double refined_slack = 2;
  std::int64_t max_refinements = 10;
  // Corrections by the direct solver before it gives up; the first is the solve itself.
  std::int64_t max_direct_refinements = 3;
  // Uzawa's estimate of the error assumes that the energy keeps falling at the rate of the last two iterations, but at
  // least at this rate per iteration: a later iteration may reduce the energy more than an earlier one, and a quotient
  // of 1 would make the error infinite. Larger: more pessimistic estimates, more iterations.
  double slowest_rate = 0.9;
};

// The hierarchy and the smoother of the multigrid (multigrid.h).
struct MultigridTuning {
  // theta, in [0, 1): couplings weaker than this part of the diagonal do not join rows into an aggregate. On level l it
  // is strength * strength_ratio^l; the values are those of Vanek, Mandel, Brezina 1996. Sweep: with double the
  // strength up to a third fewer iterations and a tenth more time; with half, a few iterations more and about the same
  // time.
  double strength = 0.08;
  double strength_ratio = 0.5;
  // A row of the second ring joins an aggregate of the finest level if it is coupled to this many rows of the first
  // ring. 1: the whole second ring, 19 rows an aggregate where all vertices have six neighbours; 2: 13; 3 or more: 7.
  // Larger aggregates make cheaper cycles, but more of them. Sweep: with 1, a tenth less time on easy discs, and more
  // iterations on hard ones; with 4, no gain in time.
  std::int64_t second_ring_neighbours = 2;
  // Coarsening has failed if a coarse level has more than this part of the rows of the level above.
  double slowest_coarsening = 0.9;
  // Block rows at which coarsening ends: the coarsest matrix is inverted as a dense one, 4 rows a block row.
  std::int64_t coarsest_rows = 40;
  // Maximal number of coarse levels.
  std::int64_t max_levels = 20;
  // Maximal number of block rows of the coarsest level. If coarsening ends above this, because rows are coupled too
  // weakly or levels are too few, Multigrid::Build() fails. It also fails above the square root of the rows of the
  // finest level, since the dense matrix would take more memory than all other levels.
  std::int64_t max_dense_rows = 500;
  // omega times the largest eigenvalue of D^-1 A: the damping of the prolongation's smoother that is best for all
  // eigenvalues at once (Vanek, Mandel, Brezina 1996). Sweep: on easy discs half of it takes 1.5 times as many
  // iterations, double of it twice as many.
  double omega = 4.0 / 3;
  // Rows with more couplings than this are not smoothed in the prolongation: such a row would connect the aggregates of
  // all its neighbours with each other, which gives n^2 blocks in the coarse matrix where n triangles meet at a vertex.
  // A regular mesh has 7 couplings a row, and about 20 on coarse levels.
  std::int64_t most_smoothed_couplings = 100;
  // The largest eigenvalue of D^-1 A is estimated by power iterations, which give too low a value: a factor on that
  // value, and the number of iterations.
  double eigenvalue_margin = 1.05;
  std::int64_t power_iterations = 8;
  // Part of the diagonal block's own positivity that the couplings between chunks may use up before rows are damped
  // (LevelMatrix::damping; Baker, Falgout, Kolev, Yang 2011). Any value below 1 keeps the cycle positive definite; a
  // smaller one damps more and smooths less.
  double undamped_part = 0.9;
  // Rows that one thread relaxes in sequence, on the finest level and on the coarse ones. Larger chunks smooth better
  // (more Gauss-Seidel, less Jacobi) but give threads fewer chunks to share. At least 1.
  std::int64_t chunk_rows = 16384;
  std::int64_t coarse_chunk_rows = 4096;
};

}  // namespace planish
