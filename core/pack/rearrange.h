// Removes small overlaps: moves charts to new places, near or far, by guided local search.
#pragma once

#include <cstdint>
#include <vector>

#include "core/base/execution.h"
#include "core/pack/relax.h"

namespace planish {

struct RearrangeOptions : PackRules {
  int side = 128;                 // pixels along a tile; charts that overlap by less than half a pixel count as apart
  std::int64_t moves = 1000;      // at most, of single charts
  std::int64_t work = INT64_MAX;  // at most, in about nanoseconds
  double slack = 0.5;             // pixels by which charts may overlap, since places are whole pixels
  std::uint64_t seed = 0;
};

// Guided local search as in the overlap minimization of Egeblad, Nielsen and Odgaard, "Fast neighborhood search for
// two- and three-dimensional nesting problems" (2007), with random places as in Gardeyn and Wauters, "An open-source
// heuristic to reboot 2D nesting research" (2025), but on images. Every pixel holds its depth in the charts there,
// times their weights. One chart after the other is taken out and placed where the pixels under its samples have the
// least sum. Pairs of charts that keep overlapping gain weight. Each chart stays on the tiles of its atlas.
//
// Returns whether no overlaps are left (except for half a pixel). *poses becomes the arrangement with the least
// overlap. Adds the cost in about nanoseconds, counted in steps of the algorithm, to *work.
bool Rearrange(const std::vector<Outline>& outlines, const std::vector<int>& atlas,
               const std::vector<DistanceField>& fields, const std::vector<double>& scales,
               const RearrangeOptions& options, const Execution& execution, std::vector<Pose>* poses,
               std::int64_t* work);

}  // namespace planish
