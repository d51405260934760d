// Constants of Newton's method, its linear systems and the boundary control that were chosen rather than derived. Each
// has its unit, the effect of smaller and larger values, and its source. They are passed in (FlattenOptions::tuning),
// so that tests and benches can vary them; no caller outside of core sets them.
//
// "Sweep" is tests/bench/tuning_sweep.cc: each constant halved and doubled, on discs by formula
// (tests/bench/results/tuning.md). All members are double or std::int64_t, which lets the sweep check that it covers
// all of them. If a comment does not mention the sweep, halving and doubling changed little or nothing on these discs:
// the constant matters only on rarer meshes, or guards against them.
//
// A residual is the largest violation of all constraints and of the gradient, radians (Residual::Max()).
#pragma once

#include <cstdint>

#include "core/linalg/tuning.h"

namespace planish {

// How exactly the linear system of a step is solved: the forcing terms of an inexact Newton method. With tolerances
// proportional to the residual, convergence stays quadratic (Dembo, Eisenstat, Steihaug 1982, "Inexact Newton methods",
// section 3). Solving more exactly than the linear model is accurate wastes iterations (Eisenstat and Walker 1996,
// "Choosing the forcing terms in an inexact Newton method"); in particular, a step that may be the last is solved only
// as far as the tolerance of Newton's method needs (Kelley 1995, "Iterative Methods for Linear and Nonlinear
// Equations", section 6.3). Smaller values: more linear iterations; larger values: more Newton steps.
struct ForcingTuning {
  // For solvers with multigrid or a factorization (RoughTolerance in linalg/linear_solver.h). The error over that of
  // lambda = 0 is at most `error_of_residual` (1/rad) times the residual, and at most `max_error`. Each constraint is
  // left violated by at most `constraints_left` times the largest violation, and the sum of violations by at most
  // `violations_left` times their sum. If the sum is larger, the line search may refuse the step for that alone, and a
  // second-order correction costs another solve (planish_solve_time, "foot" of seven sizes from 20,000 to 2 million
  // triangles: 125 iterations with 0.9, 122 with 2, and 127 with 3, where the largest needs a correction of five).
  // Sweep: between half and double, at most 3 steps of 119 and a few per cent of the iterations, for all of these.
  double error_of_residual = 0.1;
  double max_error = 1e-2;
  double constraints_left = 0.1, violations_left = 2;
  // A solve that may be the last may have this error, once it leaves each constraint violated by at most
  // `tolerance_left` times the tolerance (planish_solve_time, 17 discs of 2,000 to 1,000,000 triangles: 275 iterations
  // with 0.3, 267 with 0.6, 53 steps with both).
  double max_last_error = 0.1;
  double tolerance_left = 0.6;

