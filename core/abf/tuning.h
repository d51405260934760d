// The constants of Newton's method, of its linear systems and of the boundary control that are chosen, not derived.
// Each has its unit, what a smaller and a larger value do, and where it comes from. They are passed in
// (FlattenOptions::tuning), so that a test or a bench can vary them; no caller outside of core sets them.
//
// "Sweep" is tests/bench/tuning_sweep.cc: each constant halved and doubled, on discs by formula
// (tests/bench/results/tuning.md). All members are double or std::int64_t, which lets the sweep check that it names
// every one of them. Where a comment has no word of it, halving and doubling changed nothing on these discs, or little:
// the constant matters on rarer meshes only, or guards against them.
//
// A residual is the largest violation of all constraints and of the gradient, radians (Residual::Max()).
#pragma once

#include <cstdint>

#include "core/linalg/tuning.h"

namespace planish {

// How exactly the linear system of a step is solved: the forcing terms of an inexact Newton method. With tolerances
// proportional to the residual, convergence stays quadratic (Dembo, Eisenstat, Steihaug 1982, "Inexact Newton methods",
// section 3). Solving more exactly than the linear model is worth wastes iterations (Eisenstat and Walker 1996,
// "Choosing the forcing terms in an inexact Newton method"); in particular, a step that may be the last one is not
// solved beyond what the tolerance of Newton's method needs (Kelley 1995, "Iterative Methods for Linear and Nonlinear
// Equations", section 6.3). Smaller numbers: more linear iterations; larger: more Newton steps.
struct ForcingTuning {
  // Solvers with multigrid or a factorization (RoughTolerance in linalg/linear_solver.h). The error over that of
  // lambda = 0 is at most `error_of_residual` (1/rad) times the residual, and at most `max_error`; the solve leaves of
  // each constraint at most `constraints_left` times the largest violation, and of all at most `violations_left` times
  // their sum. Where more is left in sum, the line search may refuse the step for that alone, and a second-order
  // correction costs another solve (planish_solve_time, "foot" of seven sizes from 20,000 to 2 million triangles: 125
  // iterations with 0.9, 122 with 2, and 127 with 3, where the largest needs a correction of five).
  // Sweep: between half and double, at most 3 steps of 119 and a few per cent of the iterations, for all of these.
  double error_of_residual = 0.1;
  double max_error = 1e-2;
  double constraints_left = 0.1, violations_left = 2;
  // A solve that may be the last is good enough with this error, once it leaves of each constraint at most
  // `tolerance_left` times the tolerance (planish_solve_time, 17 discs of 2,000 to 1,000,000 triangles: 275 iterations
  // with 0.3, 267 with 0.6, 53 steps with both).
  double max_last_error = 0.1;
  double tolerance_left = 0.6;

