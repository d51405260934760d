// The constants of the packer that are chosen, not derived. Where nothing else is said, tests/bench/pack_time.cc chose
// them, by efficiency against work, on the charts of the shared assets and of tests/testing/families.h.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

namespace planish {

// Work is in nanoseconds of one core of 2022, counted in steps of the algorithms.
struct PackTuning {
  // What charts and their maps cost at least, from which PackEffort takes its share. Measured on atlases of 86 to 1,451
  // charts, where it was 10,000 to 40,000 a face; on generated meshes of 450,000 to 1,500,000 faces 10,000 to 15,000.
  double rest_per_face = 13'000, rest_per_chart = 50'000;
  // Faces up to which all count. Of more faces work grows with the fourth root (not with PackEffort::kBest): it gains
  // little there. Four nets of 444,000, 573,000, 173,000 and 507,000 faces fill 0.653, 0.595, 0.738 and 0.667 of the
  // texture with 100,000 and 0.649, 0.594, 0.738 and 0.665 with 60,000, for 0.96 of the time of the whole unwrap. With
  // the square root nets of 886,000 and 1,147,000 faces filled 0.02 more, for up to 1.18 times the time.
  double full_work_faces = 60'000;
  // Of the rest.
  double fast_share = 0.25, normal_share = 0.23, best_share = 50;
  // PackEffort::kNormal has so much for each chart beside its share, for most_charts_to_count of them at most, and no
  // more than charts_share of the rest: of many charts, normal_share is used up after one hop. For the same time 17
  // meshes, at five stretches, fill 0.7308 of the texture in the mean with a normal_share of 0.29 and nothing for
  // charts, 0.7337 with 0.24 and this. The six scans of the atlas bench fill 0.817 with both.
  double normal_per_chart = 150'000, most_charts_to_count = 500, charts_share = 0.15;
  // PackEffort::kNormal has so much in any case: for each of a few charts, for all of them at most, and for each of
  // many charts. 21 meshes of 6 to 634 charts fill, at four paddings, 0.739, 0.738 and 0.737 of the texture in the mean
  // with 2e6 and 20e6, 1.5e6 and 15e6, and 1.2e6 and 12e6.
  double least_per_few = 1.2e6, least_work = 12e6, least_per_chart = 25'000;

  // PackEffort::kBest has so much in any case: for each of a few charts, and for all of them at most.
  double best_per_few = 2e9, least_best_work = 60e9;

  // Trials (trial.h). Cells along a chart of average size, and along a tile: more lay charts closer and cost more.
  double cells_per_chart = 24;
  int fewest_cells = 192, most_cells = 2048;
  // Silhouettes are made for the largest of several grids. On others they are wider than the padding asks for, by so
  // many cells at most; and the grids are smaller by this part at most.
  double wider_padding = 0.02, most_smaller = 0.1;
  // Silhouettes of about a kilobyte that are kept from trial to trial: one for each face, but at least and at most so
  // many. Of thousands of charts of one face they would be most of the memory, which no estimate foresees.
  double fewest_silhouettes = 2048, most_silhouettes = 8192;
  // How far simplified outlines may lie from those of the charts, in cells.
  double simple_within = 0.02;
  // Turns that a trial tries of each chart, as a power of two: as many as leave room for so many trials. Turns by less
  // than a right angle are left to what follows: more trials lead farther (0.770 of the texture on eleven meshes at
  // four paddings with 16 turns, 0.778 with 4).
  int least_angles = 2, most_angles = 4, typical_trials = 5;
  // What a trial costs for a chart and a turn, and for each edge of its outline, about.
  double trial_work = 6000, trial_work_per_edge = 150;
  // Trials at one scale after the other: so many at least, and at most from the first on in which all charts find a
  // place. Those before are cheap, since they end at the first chart that finds none. The least number counts from
  // there on, too, as long as the bracket is too wide (below).
  int least_trials = 3, most_trials = 7;
  // How full of charts and padding the tiles are in the first trial; much more never fits.
  double first_fill = 0.85;
  // Factors between scales. The largest that fits is known well enough within the first; the bracket is wide, and worth
  // more trials than what comes after, above the second. Without a bracket scales change by the third at most; those of
  // few charts grow by the fourth at least.
  double known_within = 1.01, wide_bracket = 1.03, farthest_change = 1.12, upwards = 1.04;
  // A bracket that is not left even where trials of very many charts take more than all work. Narrower ones are: five
  // thousand triangles on random vertices, each a chart, fill 0.465 of the texture in place of 0.474, for two thirds of
  // the time of the whole unwrap.
  double too_wide = 1.05;

