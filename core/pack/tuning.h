// Constants of the packer that were chosen rather than derived. Unless a comment says otherwise,
// tests/bench/pack_time.cc chose them, by efficiency against work, on the charts of the shared assets and of
// tests/testing/families.h.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

namespace planish {

// Work is in nanoseconds of one core of 2022, counted in steps of the algorithms.
struct PackTuning {
  // The least cost of charts and their maps ("the rest"), of which PackEffort takes its share. Measured on atlases of
  // 86 to 1,451 charts, where it was 10,000 to 40,000 a face; on generated meshes of 450,000 to 1,500,000 faces, 10,000
  // to 15,000.
  double rest_per_face = 13'000, rest_per_chart = 50'000;
  // Work is proportional to the faces up to this number. Beyond it, work grows with their fourth root (not with
  // PackEffort::kBest), since more gains little. Four nets of 444,000, 573,000, 173,000 and 507,000 faces fill 0.653,
  // 0.595, 0.738 and 0.667 of the texture with 100,000, and 0.649, 0.594, 0.738 and 0.665 with 60,000, for 0.96 of the
  // time of the whole unwrap. With the square root, nets of 886,000 and 1,147,000 faces filled 0.02 more, for up to
  // 1.18 times the time.
  double full_work_faces = 60'000;
  // Work as a share of the rest.
  double fast_share = 0.25, normal_share = 0.23, best_share = 50;
  // PackEffort::kNormal adds this work for each chart, for at most most_charts_to_count charts and at most charts_share
  // of the rest: with many charts, normal_share alone is used up after one hop. For the same time, 17 meshes at five
  // stretch limits fill 0.7308 of the texture on average with a normal_share of 0.29 and nothing for charts, 0.7337
  // with 0.24 and this. The six scans of the atlas bench fill 0.817 with both.
  double normal_per_chart = 150'000, most_charts_to_count = 500, charts_share = 0.15;
  // Least work of PackEffort::kNormal: least_per_few for each chart up to least_work in total, or least_per_chart for
  // each chart, if that is more. 21 meshes of 6 to 634 charts fill, at four paddings, 0.739, 0.738 and 0.737 of the
  // texture on average with 2e6 and 20e6, 1.5e6 and 15e6, and 1.2e6 and 12e6.
  double least_per_few = 1.2e6, least_work = 12e6, least_per_chart = 25'000;

  // Least work of PackEffort::kBest: best_per_few for each chart, up to least_best_work in total.
  double best_per_few = 2e9, least_best_work = 60e9;

  // Trials (trial.h). Cells along an average chart, and along a tile. More cells place charts closer and cost more.
  double cells_per_chart = 24;
  int fewest_cells = 192, most_cells = 2048;
  // Silhouettes are made for the largest of several grids. On smaller grids they are wider than the padding asks for,
  // by at most wider_padding cells; and those grids are smaller by at most this fraction.
  double wider_padding = 0.02, most_smaller = 0.1;
  // Silhouettes (about a kilobyte each) kept from trial to trial: one for each face, within these bounds. For thousands
  // of charts of one face they would take most of the memory, which no estimate foresees.
  double fewest_silhouettes = 2048, most_silhouettes = 8192;
  // Bound of the distance between simplified and exact outlines, in cells.
  double simple_within = 0.02;
  // Angles that a trial tries for each chart, a power of two: as many as leave work for typical_trials trials. Finer
  // angles are left to later steps, since more trials gain more (0.770 of the texture on eleven meshes at four paddings
  // with 16 angles, 0.778 with 4).
  int least_angles = 2, most_angles = 4, typical_trials = 5;
  // Approximate cost of a trial for a chart and an angle, and for each edge of its outline.
  double trial_work = 6000, trial_work_per_edge = 150;
  // Number of trials at different scales: at least the first, and at most the second from the trial on in which all
  // charts first found a place. Trials before that are cheap, as they end at the first chart without a place. While the
  // bracket is too wide (below), the least number counts from there too.
  int least_trials = 3, most_trials = 7;
  // Share of the tiles that charts and padding fill in the first trial; much more never fits.
  double first_fill = 0.85;
  // Ratios of scales. The largest scale that fits is known well enough within known_within. As long as the least scale
  // that does not fit is more than wide_bracket times the largest that fits, more trials gain more than later steps do.
  // Before both scales are known, scales change by at most farthest_change; with few charts they grow by at least
  // `upwards`.
  double known_within = 1.01, wide_bracket = 1.03, farthest_change = 1.12, upwards = 1.04;
  // A bracket wider than this is narrowed even if trials of very many charts take more than all of the work. Narrower
  // ones are not: five thousand triangles on random vertices, each a chart, fill 0.465 of the texture in place of
  // 0.474, for two thirds of the time of the whole unwrap.
  double too_wide = 1.05;

