// A tile while charts are laid on it: which cells are taken, and where a silhouette still fits.
#pragma once

#include <cstdint>
#include <vector>

#include "core/pack/silhouette.h"

namespace planish {

// Cells of a silhouette's surroundings, to measure how snugly it lies: offsets from its corner (0, 0).
struct Rim {
  struct Cell {
    std::int32_t x, y;
  };
  std::vector<Cell> cells;
};

// At most `most` cells that touch the silhouette from outside, evenly along it.
Rim MakeRim(const Silhouette& silhouette, int most);

struct Spot {
  int x = 0, y = 0;
  double snugness = -1;  // share of the rim's cells that are taken
};

// Bit-parallel: a search looks at 64 places at once. For every row of cells the board also keeps, for each power of
// two, which runs of that length hold a taken cell, so that a span of any length is tested by two looks.
class Board {
 public:
  static constexpr int kMargin = 2;  // cells round the free square that count as taken

  // side x side free cells, from (kMargin, kMargin) on.
  explicit Board(int side);

  int side() const { return side_; }
  bool IsTaken(int x, int y) const { return (Row(0, y)[x >> 6] >> (x & 63) & 1) != 0; }

  bool Fits(const Silhouette& silhouette, int x, int y) const;
  // What lies beyond the board is left out.
  void Add(const Silhouette& silhouette, int x, int y);

  // From row `first` on: looks at the places where the silhouette fits but cannot move both ways along u, nor both ways
  // along v. Replaces *best by the snuggest if that is snugger; of equals the one nearest to the corner (0, 0) counts.
  // Takes the first that is as snug as `enough`.
  void FindSpot(const Silhouette& silhouette, const Rim& rim, double enough, int first, Spot* best) const;

 private:
  const std::uint64_t* Row(int level, int y) const {
    return levels_[level].data() + static_cast<std::size_t>(y) * stride_;
  }
  // Places in row y, one bit each; returns whether there are any.
  bool FreePlaces(const Silhouette& silhouette, const std::vector<std::int32_t>& row_order, int y,
                  std::uint64_t* places, int words) const;

  int side_, size_, stride_;
  // Level k, row y, bit x: whether one of the cells x .. x + 2^k - 1 is taken. Two words more than a row needs.
  std::vector<std::vector<std::uint64_t>> levels_;
};

}  // namespace planish