  // Tightening (tighten.h) begins with so much work for each chart, or not at all: it takes that to grow and to settle.
  double tighten_per_chart = 200'000;
  // Relative growth that is tried first, the least that is tried, and what is tried after that was too much, since
  // other places may lead farther. 21 meshes of 6 to 634 charts fill, at four paddings, 0.738, 0.740, 0.740 and 0.739
  // of the texture in the mean with a first step of 0.03, 0.045, 0.06 and 0.09.
  double first_step = 0.045, least_step = 0.003, step_again = 0.02;
  // The first step is for so many charts. It goes down with the square root of their number beyond that: where many
  // have grown, some do not come apart again.
  double first_step_charts = 60;
  // With less work there is one lane of hops. For the same time the six scans of the atlas bench, at five stretches and
  // two paddings, fill 0.8063 of the texture in the mean with two lanes, 0.8082 with one, 0.8086 with these first
  // steps.
  std::int64_t one_lane_work = 1'000'000'000;
  // Moves of single charts in a hop. With 200 and 2 in place of 300 and 3 packing takes 0.93 of the time, and the
  // copies of charts/tuning.h fill 0.8299 in place of 0.8307 of the texture.
  std::int64_t moves_at_once = 200, moves_at_once_per_chart = 2;
  // Charts that are rearranged, at most: more cost much memory, and find places too seldom. They only grow.
  std::size_t most_to_rearrange = 1000;
  // By how much of its record a hop of either lane may lead down (0.740 of the texture on those meshes; with 0 and
  // 0.002 0.739, with 0.002 and 0.02 0.739), and hops in vain after which the second lane goes back to the best.
  std::array<double, 2> hop_down = {0.001, 0.005};
  int hops_away = 2;
  // Growth and patience, in steps, at the end of a hop.
  double finest_growth = 0.0005;
  int finest_patience = 60;
  // Pixels along an average chart, and by how many of them charts may overlap; but only by so much of their thickness:
  // where thin charts cross, pushing does not help. koala and spot in 146 and 86 charts fill 0.839 and 0.846 of the
  // texture in 12 s with 20 pixels and a third of these moves, 0.844 and 0.850 with 28 pixels, 0.854 and 0.858 with
  // both.
  double pixels_per_chart = 28, rearranging_slack = 1, slack_of_thickness = 0.2;
  int separating_steps = 60;  // in which charts come apart or count as jammed
  // Shares of the work that the first growth and the settling at the end may take, and rounds of the latter. Other
  // arrangements grow, too, while less than others_share is done: with 0.4 nine generated meshes of 14 to 1,025 charts
  // fill 0.709 of the texture in the mean, with 0.1 0.717, and the shared meshes the same.
  double growing_share = 0.4, others_share = 0.1, settling_share = 1;
  int settling_rounds = 25;
  // In each round charts that are too near get so much more of the tolerance for a margin, beside what they lack, and
  // from the second round on all charts shrink by this factor. Without the first a chart that was 1e-5 out of the tile
  // took 22 rounds, in which corset shrank by 1.1 %. With 0.25 and 0.9998 in place of 0 and 0.9995 (and a first round
  // that shrinks nothing) 21 meshes at three paddings fill 0.7350 of the texture in the mean in place of 0.7310, for
  // less work.
  double settling_margin = 0.25, settling_shrink = 0.9998;

  // Trials in other orders than by size. A new order sorts by sizes that are changed at random, by up to half of this
  // share.
  double order_spread = 0.3;
  double large_area = 0.9;    // share of the area that charts have which are tried before all others
  double order_step = 1.005;  // from the scale of the best trial to the one that is tried next
  // The search for orders begins only with so many charts: fewer are better rearranged (eight meshes of 7 to 20 charts
  // at eight paddings fill 0.724 of the texture without it and 0.714 with it, seven of 21 to 169 charts 0.693 and
  // 0.700). And only if there is work left for so many trials of all charts: of many, few orders can be tried, and
  // those gain little for their time (eleven assemblies of 134 to 3,837 charts fill 0.707 of the texture; 0.711 in 1.18
  // times the time of the whole unwrap with 8 of the last trials, which had ended early). It has this share of the work
  // where tightening follows, and all of it otherwise.
  std::size_t charts_for_orders = 21;
  double fewest_orders = 12, orders_share = 0.35, best_orders_share = 0.05;  // the last with PackEffort::kBest
  int orders_in_vain = 25;  // changes of an order that do not help, after which a new order is taken
  // Chances that a change gives a chart a fixed turn (or frees it) instead of another place in the order, and that it
  // is made to the first chart for which there was no room.
  double turn_chance = 0.3, missing_chance = 0.2;
  int starts = 3;  // arrangements that tightening begins with

  // After a stop request, from so many charts on, what would take longer than some milliseconds ends at once.
  std::size_t many_charts = 300;
};

}  // namespace planish