  // Tightening (tighten.h) begins only with this much work for each chart, which it needs to grow and to settle.
  double tighten_per_chart = 200'000;
  // Relative growth of hops: the first, the least, and the one used after the least failed, since other places may lead
  // farther. 21 meshes of 6 to 634 charts fill, at four paddings, 0.738, 0.740, 0.740 and 0.739 of the texture on
  // average with a first step of 0.03, 0.045, 0.06 and 0.09.
  double first_step = 0.045, least_step = 0.003, step_again = 0.02;
  // The first step is for this many charts. Beyond that it shrinks with the square root of their number: when many
  // charts have grown, some cannot be separated again.
  double first_step_charts = 60;
  // With less work there is one lane of hops. For the same time the six scans of the atlas bench, at five stretch
  // limits and two paddings, fill 0.8063 of the texture on average with two lanes, 0.8082 with one, and 0.8086 with one
  // and this first_step.
  std::int64_t one_lane_work = 1'000'000'000;
  // Moves of single charts in a hop. With 200 and 2 in place of 300 and 3, packing takes 0.93 of the time, and the
  // copies of scans that charts/tuning.h describes fill 0.8299 in place of 0.8307 of the texture.
  std::int64_t moves_at_once = 200, moves_at_once_per_chart = 2;
  // More charts than this are not rearranged, which would take much memory and seldom find places. They only grow.
  std::size_t most_to_rearrange = 1000;
  // For each of the two lanes: by what share a hop's scale may be below the lane's record. The 21 meshes above fill
  // 0.740 of the texture; with 0 and 0.002 0.739, with 0.002 and 0.02 0.739. `hops_away`: the hops without a record
  // after which the second lane returns to the best arrangement.
  std::array<double, 2> hop_down = {0.001, 0.005};
  int hops_away = 2;
  // Growth and patience (in steps) at the end of a hop.
  double finest_growth = 0.0005;
  int finest_patience = 60;
  // Pixels along an average chart, and by how many pixels charts may overlap; but at most by slack_of_thickness of
  // their thickness: where thin charts cross, pushing does not help. koala and spot in 146 and 86 charts fill 0.839 and
  // 0.846 of the texture in 12 s with 20 pixels and a third of these moves, 0.844 and 0.850 with 28 pixels, 0.854 and
  // 0.858 with both.
  double pixels_per_chart = 28, rearranging_slack = 1, slack_of_thickness = 0.2;
  int separating_steps = 60;  // after this many steps, charts that are not apart count as jammed
  // Shares of the work that the first growth and the final settling may take, and rounds of the latter. Other starts
  // are grown too while less than others_share is spent: with 0.4, nine generated meshes of 14 to 1,025 charts fill
  // 0.709 of the texture on average, with 0.1 0.717, and the shared meshes the same.
  double growing_share = 0.4, others_share = 0.1, settling_share = 1;
  int settling_rounds = 25;
  // In each round the margin of charts that are too near grows by what is missing and settling_margin of the tolerance,
  // and from the second round on all charts shrink by settling_shrink. Without the former, a chart that was 1e-5 out of
  // the tile took 22 rounds, in which corset shrank by 1.1 %. With 0.25 and 0.9998 in place of 0 and 0.9995 (and a
  // first round that shrinks nothing), 21 meshes at three paddings fill 0.7350 of the texture on average in place of
  // 0.7310, for less work.
  double settling_margin = 0.25, settling_shrink = 0.9998;

  // Trials in orders other than by size. A new order sorts by sizes that are changed at random, by up to half of this
  // share.
  double order_spread = 0.3;
  double large_area = 0.9;    // charts with this share of the area are tried first
  double order_step = 1.005;  // scale of the next trial over that of the best one
  // Orders are searched only from this many charts on: fewer are better rearranged (eight meshes of 7 to 20 charts at
  // eight paddings fill 0.724 of the texture without the search and 0.714 with it, seven of 21 to 169 charts 0.693 and
  // 0.700). And only if fewest_orders trials of all charts fit into the remaining work: with many charts few orders can
  // be tried, and those gain little for their time (eleven assemblies of 134 to 3,837 charts fill 0.707 of the texture;
  // 0.711 in 1.18 times the time of the whole unwrap with 8 of the last trials, which had ended early). The search gets
  // this share of the work if tightening follows, and all of it otherwise.
  std::size_t charts_for_orders = 21;
  double fewest_orders = 12, orders_share = 0.35, best_orders_share = 0.05;  // the last with kBest
  int orders_in_vain = 25;  // changes without progress after which a new order is taken
  // Probabilities that a change fixes the angle of a chart (or frees it) instead of moving it in the order, and that a
  // change concerns the first chart without a place.
  double turn_chance = 0.3, missing_chance = 0.2;
  int starts = 3;  // arrangements that tightening begins with

  // From this many charts on, a stop request ends at once whatever would take longer than some milliseconds.
  std::size_t many_charts = 300;
};

}  // namespace planish
