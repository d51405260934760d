// The constants that decide where charts end. Nobody has to set any; benches sweep them (tests/bench/chart_count.cc).
#pragma once

#include <cstdint>
#include <numbers>

namespace planish {

// Where charts are cut, and joined again, for the packer's sake. Areas are those of convex hulls.
struct PackerCuts {
  // Area saved by a cut, at least, in mean areas of charts, where a stretch of 1.05 is allowed. It grows with the
  // square of the stretch beyond 1: who allows more stretch wants fewer charts.
  double hull_gain;
  // So much more, over the number of charts: where charts are few, each cut makes many more of them.
  double few_hull_gain;
  // What a cut costs: a strip along it so wide, in sides of the square that all charts would fill.
  double cut_width;
  // Area that joining two charts may cost: this times what a cut must gain there.
  double join_gain;
};

// Chosen on spot, koala, boot_g12, human_neutral, box_animated and voxelsheets by the number of charts at equal L2
// stretch and by packing efficiency, both as planish_chart_count prints them. Ratios, unless a unit is given.
struct AtlasTuning {
  // ---- SeamOptions::max_stretch, by SeamOptions::prefer, where the caller says nothing.
  double seams_stretch = 1.25, texture_stretch = 1.05;

  // ---- The cost of seams (charts/seam_cost.h), in its units.
  // Of L2^2 - 1, and of a chart.
  double stretch_price = 15, chart_price = 0.02;
  double hidden_cost = 0.25;                            // of a seam that nobody sees, of one that is in full view
  double valley_discount = 0.85, ridge_discount = 0.7;  // of a seam where the surface bends by 60 degrees or more
  // Of the diagonal of what was likely a quad: as dear as the way round it.
  double diagonal_cost = std::numbers::sqrt2;
  double turn_cost = 0.5;  // of a right angle, of the edges next to it
  // The search (unwrap/seam_search.h) begins with charts of so little stretch, as they are merged for the packer.
  double seams_first_stretch = 1.05;
  int seam_rounds = 3;  // at most, of gluing charts and moving seams
  // Limits of the work: how many faces, per face of the surface, may be estimated again to glue charts and to move
  // seams. The first `thorough_faces` of the surface count twice.
  double glue_estimates = 6, move_estimates = 8;
  double thorough_faces = 20'000;
  int seam_band = 6;        // edges that a seam may be moved by at once
  double seam_slide = 0.3;  // how far its ends may be moved, in lengths of the seam

  // ---- Order in memory (unwrap/reordering.h).
  // Meshes of so many faces and more are unwrapped in spatial order; the caches hold smaller ones in any order.
  std::int64_t reordered_faces = 50'000;

  // ---- Patches (charts/patches.cc): the start, from which charts are merged.
  double patch_deviation = 0.08;  // 1 - length of the mean normal: a spherical cap of 33 degrees from its middle
  double patch_cosine = 0.7;      // least, between the mean normals of two patches that are joined

  // ---- Merging (charts/merging.cc).
  // Weight of an edge of a joint: the cosine of the bend, but at least this, so that right angles are joined last.
  double sharp_weight = 0.02;
  // Least 4 pi area / perimeter^2 of a chart: 1 for a disc, 0.12 for a strip of 1 to 24; less only where the larger
  // part has less already. With 0.07 boot_g12 has 52 charts instead of 66 and voxelnet_noisy_123676 883 instead of
  // 1,007, for a quarter more of the time: longer charts run over themselves more often and are cut and solved again.
  double compactness = 0.12;
  // Stretch beyond 1 that is allowed at first, where SeamOptions::max_stretch is above that, and by which factor it
  // then grows. With all allowed at once, more of it made more charts: boot_g12 and human_neutral had 32 and 50 charts
  // at 1.22, 28 and 32 at 1.28, 31 and 51 at 1.3. In steps they have 32 and 51, 27 and 40, 24 and 35.
  double first_stretch = 0.05, stretch_growth = 2;
  // No vertex of an outline opens wider, radians: next to a saddle a disc with 2 pi and more there would run over
  // itself when it is flattened.
  double widest = 1.85 * std::numbers::pi;
  double seams_widest = 1.95 * std::numbers::pi;

  // ---- Stretch estimates (charts/stretch_estimate.h).
  double estimate_tolerance = 1e-2;  // of the residual (charts/poisson_solver.h)
  int estimate_iterations = 200;     // at most, of conjugate gradients
  double map_tolerance = 1e-3;       // the same where an outline is made of the estimate (unwrap/chart_estimate.h)
  double estimate_cotangent = 1e4;   // at most: of angles below 0.006 degrees an estimate need not resolve more
  // What a small disc changes in a large one is solved for on so many faces of the large one for each of the small
  // one's, those next to it, as long as the large one has grown by less than the second number since it was last
  // solved for as a whole.
  int estimate_reach = 8;
  double estimate_growth = 1;
  // All that borders on a disc is queued anew, with its outline as it is then, when the disc has so many more faces, as
  // a share; until then only what borders on the faces that joined it. Without that, a sheet that takes in thousands of
  // small discs costs its outline for each.
  double outline_growth = 0.02;

  // ---- Smoothing of outlines (charts/smoothing.cc).
  int smoothing_sweeps = 40;          // at most
  double smoothing_sharp_cost = 0.1;  // of an edge at which the surface bends by a right angle or more, per length

