// The constants that decide where charts end. Callers keep the defaults; benches sweep them
// (tests/bench/chart_count.cc).
#pragma once

#include <algorithm>
#include <cstdint>
#include <numbers>

namespace planish {

// Largest angles at vertices of an outline, radians: where a slit ends, and elsewhere.
struct WidestAngles {
  double vertex, tip;
};

// When charts are cut, and joined again, to help the packer. Areas are those of convex hulls.
struct PackerCuts {
  // The area that a cut must save, in mean areas of charts, if a stretch of 1.05 is allowed. Grows with the square of
  // the allowed stretch minus 1, since users who allow more stretch want fewer charts.
  double hull_gain;
  // Divided by the number of charts, this is added to hull_gain: where charts are few, each cut adds a large part to
  // their number.
  double few_hull_gain;
  // The cost of a cut: the area of a strip along it of this width, in sides of the square that all charts would fill.
  double cut_width;
  // Joining two charts may cost this times the area that a cut between them would have to save.
  double join_gain;
};

// Chosen on spot, koala, boot_g12, human_neutral, box_animated and voxelsheets by the number of charts at equal L2
// stretch and by packing efficiency, both as planish_chart_count prints them. Ratios, unless a unit is given.
struct AtlasTuning {
  // ---- Defaults of SeamOptions::max_stretch, for each SeamOptions::prefer.
  double seams_stretch = 1.25, texture_stretch = 1.05;

  // ---- The cost of seams (charts/seam_cost.h), in its units.
  // The prices of L2^2 - 1, of a chart, and of the area between maps and their convex hulls. A waste_price of 4
  // and a seams_first_stretch of 1.15 replaced 1 and 1.05: visible seams became 0.94 times as long on 62 meshes and
  // 0.85 times on 36 others, 0.03 more of the texture was filled, and L2 - 1 grew to 1.2 times. With a stretch_price of
  // 20, seams are 1 % longer, and L2 - 1 grows to 1.13 times.
  double stretch_price = 15, chart_price = 0.02, waste_price = 4;
  double hidden_cost = 0.25;                            // of an invisible seam; a fully visible one costs 1
  double valley_discount = 0.85, ridge_discount = 0.7;  // of seams where the surface bends by 60 degrees or more
  // Factor for an edge that probably was the diagonal of a quad: it costs as much as the path along two sides.
  double diagonal_cost = std::numbers::sqrt2;
  double turn_cost = 0.5;  // of a right angle, in costs of the edges next to it
  // The search (unwrap/seam_search.h) begins with charts that are merged, as for kTexture, up to this stretch.
  double seams_first_stretch = 1.15;
  int seam_rounds = 3;  // most rounds, each of gluing charts and moving seams
  // Work limits: the number of faces, per face of the surface, that may be estimated again to glue charts, and to move
  // seams. The first `thorough_faces` faces of the surface count twice.
  double glue_estimates = 6, move_estimates = 8;
  // The same to glue parts of borders, in all rounds together.
  double dart_estimates = 9;
  // The same to glue charts of at most the share `crumb_area` of the surface, at the end. Without it, 62 meshes have
  // 1.03 times as many charts, a net of 65,812 faces 86 instead of 64, in the same time.
  double crumb_estimates = 3, crumb_area = 0.002;
  double thorough_faces = 20'000;
  // Number of edges by which a seam may move at once: first, and if that failed. The second straightens seams that
  // cannot go elsewhere: on 98 meshes they turn by 22.3 degrees instead of 23.5, in 1.02 of the time.
  int seam_band = 6, narrow_seam_band = 2;
  double seam_slide = 0.3;  // how far the ends of a seam may move, in lengths of the seam

  // Most faces of a nearly symmetrical mesh on which charts are first made (unwrap/segment_folded.cc); larger ones are
  // simplified to that many. With 1,000 to 6,000 and with all, seams are equally long.
  std::int64_t folded_faces = 3'000;

  // ---- Order in memory (unwrap/reordering.h).
  // Meshes of at least this many faces are unwrapped in spatial order; smaller ones fit the caches in any order.
  std::int64_t reordered_faces = 50'000;

  // ---- Patches (charts/patches.cc), from which charts are merged.
  double patch_deviation = 0.08;  // 1 - length of the mean normal: a spherical cap of 33 degrees from its middle
  double patch_cosine = 0.7;      // least cosine between the mean normals of two patches that are joined