  // For other solvers, by the relative Euclidean norm of the linear residual: at most `of_residual` (1/rad) times the
  // residual, and at most `max_term`.
  double of_residual = 1e-2;
  double max_term = 1e-4;
  // A solve that may be the last: at most `of_tolerance` times the tolerance over the residual, and at most this.
  double max_last_term = 1e-2;
  double of_tolerance = 0.3;
  // The least term, limited by rounding. All solves use it once rough ones made no progress.
  double min_term = 1e-10;
};

// Where the Hessian of the Lagrangian is made positive, and when the exact one is used. Nocedal and Wright 2006,
// "Numerical Optimization", section 3.4, treat modified Hessians in general. Teran, Sifakis, Irving, Fedkiw 2005
// ("Robust quasistatic finite elements and flesh simulation") make the Hessian of each finite element positive on its
// own, by clamping its eigenvalues. Here each face's block moves towards diag(f'') instead, which keeps it diagonal.
struct ConvexityTuning {
  // Least eigenvalue of a face's 3x3 block, relative to diag(f'') on the plane of angle changes that sum to zero. A
  // face below it is moved towards diag(f'') just far enough to reach it. Smaller: longer steps into directions where
  // the model is least accurate, and worse conditioned systems; larger: more steps. Sweep: matters only where many
  // faces are not positive, and there half and double are both better (1,644 iterations on "higher hills", 609 with
  // half, 1,245 with double).
  double min_curvature = 0.02;
  // Like min_curvature, for the preconditioner of an indefinite system: the least absolute value of an eigenvalue. At
  // most min_curvature.
  double min_magnitude = 0.002;
  // Faces below this eigenvalue are weak: in S they are so much stronger than their neighbours that multigrid works
  // badly, and their vertices are solved for exactly. Larger: fewer but costlier iterations.
  double weak_curvature = 0.1;
  // Residual up to which HessianType::kAuto trusts an exact Hessian that is not positive. With a larger residual it
  // leads astray (22 steps instead of 10 on boot_seam); with a smaller one, the convexified Hessian converges only
  // linearly. Sweep: with half, 4 steps more of 23 on "higher hills".
  double near_solution = 3e-2;
  // Down to this residual the convexified Hessian is kept as long as each step multiplies the residual by at most
  // `fast_gain`, since its linear solves take half the iterations of indefinite ones.
  double very_near_solution = 1e-3;
  double fast_gain = 0.1;
  // Relative linear residual at which a step by MINRES on an indefinite system is still worth trying after the
  // iteration limit.
  double usable_residual = 1e-3;
};

// The length of a step, and when the result is better (line_search.h).
struct LineSearchTuning {
  // Fraction to the boundary, tau in (0, 1): no angle goes further than this part of the way to 0 or pi (Waechter and
  // Biegler 2006, eq. 15; Nocedal and Wright 2006, eq. 19.9). The first applies to steps shortened as a whole, the
  // second to steps whose entries are clipped one by one. Larger: longer steps, but angles near 0 then take many steps
  // to return.
  double fraction_to_boundary = 0.95;
  double clipped_fraction = 0.9;
  // Penalty of a constraint over its |multiplier|; above 1, the merit function is exact (Nocedal and Wright 2006,
  // theorem 17.3). Larger: closer to the constraints, shorter steps.
  double penalty_factor = 1.5;
  // Armijo's condition: the fraction of the decrease predicted by the slope that a step must achieve (Nocedal and
  // Wright 2006, eq. 3.4).
  double sufficient_decrease = 1e-4;
  // Error of the slope, relative to the sum of the magnitudes of its terms: steps are solved for only to a tolerance,
  // and near the solution the terms cancel.
  double slope_noise = 1e-6;
  // Differences below this part of the merit value are rounding errors.
  double merit_rounding = 1e-12;
  std::int64_t max_halvings = 30;
  // Step length in (0, 1] below which the linear solve is suspected instead of the direction: from then on all solves
  // use the least forcing term.
  double tiny_step = 1e-3;
};

// When angles count as collapsing, and the barrier that keeps them open (objective.h; a primal-dual interior point
// method: Waechter and Biegler 2006, section 2; Nocedal and Wright 2006, chapter 19). Ratios are those of an angle to
// its target.
struct BarrierTuning {
  // Weight tau of the barrier that is kept if f has no minimum with positive angles. On the sphere through a 3-edge
  // hole it costs 0.2 % of the energy, and the least angle stays at 0.3 degrees. Smaller: closer to f, thinner
  // triangles.
  double weakest = 1e-2;
  // If `weakest` alone fails: the first barrier, and the factor from each to the next (the Fiacco-McCormick approach:
  // Nocedal and Wright 2006, section 19.3). Barriers before the weakest are solved to a residual of rough_tolerance.
  double strongest = 1;
  double reduction = 10;
  double rough_tolerance = 1e-2;
  // Without a barrier, an angle below the ratio `collapsed` counts as collapsing. So does one that has stayed below
  // `narrow` for more than narrow_steps steps which left more than the part `fast_decrease` of the residual. On discs
  // where f has a minimum the smallest ratio on the way there is 0.003, on most of them no less than 0.025. Smaller:
  // steps are wasted before the barrier is used; larger: a barrier is used without need, which costs steps, too.
  double collapsed = 1e-3;
  double narrow = 1e-2;
  std::int64_t narrow_steps = 2;
  double fast_decrease = 1.0 / 3;
  // When the barrier is removed again, both limits are at most this part of the smallest ratio with it.
  double collapsed_after = 0.25;
  // Step lengths, in (0, 1). Steps make no progress if one without a barrier is shorter than cut_step, or if more than
  // short_steps in a row, with or without a barrier, are shorter than short_step.
  double cut_step = 0.3;
  double short_step = 0.1;
  std::int64_t short_steps = 2;
  // Initial bound multipliers are tau / x, with angles of at least this ratio (objective.h). Smaller: angles that are
  // nearly 0 are held there by their own curvature.
  double min_start_ratio = 3e-2;
  // z stays within this factor (at least 1) of tau / x: kappa_Sigma of Waechter and Biegler 2006, eq. 16, who use 1e10.
  // Larger: closer to the primal-dual method; smaller: to the primal one.
  double multiplier_range = 3;
};

// Work that is still allowed after a stop request, to get the angles flat enough. The counts take a fraction of a
// second for charts of any size, but have a minimum. Larger values: a later end, better angles.
struct StopTuning {
  // Newton steps: max(min_steps, step_faces / faces).
  std::int64_t min_steps = 4;
  std::int64_t step_faces = 400'000;
  // Iterations of one linear solve: max(min_iterations, iteration_faces / faces); of all solves, min_steps times that.
  std::int64_t min_iterations = 50;
  std::int64_t iteration_faces = 8'000'000;
  // Relative error, or residual, at which a linear solve ends after a stop request.
  double tolerance = 1e-4;
};

// The FlattenWork::work of each of these, where a linear iteration counts as 1.
struct WorkTuning {
  std::int64_t setup = 15;  // of the systems of each active set, at least once
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

// How linear systems are solved, and when a preconditioner is rebuilt (step_solver.h). Unless stated otherwise the unit
// is iterations of one linear solve.
struct StepTuning {
  // Number of faces from which PreconditionerType::kAuto is multigrid; below, it is a Cholesky factorization. On discs
  // of 1,000 faces both take the same time, on 1,500 multigrid takes two thirds of it (tests/bench: planish_solve_time
  // head:1500 --preconditioner=amg|cholesky). FlattenSummary::preconditioner has the choice.
  std::int64_t multigrid_faces = 1500;
  // A preconditioner made for an earlier Hessian is kept until a solve takes more than this many iterations more than
  // the first one with it: about the cost of a new factorization, or of new numbers for the multigrid.
  std::int64_t worn_out_factorization = 10;
  std::int64_t worn_out_multigrid = 5;
  // With a barrier, an old factorization can become far worse, and is replaced in the middle of a solve after this many
  // extra iterations. Must be larger than worn_out_factorization, or the old factorization is used to the end: when the
  // two were equal, the sphere of the sweep took 6,552 iterations instead of 494, and ten times as long.
  std::int64_t useless_factorization = 20;
  // Iteration limits with multigrid: where a factorization may replace it (which is faster beyond the limit), and where
  // none may. Sweep: with half, "higher hills" ends with Cholesky in 28 % of the time; where multigrid fails late, the
  // default wastes its iterations.
  std::int64_t max_multigrid_iterations = 300;
  std::int64_t max_iterations_without_fallback = 3000;
  // If the caller prefers cutting the chart (FlattenControl::gives_up), a system that takes more iterations ends the
  // solve. The 84 shared meshes, and nets of 444,216 and 507,360 faces, have the same charts as without this limit. So
  // have a mesh of 39,366 faces with slivers, and one of 38,576 faces that holds the same mesh forty times; their
  // solves take 0.38 of the time. With 15, a mesh that is refined towards points has other charts.
  std::int64_t iterations_to_give_up = 25;
  // MINRES on an indefinite system gives up after the larger of these: a count, and a multiple of the last positive
  // system's iterations.
  std::int64_t max_indefinite_iterations = 100;
  std::int64_t indefinite_factor = 5;
  // Vertices of weak faces are solved for exactly if there are at least this many rows for each of them. With more weak
  // faces, the convexified Hessian is no better than a guess. Sweep: with half, "higher hills" takes half the
  // iterations.
  std::int64_t rows_per_weak_row = 16;
};

// Memory that EstimateUnwrap() (core/unwrap/estimate.h) reserves for the linear systems of one chart. No sweep varies
// these; after a change of one, measure with `tests/bench/run.sh memory`.
//
// If multigrid fails, a Cholesky factorization may replace it on charts of at most this many faces.
inline constexpr std::int32_t kMostFallbackFaces = 50'000;
// Bytes per face of the Cholesky factor, ordered by minimum degree. In all, a chart of 50,000 faces takes 1,310 bytes
// per face.
inline constexpr std::int64_t kFallbackBytesPerFace = 1100;
// The exact solves on the rows of weak faces may take this many bytes per face, or kLeastPatchBytes if that is more. It
// is part of the reservation for multigrid.
inline constexpr std::int64_t kPatchBytesPerFace = 100, kLeastPatchBytes = 1'000'000;

// The active set of a convex boundary (boundary_control.h).
struct BoundaryTuning {
  // A set that may be wrong is solved for to a residual of rough_part times how wrong the last set was
  // (ActiveSet::Worst()), but not below the tolerance and not above rough_tolerance (rad). Larger: cheaper solves, more
  // changes of the set. Sweep: half the rough_tolerance costs 19 steps more of 28 on high hills with a convex boundary;
  // double saves one.
  double rough_part = 0.1;
  double rough_tolerance = 1e-2;
  // A rough solve ends after rough_steps Newton steps. Its angles are good enough to judge the set if constraints hold
  // to rough_tolerance and the scaled gradient (rad) is at most max_gradient.
  std::int64_t rough_steps = 12;
  double max_gradient = 0.5;
  // Changes of the set without a new minimum of wrong vertices after which vertices change one at a time: p of
  // Portugal, Judice, Vicente 1994, who use 10.
  std::int64_t patience = 10;
  std::int64_t max_set_changes = 200;
};

// All constants of the solver for angles.
struct FlattenTuning {
  NewtonTuning newton;
  StepTuning step;
  BoundaryTuning boundary;
  LinearTuning linear;
  MultigridTuning multigrid;
};

}  // namespace planish