  // ---- Cuts by estimates of maps, and once maps are known (unwrap/refine.cc). Lengths in sides of the square that all
  // charts would fill.
  // Steps of Newton's method, at most: a chart that takes more is cut. Others take 5 to 8 of them, and up to 20 with a
  // barrier on the way.
  int newton_steps = 30;
  // Limits of FlattenWork::work. The first is for one solve of a chart that cannot be cut, with SeamPolicy::kKeep and
  // kNone or because the chart is one polygon. On the shared meshes the median of a solve is 29; without a barrier the
  // largest is 182.
  std::int64_t most_work = 5000;
  // With SeamPolicy::kNeeded the first of these limits the solve of a chart within its borders, the second all other
  // maps that are tried afterwards (unwrap/fixed_borders.cc). On the shared meshes the median is 212 where a barrier
  // stays, 226 for charts with filled holes and 198 for convex outlines. The largest is 7,000; most maps that take that
  // much are too stretched to be used.
  std::int64_t needed_work = 400, other_map_work = 400;
  // With SeamPolicy::kNeeded this limits all solves of a job together, per face of the mesh. Beyond it, charts are cut
  // where their solves are hard, as with SeamPolicy::kAuto, and no other map is tried.
  double all_needed_work = 900;
  double max_extent = 1.4;  // diameter of a chart; longer ones hardly fit
  // A chart with more of the surface, as a share, may be longer, up to most_extent: a torus in one chart fills 0.34 of
  // the texture, in three 0.69.
  double whole_area = 0.6, most_extent = 2;
  // The same with SeamPreference::kSeams: a strip of 1 to 16 stays whole, since people do not cut it.
  double seams_most_extent = 4;
  // A chart is too long only from this times the length of the longest face on, since no cut makes that face shorter.
  double longer_than_face = 1.5;

  // ---- Faces longer than max_extent that no cut shortens (unwrap/long_needles.h). On a mesh of 19,704 faces of which
  // 4,637 are such needles, the texture was used to 1e-4 when all was drawn to one scale.
  double needle_aspect = 1e3;  // longest edge over altitude, at least
  double needle_faces = 0.5;   // of all faces, at most: otherwise needles are what the mesh is made of
  double needle_length = 0.5;  // at most, when drawn, in sides of the square that all other faces would fill
  double needle_room = 0.1;    // of the texture that all charts of needles take, padding included, at most

  // ---- Cuts for the packer, by estimates of maps (pack/necks.h), and joints that undo some of them.
  // With cut_width of 0.01 and join_gain of 0.25 the six scans of the atlas bench have 383, 434 and 471 charts and fill
  // 0.795, 0.799 and 0.802 of the texture in the mean with a hull_gain of 0.05, 0.025 and 0.0125. With the numbers
  // below, but a cut_width of 0.014, they had 423 and filled 0.817, and 18 other meshes had 2,089 charts in place of
  // 2,340 and filled 0.729 in place of 0.693.
  //
  // Of 20 meshes of 1 to 104 charts, 1,280 to 30,720 faces each, with few_hull_gain of 0, 0.03 and 0.1 there are 540,
  // 507 and 462 charts, and they fill 0.759, 0.756 and 0.739.
  //
  // With a cut_width of 0.014, 0.012 and 0.011 the six scans, at five stretches and two paddings, have 71, 75 and 77
  // charts in the mean and fill 0.8086, 0.8095 and 0.8114 of the texture; 17 other meshes have 201, 212 and 215 and
  // fill 0.7243, 0.7268 and 0.7262. Eight copies of each scan, whose vertices differ by 1e-6 of its size, have 75, 80,
  // 82 and 87 charts in the mean and fill 0.8242, 0.8288, 0.8307 and 0.8306 of the texture with 0.011, 0.009, 0.0085
  // and 0.007.
  //
  // The second set, of PackEffort::kBest, makes more charts for more of the texture. Spot, koala and boot_g12 at three
  // stretches, with 4 s for each packing, fill 0.836, 0.846, 0.843 and 0.838 of it in the mean with a cut_width of
  // 0.002, 0.005, 0.008 and 0.011 and a hull_gain of 0.0003. With a minute koala and human_neutral fill 0.845 and 0.848
  // with that and 0.005, 0.853 and 0.856 with a hull_gain of 0.0001. With 0 they fill 0.854 and 0.862, but more
  // stretch allowed may make more charts: a ball had 11 at 1.02 and 13 at 1.5.
  PackerCuts packer_cuts = {.hull_gain = 0.003, .few_hull_gain = 0.03, .cut_width = 0.0085, .join_gain = 0.7};
  PackerCuts best_packer_cuts = {.hull_gain = 0.0001, .few_hull_gain = 0, .cut_width = 0.005, .join_gain = 0.25};
  // Of a chart in the mean, at least, after these cuts: boxes stay boxes. But so many more charts, as a share, in any
  // case.
  double cut_faces = 9, cut_growth = 0.2;

  // ---- Charts that are joined by estimates of their maps, and once maps are known (unwrap/joining.cc). With
  // join_faces of 1, 0.5 and 0.25 a surface net of 452,424 faces has 349, 374 and 392 charts, and 469 with 1 and no
  // estimates.
  int join_rounds = 12;     // at most
  double join_faces = 0.5;  // faces that are solved again, at most: this times those of the surface
  // But no more than so many, since large surfaces gain little. When the number grew with the square root from 50,000
  // on, nets of 444,216 and 573,048 faces had 387 and 1,103 charts, now 410 and 1,158. Joining took 0.058 of the time
  // of the first then, and takes 0.032.
  double most_join_faces = 5e4;
  double join_estimates = 4;  // faces whose maps are estimated again, at most: this times those of the surface
  double join_misfit = 0.1;   // of the two outlines where they are to meet, root mean square over the length
};

}  // namespace planish