  // ---- Merging (charts/merging.cc).
  // Weight of an edge of a joint: the cosine of the bend, but at least this, so that right angles are joined last.
  double sharp_weight = 0.02;
  // Least compactness 4 pi area / perimeter^2 of a chart: 1 for a circle, 0.12 for a strip of 1 to 24. A joint may go
  // below it only if the larger part is below it already and does not get worse. With 0.07, boot_g12 has 52 charts
  // instead of 66 and voxelnet_noisy_123676 883 instead of 1,007, in a quarter more time: longer charts overlap
  // themselves more often and are cut and solved again.
  double compactness = 0.12;
  // The limit of stretch minus 1 with which merging begins, and the factor of its growth until SeamOptions::max_stretch
  // is reached. With the full limit from the start, more stretch could make more charts: boot_g12 and human_neutral had
  // 32 and 50 charts at 1.22, 28 and 32 at 1.28, 31 and 51 at 1.3. In steps they have 32 and 51, 27 and 40, 24 and 35.
  double first_stretch = 0.05, stretch_growth = 2;
  // Largest angle at a vertex of an outline, radians. Next to a saddle it could be 2 pi and more, and the disc would
  // overlap itself when it is flattened. The second holds with SeamPreference::kSeams. `widest_tip` holds where a slit
  // ends, if it is larger: below 2 pi a slit opens there.
  double widest = 1.85 * std::numbers::pi;
  double seams_widest = 1.95 * std::numbers::pi;
  double widest_tip = 0;
  double seams_widest_tip = 2 * std::numbers::pi - 1e-3;
  WidestAngles Widest() const { return {widest, std::max(widest, widest_tip)}; }

  // ---- Stretch estimates (charts/stretch_estimate.h).
  double estimate_tolerance = 1e-2;  // tolerance of PoissonSolver::Solve()
  int estimate_iterations = 200;     // most iterations of conjugate gradients
  // The same where an outline is made of the estimate (unwrap/chart_estimate.h). With 1e-2, charts for the packer are
  // 1.7 % more, and those for seams the same.
  double map_tolerance = 1e-3, seams_map_tolerance = 1e-2;
  double estimate_cotangent = 1e4;  // largest cotangent, of 0.006 degrees; smaller angles count as this
  // When a small disc is merged into a large one, u is solved for on the small disc and on `estimate_reach` faces of
  // the large disc for each of its own, those next to the joint. Once the large disc has grown by the share
  // `estimate_growth` since its last full solve, it is solved for as a whole.
  int estimate_reach = 8;
  double estimate_growth = 1;
  // After a merge, only the joints next to the added faces are queued again. Once the disc has grown by this share, all
  // its joints are. Queuing all of them each time would walk the whole outline of a sheet for each of the thousands of
  // small discs that it absorbs.
  double outline_growth = 0.02;

  // ---- Smoothing of outlines (charts/smoothing.cc).
  int smoothing_sweeps = 40;          // most sweeps
  double smoothing_sharp_cost = 0.1;  // cost per length of an edge where the surface bends by 90 degrees or more

  // ---- Cuts, first by estimates of maps, then by the maps (unwrap/refine.cc). Lengths are in sides of the square that
  // all charts would fill.
  // Most steps of Newton's method: a chart that takes more is cut. Most charts take 5 to 8 steps, or up to 20 if they
  // need a barrier on the way.
  int newton_steps = 30;
  // Limits of FlattenWork::work. The first is for one solve of a chart that cannot be cut, with SeamPolicy::kKeep and
  // kNone or because the chart is one polygon. On the shared meshes the median of a solve is 29; without a barrier the
  // largest is 182.
  std::int64_t most_work = 5000;
  // With SeamPolicy::kNeeded, needed_work limits the first solve of a chart, and other_map_work limits all other maps
  // of the chart that are tried afterwards (unwrap/fixed_borders.cc). On the shared meshes the median is 212 where a
  // barrier stays, 226 for charts with filled holes and 198 for convex outlines. The largest is 7,000; most maps that
  // take that much are too stretched to be used.
  std::int64_t needed_work = 400, other_map_work = 400;
  // With SeamPolicy::kNeeded this limits all solves of a job together, per face of the mesh. Beyond it, charts are cut
  // where their solves are hard, as with SeamPolicy::kAuto, and no other map is tried.
  double all_needed_work = 900;
  double max_extent = 1.4;  // largest diameter of a chart; longer ones hardly fit
  // A chart with more than the share `whole_area` of the surface may have a diameter of most_extent instead. (A torus
  // in one chart fills 0.34 of the texture, in three charts 0.69.)
  double whole_area = 0.6, most_extent = 2;
  // With SeamPreference::kSeams, the largest diameter of a chart that is the whole surface: a strip of 1 to 16 stays
  // whole, since people do not cut such strips.
  double seams_most_extent = 4;
  // A chart up to this times as long as its atlas's longest face is not too long, since no cut makes a face shorter.
  double longer_than_face = 1.5;

