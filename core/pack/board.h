// A tile while charts are laid on it: which cells are taken, and where a silhouette still fits.
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "core/pack/silhouette.h"

namespace planish {

// Cells that touch a silhouette from outside, by which Board measures how snugly it lies: offsets from its corner (0,
// 0).
struct Rim {
  struct Cell {
    std::int16_t x, y;
  };
  std::vector<Cell> cells;
};

// The spans of a silhouette as Board looks for room for them, those that rule out most places first.
struct Probes {
  // A span is free where two runs of 2^level cells are that cover it.
  struct Probe {
    std::int16_t row;
    std::int16_t words[2];  // where the runs begin: words, and bits in these
    std::int8_t bits[2];
    std::int8_t level;
  };

  Probes() = default;
  explicit Probes(const Silhouette& silhouette);

  std::vector<Probe> all;
  // The longest spans of the first few rows.
  struct Longest {
    std::int32_t row, length;
  };
  static constexpr std::size_t kChecked = 4;
  std::array<Longest, kChecked> longest = {};
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
  static constexpr int kMargin = 2;           // cells round the free square that count as taken
  static constexpr int kMostCells = 1 << 14;  // along a side; Probes and Rim hold places as 16 bits

  // Of at most most_side x most_side cells (kMostCells), for silhouettes at most `longest` cells wide. Clear() comes
  // first.
  Board(int most_side, int longest);
  // side x side cells are free, from (kMargin, kMargin) on. Adds the words that it wrote to *work.
  void Clear(int side, std::int64_t* work);

  bool IsTaken(int x, int y) const { return (Row(0, y)[x >> 6] >> (x & 63) & 1) != 0; }

  // Takes every cell of this board that has a part of a cell of the silhouette, whose corner (0, 0) lies at the place
  // (x, y) in cells from the corner of the free square. The cells of the silhouette are smaller than those of the
  // board by a factor of 2^shift. What lies beyond the board is left out. Adds the words that it wrote to *work.
  void Add(const Silhouette& silhouette, int x, int y, int shift, std::int64_t* work);

  // From row `first` up to `rows_beyond` rows beyond the first row with a place, which must not lie beyond `last`:
  // looks at the places where the silhouette fits but cannot move both ways along u, nor both ways along v. Replaces
  // *best by the snuggest if that is snugger; of equals the one nearest to the corner (0, 0) counts. Returns the first
  // row with a place, -1 if there is none. Adds nanoseconds to *work, counted by what it read.
  int FindSpot(const Silhouette& silhouette, const Rim& rim, const Probes& probes, int first, int last, int rows_beyond,
               Spot* best, std::int64_t* work) const;

 private:
  const std::uint64_t* Row(int level, int y) const {
    return levels_[level].data() + static_cast<std::size_t>(y) * stride_;
  }
  // Places in row y, one bit each; returns whether there are any.
  bool FreePlaces(const Probes& probes, int y, std::uint64_t* places, int words, std::int64_t* work) const;
  // The same for a number of words that is known beforehand, or for any: 0.
  template <int kWords>
  bool FreePlacesIn(const Probes& probes, int y, std::uint64_t* places, int words, std::int64_t* work) const;

  int side_ = 0, size_ = 0;  // of what is free, without and with the margin
  int stride_;
  // Level k, row y, bit x: whether one of the cells x .. x + 2^k - 1 is taken. Two words more than a row needs.
  std::vector<std::vector<std::uint64_t>> levels_;
  std::vector<std::int32_t> longest_free_;  // per row: the longest run of free cells, or more
  std::vector<std::int8_t> stale_;          // per row: silhouettes since that was measured
};

}  // namespace planish