  // The other solvers, by the relative Euclidean norm of the linear residual: at most `of_residual` (1/rad) times the
  // residual, and at most `max_term`.
  double of_residual = 1e-2;
  double max_term = 1e-4;
  // A solve that may be the last: at most `of_tolerance` times the tolerance over the residual, and at most this.
  double max_last_term = 1e-2;
  double of_tolerance = 0.3;
  // The least term: rounding allows no less. Also the term of all solves once rough ones led nowhere.
  double min_term = 1e-10;
};

// Where the Hessian of the Lagrangian is made positive, and when the exact one is used. Modified Hessians in general:
// Nocedal and Wright 2006, "Numerical Optimization", section 3.4. Teran, Sifakis, Irving, Fedkiw 2005 ("Robust
// quasistatic finite elements and flesh simulation") make the Hessian of each finite element positive by itself, by
// clamping its eigenvalues. Here each face's block moves towards diag(f'') instead, which keeps it diagonal.
struct ConvexityTuning {
  // Smallest eigenvalue of a face's 3x3 block, relative to diag(f'') on the plane of angle changes that sum to zero. A
  // face below is moved towards diag(f'') just as far as brings it there. Smaller: longer steps into directions that
  // the model knows least, and worse conditioned systems; larger: more steps. Sweep: matters only where many faces are
  // not positive, and there both ways (1,644 iterations on "higher hills", 609 with half, 1,245 with double).
  double min_curvature = 0.02;
  // In the preconditioner of an indefinite system, the least absolute value of such an eigenvalue. At most
  // min_curvature.
  double min_magnitude = 0.002;
  // Faces below this eigenvalue are weak: in S they are so much stronger than their neighbours that multigrid does not
  // serve them, and their vertices are solved for exactly. Larger: fewer iterations, costlier ones.
  double weak_curvature = 0.1;
  // Residual at and below which HessianType::kAuto trusts the exact Hessian where it is not positive. Further away it
  // leads astray (22 steps instead of 10 on boot_seam); nearer, the convexified one converges linearly only. Sweep:
  // with half, 4 steps more of 23 on "higher hills".
  double near_solution = 3e-2;
  // Down to this residual the convexified Hessian goes on for as long as each step multiplies the residual by
  // `fast_gain` or less: its linear solves take half the iterations of indefinite ones.
  double very_near_solution = 1e-3;
  double fast_gain = 0.1;
  // Relative linear residual at which MINRES on an indefinite system that has used up its iterations still gives a
  // step worth trying.
  double usable_residual = 1e-3;
};

// How far to go along a step, and when the result is better (line_search.h).
struct LineSearchTuning {
  // Fraction to the boundary, tau in (0, 1): no angle goes further than this part of the way to 0 or pi (Waechter and
  // Biegler 2006, eq. 15; Nocedal and Wright 2006, eq. 19.9). Of a step that is shortened as a whole, and of one whose
  // entries are clipped one by one. Larger: longer steps, but angles that are next to 0 then take many steps to return.
  double fraction_to_boundary = 0.95;
  double clipped_fraction = 0.9;
  // Penalty of a constraint over its |multiplier|; above 1, the merit function is exact (Nocedal and Wright 2006,
  // theorem 17.3). Larger: closer to the constraints, shorter steps.
  double penalty_factor = 1.5;
  // Armijo's condition: part of the decrease foretold by the slope that a step must bring (Nocedal and Wright 2006,
  // eq. 3.4).
  double sufficient_decrease = 1e-4;
  // Part of the sum of the magnitudes of its terms that the slope may be off by: a step is solved for to a tolerance
  // only, and near the solution the terms cancel.
  double slope_noise = 1e-6;
  // Part of the merit value below which differences are rounding.
  double merit_rounding = 1e-12;
  std::int64_t max_halvings = 30;
  // Step length in (0, 1] below which the linear solve is suspected instead of the direction: from then on all solves
  // have the least forcing term.
  double tiny_step = 1e-3;
};

// When angles count as collapsing, and the barrier that keeps them open (objective.h; a primal-dual interior point
// method: Waechter and Biegler 2006, section 2; Nocedal and Wright 2006, chapter 19). Ratios are those of an angle to
// its target.
struct BarrierTuning {
  // Weight tau of the barrier that remains where f has no minimum with positive angles. On the sphere through a 3-edge
  // hole it costs 0.2 % of the energy, and the least angle stays at 0.3 degrees. Smaller: nearer to f, thinner
  // triangles.
  double weakest = 1e-2;
  // Where `weakest` alone leads nowhere: the first barrier, and the factor from each to the next (Nocedal and Wright
  // 2006, section 19.3, call it the Fiacco-McCormick approach). Those before the weakest are solved to a residual of
  // rough_tolerance.
  double strongest = 1;
  double reduction = 10;
  double rough_tolerance = 1e-2;
  // Without a barrier, an angle below the ratio `collapsed` is on its way to 0. So is one that has stayed below
  // `narrow` for more than narrow_steps steps which left more than the part `fast_decrease` of the residual. On discs
  // where f has a minimum the smallest ratio on the way there is 0.003, on most of them no less than 0.025. Smaller:
  // steps are lost before the barrier comes; larger: a barrier where none is needed, which costs steps, too.
  double collapsed = 1e-3;
  double narrow = 1e-2;
  std::int64_t narrow_steps = 2;
  double fast_decrease = 1.0 / 3;
  // When the barrier is taken away again, both limits are at most this part of the smallest ratio with it.
  double collapsed_after = 0.25;
  // Step lengths, in (0, 1): a step shorter than cut_step without a barrier, or more than short_steps in a row shorter
  // than short_step with any, go nowhere.
  double cut_step = 0.3;
  double short_step = 0.1;
  std::int64_t short_steps = 2;
  // Bound multipliers begin as tau / x, with angles of at least this ratio (objective.h). Smaller: angles that
  // are nearly 0 are held there by their own curvature.
  double min_start_ratio = 3e-2;
  // z stays within this factor of tau / x, at least 1: kappa_Sigma of Waechter and Biegler 2006, eq. 16, who take 1e10.
  // Larger: nearer to the primal-dual method, smaller: to the primal one.
  double multiplier_range = 3;
};

// What may still be done after a stop is requested, on the way to angles that are flat enough: counts that take a part
// of a second, whatever the size of the chart, but some at least. Larger: a later end, better angles.
struct StopTuning {
  // Newton steps: max(min_steps, step_faces / faces).
  std::int64_t min_steps = 4;
  std::int64_t step_faces = 400'000;
  // Iterations of one linear solve: max(min_iterations, iteration_faces / faces); of all solves, min_steps times that.
  std::int64_t min_iterations = 50;
  std::int64_t iteration_faces = 8'000'000;
  // Relative error, or residual, at which such a solve ends.
  double tolerance = 1e-4;
};

// What counts as how much FlattenWork::work, beside 1 for a linear iteration.
struct WorkTuning {
  std::int64_t setup = 15;  // of the systems of one active set, or of the first
  std::int64_t step = 5;    // of Newton's method: gradient, Hessian, matrix, preconditioner
  std::int64_t trial = 1;   // of the line search
};

struct NewtonTuning {
  ForcingTuning forcing;
  ConvexityTuning convexity;
  LineSearchTuning line_search;
  BarrierTuning barrier;
  StopTuning stop;
  WorkTuning work;
};

// Which linear system is solved how, and when a preconditioner is made anew (step_solver.h). Unless stated otherwise
// the unit is iterations of one linear solve.
struct StepTuning {
  // Faces: with so many or more PreconditionerType::kAuto is multigrid, with fewer it is a Cholesky factorization. On
  // discs of 1,000 faces both take the same time, on 1,500 multigrid takes two thirds of it (tests/bench:
  // planish_solve_time head:1500 --preconditioner=amg|cholesky). FlattenSummary::preconditioner says which one it was.
  std::int64_t multigrid_faces = 1500;
  // A preconditioner made for an earlier Hessian stays until a solve took more than this many iterations more than the
  // first one with it: about what a new factorization, or new numbers for the multigrid, cost.
  std::int64_t worn_out_factorization = 10;
  std::int64_t worn_out_multigrid = 5;
  // A factorization that serves a barrier can be far worse, and is given up in the middle of a solve after this many
  // more. Must be larger than worn_out_factorization, or the old factorization goes on to the end: where the two were
  // equal, the sphere of the sweep took 6,552 iterations instead of 494, and ten times as long.
  std::int64_t useless_factorization = 20;
  // Most iterations with multigrid, where a factorization may take over (it is quicker from there on) and where none
  // may. A system that takes more is not one for multigrid. Sweep: with half, "higher hills" ends with Cholesky in 28 %
  // of the time; where multigrid fails late, the default wastes its iterations.
  std::int64_t max_multigrid_iterations = 300;
  std::int64_t max_iterations_without_fallback = 3000;
  // Where the caller would rather cut the chart (FlattenControl::gives_up), a system that takes more is a reason to do
  // so. The 84 shared meshes, and nets of 444,216 and 507,360 faces, have the same charts as without this. So have
  // 39,366 faces with slivers and 38,576 of one mesh forty times over, whose solves take 0.38 of the time. With 15 a
  // mesh that is refined towards points has other charts.
  std::int64_t iterations_to_give_up = 25;
  // MINRES on an indefinite system gives up after the larger of these: a count, and a multiple of the last positive
  // system's iterations.
  std::int64_t max_indefinite_iterations = 100;
  std::int64_t indefinite_factor = 5;
  // Vertices of weak faces are solved for exactly where there are at least this many rows for each of them. Where weak
  // faces are not few, the convexified Hessian is no better than a guess. Sweep: with half, "higher hills" takes half
  // the iterations.
  std::int64_t rows_per_weak_row = 16;
};

// Memory that EstimateUnwrap() (core/unwrap/estimate.h) reserves for the linear systems of one chart. These are
// promises, and no sweep varies them: whoever changes one measures with `tests/bench/run.sh memory`.
//
// Where multigrid fails, a Cholesky factorization may take over on charts of at most so many faces.
inline constexpr std::int32_t kMostFallbackFaces = 50'000;
// Bytes a face of its factor, in the order of minimum degree: a chart of 50,000 faces takes 1,310 bytes a face in all.
inline constexpr std::int64_t kFallbackBytesPerFace = 1100;
// What the exact solves on the rows of weak faces may take: a part of what is reserved for multigrid.
inline constexpr std::int64_t kPatchBytesPerFace = 100, kLeastPatchBytes = 1'000'000;

// The active set of a convex boundary (boundary_control.h).
struct BoundaryTuning {
  // The angles for a set that may be wrong are solved for to this part of how wrong the last one was, and no better
  // than the tolerance or worse than rough_tolerance (rad). Larger: cheaper solves, more changes of the set. Sweep:
  // half the rough_tolerance costs 19 steps more of 28 on high hills with a convex boundary; double saves one.
  double rough_part = 0.1;
  double rough_tolerance = 1e-2;
  // A rough solve ends after so many Newton steps. Its angles are good enough to judge the set by if constraints hold
  // to rough_tolerance and the scaled gradient (rad) is at most max_gradient.
  std::int64_t rough_steps = 12;
  double max_gradient = 0.5;
  // Changes of the set that may fail to make it less wrong than ever before vertices change one at a time: p of
  // Portugal, Judice, Vicente 1994, who take 10.
  std::int64_t patience = 10;
  std::int64_t max_set_changes = 200;
};

// All of them.
struct FlattenTuning {
  NewtonTuning newton;
  StepTuning step;
  BoundaryTuning boundary;
  LinearTuning linear;
  MultigridTuning multigrid;
};

}  // namespace planish