  // ---- Faces longer than max_extent that no cut shortens (unwrap/long_needles.h). When all faces of a mesh of 19,704,
  // of which 4,637 are such needles, were drawn to one scale, charts covered 1e-4 of the texture.
  double needle_aspect = 1e3;  // least ratio of the longest edge to its altitude
  double needle_faces = 0.5;   // largest share of the faces; if there are more, none is drawn smaller
  double needle_length = 0.5;  // largest length when drawn, in sides of the square of all other faces
  double needle_room = 0.1;    // largest share of the texture for all charts of needles, with padding

  // ---- Cuts for the packer, by estimates of maps (pack/necks.h), and joints that undo some of them.
  // With a cut_width of 0.01, a join_gain of 0.25 and a hull_gain of 0.05, 0.025 and 0.0125, the six scans of the atlas
  // bench have 383, 434 and 471 charts and fill 0.795, 0.799 and 0.802 of the texture on average. With the numbers
  // below, but a cut_width of 0.014, they had 423 charts and filled 0.817, and 18 other meshes had 2,089 charts instead
  // of 2,340 and filled 0.729 instead of 0.693.
  //
  // With a few_hull_gain of 0, 0.03 and 0.1, 20 meshes of 1,280 to 30,720 faces, with 1 to 104 charts each, have 540,
  // 507 and 462 charts in all and fill 0.759, 0.756 and 0.739.
  //
  // With a cut_width of 0.014, 0.012 and 0.011 the six scans, at five stretches and two paddings, have 71, 75 and 77
  // charts on average and fill 0.8086, 0.8095 and 0.8114 of the texture; 17 other meshes have 201, 212 and 215 and fill
  // 0.7243, 0.7268 and 0.7262. With 0.011, 0.009, 0.0085 and 0.007, eight copies of each scan, whose vertices differ by
  // 1e-6 of its size, have 75, 80, 82 and 87 charts on average and fill 0.8242, 0.8288, 0.8307 and 0.8306 of the
  // texture.
  //
  // The second set, for PackEffort::kBest, makes more charts to fill more of the texture. With a hull_gain of 0.0003
  // and a cut_width of 0.002, 0.005, 0.008 and 0.011, spot, koala and boot_g12 at three stretches, with 4 s for each
  // packing, fill 0.836, 0.846, 0.843 and 0.838 on average. With a minute and a cut_width of 0.005, koala and
  // human_neutral fill 0.845 and 0.848 with a hull_gain of 0.0003, 0.853 and 0.856 with 0.0001, and 0.854 and 0.862
  // with 0. But with 0, a higher limit of stretch may make more charts: a ball had 11 at 1.02 and 13 at 1.5.
  PackerCuts packer_cuts = {.hull_gain = 0.003, .few_hull_gain = 0.03, .cut_width = 0.0085, .join_gain = 0.7};
  PackerCuts best_packer_cuts = {.hull_gain = 0.0001, .few_hull_gain = 0, .cut_width = 0.005, .join_gain = 0.25};
  // These cuts leave at least cut_faces faces per chart on average, so that a box is not cut into its sides. But they
  // may always add the share cut_growth of the charts.
  double cut_faces = 9, cut_growth = 0.2;

  // ---- Joining of charts, first by estimates of their maps, then by the maps (unwrap/joining.cc). With join_faces of
  // 1, 0.5 and 0.25 a surface net of 452,424 faces has 349, 374 and 392 charts, and 469 with 1 and no estimates.
  int join_rounds = 12;     // most rounds
  double join_faces = 0.5;  // most faces that are solved again, per face of the surface
  // The most faces that are solved again for a surface of any size, since large surfaces gain little. When this number
  // grew with the square root from 50,000 on, nets of 444,216 and 573,048 faces had 387 and 1,103 charts; now they have
  // 410 and 1,158. Joining took 0.058 of the time of the first then, and takes 0.032 now.
  double most_join_faces = 5e4;
  double join_estimates = 4;  // most faces whose maps are estimated again, per face of the surface
  double join_misfit = 0.1;   // largest misfit of the two outlines along the joint, root mean square over length
};

}  // namespace planish
