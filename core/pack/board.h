// A tile while charts are placed on it: which cells are taken, and where a silhouette still fits.
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "core/pack/silhouette.h"

namespace planish {

// Cells that touch a silhouette from outside, as offsets from its corner (0, 0). The share that is taken measures how
// snugly the silhouette lies.
struct Rim {
  struct Cell {
    std::int16_t x, y;
  };
  std::vector<Cell> cells;
};

// The spans of a silhouette in the order in which Board tests them: those that rule out most places come first.
struct Probes {
  // Two runs of 2^level cells cover the span, so the span is free if both runs are.
  struct Probe {
    std::int16_t row;
    std::int16_t words[2];  // where the runs begin: words, and bits in those
    std::int8_t bits[2];
    std::int8_t level;
  };

  Probes() = default;
  explicit Probes(const Silhouette& silhouette);

  std::vector<Probe> all;
  // The longest spans of the first few rows in `all`.
  struct Longest {
    std::int32_t row, length;
  };
  static constexpr std::size_t kChecked = 4;
  std::array<Longest, kChecked> longest = {};
};

// At most `most` cells that touch the silhouette from outside, spread evenly along it.
Rim MakeRim(const Silhouette& silhouette, int most);

struct Spot {
  int x = 0, y = 0;
  double snugness = -1;  // share of the rim's cells that are taken
};

// Bit-parallel: a search tests 64 places at once. For every row of cells and each power of two, the board knows which
// runs of that length hold a taken cell. So a span of any length is tested by two lookups.
class Board {
 public:
  static constexpr int kMargin = 2;           // taken cells round the free square
  static constexpr int kMostCells = 1 << 14;  // along a side; Probes and Rim store places in 16 bits

  // For grids of up to most_side x most_side cells (at most kMostCells), and silhouettes at most `longest` cells wide.
  // Call Clear() first.
  Board(int most_side, int longest);
  // Frees side x side cells from (kMargin, kMargin) on, and takes all others. Adds the number of words written to
  // *work.
  void Clear(int side, std::int64_t* work);

  bool IsTaken(int x, int y) const { return (Row(0, y)[x >> 6] >> (x & 63) & 1) != 0; }

  // Takes every cell that overlaps a cell of the silhouette, whose corner (0, 0) is at (x, y), in cells from the corner
  // of the free square. The silhouette's cells are smaller than the board's by a factor of 2^shift. Parts beyond the
  // board are ignored. Adds the number of words written to *work.
  void Add(const Silhouette& silhouette, int x, int y, int shift, std::int64_t* work);

  // Searches from row `first` until `rows_beyond` rows beyond the first row with a place; that row must be at most
  // `last`. Considers places where the silhouette fits but cannot move both ways along u, nor both ways along v.
  // Replaces *best by the snuggest if that is snugger; of equally snug places the one nearest to the corner (0, 0)
  // wins. Returns the first row with a place, or -1. Adds the cost in nanoseconds, counted by words read, to *work.
  int FindSpot(const Silhouette& silhouette, const Rim& rim, const Probes& probes, int first, int last, int rows_beyond,
               Spot* best, std::int64_t* work) const;

 private:
  const std::uint64_t* Row(int level, int y) const {
    return levels_[level].data() + static_cast<std::size_t>(y) * stride_;
  }
  // Sets one bit in `places` for each x at which the silhouette fits in row y. Returns whether there are any.
  bool FreePlaces(const Probes& probes, int y, std::uint64_t* places, int words, std::int64_t* work) const;
  // FreePlaces() with the number of words known at compile time; kWords = 0: any number.
  template <int kWords>
  bool FreePlacesIn(const Probes& probes, int y, std::uint64_t* places, int words, std::int64_t* work) const;

  int side_ = 0, size_ = 0;  // of the free square, without and with the margin
  int stride_;
  // Level k, row y, bit x: whether one of the cells x .. x + 2^k - 1 is taken. Each row has two spare words.
  std::vector<std::vector<std::uint64_t>> levels_;
  std::vector<std::int32_t> longest_free_;  // per row: an upper bound of the longest run of free cells
  std::vector<std::int8_t> stale_;          // per row: silhouettes added since longest_free_ was measured
};

}  // namespace planish
