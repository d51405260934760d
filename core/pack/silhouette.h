// A chart on a grid: the cells that the chart or its padding touches.
#pragma once

#include <cstdint>
#include <vector>

#include "core/pack/outline.h"

namespace planish {

struct Span {
  std::int32_t begin, end;  // cells [begin, end)

  bool operator==(const Span&) const = default;
};

// Sets bits [begin, end) of a row of words; the range must not be empty.
inline void SetBits(std::uint64_t* row, int begin, int end) {
  const int first = begin >> 6, last = (end - 1) >> 6;
  const std::uint64_t head = ~std::uint64_t{0} << (begin & 63), tail = ~std::uint64_t{0} >> (63 - ((end - 1) & 63));
  if (first == last) {
    row[first] |= head & tail;
    return;
  }
  row[first] |= head;
  for (int w = first + 1; w < last; ++w) row[w] = ~std::uint64_t{0};
  row[last] |= tail;
}

// Cells (x, y) with 0 <= x < width, 0 <= y < height.
struct Silhouette {
  int width = 0, height = 0;
  std::vector<std::int32_t> row_begin;  // height + 1: row y has the spans [row_begin[y], row_begin[y + 1])
  std::vector<Span> spans;              // disjoint, from left to right
  Vec2 centre = Vec2::Zero();           // the outline's centre, in cells from the corner of cell (0, 0)
  std::int64_t cells = 0;

  bool HasSameCells(const Silhouette& other) const {
    return width == other.width && row_begin == other.row_begin && spans == other.spans;
  }
};

// Every cell that comes within `radius` cells of the outline or its inside, after a rotation by `angle` and a scaling
// to `scale` cells per unit; shifted to touch both axes. Never misses a cell, and has few extra: a cell whose closed
// square has no such point is left out, up to rounding. `radius` is measured from the chart's own outline, which may be
// Outline::slack farther out.
//
// If two silhouettes with the same radius share no cell, their outlines are at least 2 radius apart.
Silhouette MakeSilhouette(const Outline& outline, double angle, double scale, double radius);

// The silhouette rotated by a quarter turn counter-clockwise. Exact, as the grid is symmetric.
Silhouette QuarterTurn(const Silhouette& silhouette);
// The silhouette rotated by half a turn.
Silhouette HalfTurn(const Silhouette& silhouette);

// MakeSilhouette() for a chart whose centre is at `at` on a larger grid, not shifted to touch the axes: the cells are
// cells of that grid.
struct FixedSilhouette {
  Silhouette silhouette;
  int x, y;  // the cell of the grid that is cell (0, 0) of the silhouette
};
FixedSilhouette MakeFixedSilhouette(const Outline& outline, double angle, double scale, double radius, const Vec2& at);

}  // namespace planish
