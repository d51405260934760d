#include "core/pack/distance_field.h"

#include <algorithm>
#include <cmath>

#include "core/mesh/box_tree.h"

namespace planish {

DistanceField::DistanceField(const Outline& outline, double spacing, double reach)
    : spacing_(spacing), per_unit_(1 / spacing) {
  Box box;
  for (const Vec2& p : outline.points) box.Add(p);
  const double margin = reach + spacing;
  low_ = box.low - Vec2::Constant(margin);
  const Vec2 nodes = (box.high - box.low + Vec2::Constant(2 * margin)) / spacing;
  columns_ = static_cast<int>(std::ceil(nodes.x())) + 2;
  rows_ = static_cast<int>(std::ceil(nodes.y())) + 2;
  values_.assign(static_cast<std::size_t>(columns_) * rows_, kFar);
  MeasureNearEdges(outline, margin);
  Spread();
  ScanLines lines;
  for (const auto& [from, to] : outline.edges) {
    lines.AddEdge((outline.points[from] - low_) / spacing_, (outline.points[to] - low_) / spacing_, 0);
  }
  lines.ForEachInside([&](int y, int begin, int end) {
    for (int x = begin; x < end; ++x) Node(x, y) = -Node(x, y);
  });
}

// The nodes hold squares of distances until the last line.
void DistanceField::MeasureNearEdges(const Outline& outline, double band) {
  for (const auto& [from, to] : outline.edges) {
    const Vec2 a = outline.points[from] - low_, along = outline.points[to] - outline.points[from];
    const double length2 = along.squaredNorm();
    const Vec2 b = a + along;
    const int y0 = std::max(0, static_cast<int>(std::ceil((std::min(a.y(), b.y()) - band) / spacing_)));
    const int y1 = std::min(rows_ - 1, static_cast<int>(std::floor((std::max(a.y(), b.y()) + band) / spacing_)));
    const int left = std::max(0, static_cast<int>(std::ceil((std::min(a.x(), b.x()) - band) / spacing_)));
    const int right = std::min(columns_ - 1, static_cast<int>(std::floor((std::max(a.x(), b.x()) + band) / spacing_)));
    for (int y = y0; y <= y1; ++y) {
      // The part of the edge near this row bounds the columns to visit.
      int x0 = left, x1 = right;
      if (std::abs(along.y()) > band) {
        const double t0 = (y * spacing_ - band - a.y()) / along.y(), t1 = (y * spacing_ + band - a.y()) / along.y();
        const double u = a.x() + std::clamp(t0, 0.0, 1.0) * along.x(), v = a.x() + std::clamp(t1, 0.0, 1.0) * along.x();
        x0 = std::max(x0, static_cast<int>(std::ceil((std::min(u, v) - band) / spacing_)));
        x1 = std::min(x1, static_cast<int>(std::floor((std::max(u, v) + band) / spacing_)));
      }
      for (int x = x0; x <= x1; ++x) {
        const Vec2 p = Vec2(x * spacing_, y * spacing_) - a;
        const double t = length2 > 0 ? std::clamp(p.dot(along) / length2, 0.0, 1.0) : 0;
        const auto square = static_cast<float>((p - t * along).squaredNorm());
        float& node = Node(x, y);
        node = std::min(node, square);
      }
    }
  }
  for (float& value : values_) value = value < kFar ? std::sqrt(value) : kFar;
}

// Propagates distances from node to node, along the grid and its diagonals.
void DistanceField::Spread() {
  const auto side = static_cast<float>(spacing_), diagonal = static_cast<float>(spacing_ * 1.4142135623730951);
  const auto from_row = [&](const float* from, float* to) {
    for (int x = 1; x + 1 < columns_; ++x) {
      const float straight = from[x] + side, across = std::min(from[x - 1], from[x + 1]) + diagonal;
      to[x] = std::min(to[x], std::min(straight, across));
    }
    to[0] = std::min({to[0], from[0] + side, from[1] + diagonal});
    to[columns_ - 1] = std::min({to[columns_ - 1], from[columns_ - 1] + side, from[columns_ - 2] + diagonal});
  };
  for (int y = 0; y < rows_; ++y) {
    float* const row = &Node(0, y);
    if (y > 0) from_row(row - columns_, row);
    for (int x = 1; x < columns_; ++x) row[x] = std::min(row[x], row[x - 1] + side);
  }
  for (int y = rows_ - 1; y >= 0; --y) {
    float* const row = &Node(0, y);
    if (y + 1 < rows_) from_row(row + columns_, row);
    for (int x = columns_ - 2; x >= 0; --x) row[x] = std::min(row[x], row[x + 1] + side);
  }
}

void DistanceField::Sample(const Vec2& first, const Vec2& step, int count, float* distances) const {
  const Vec2 g = (first - low_) * per_unit_, d = step * per_unit_;
  const Vec2 size(columns_ - 1, rows_ - 1);
  const auto is_on_grid = [&](int k) {
    const double x = g.x() + k * d.x(), y = g.y() + k * d.y();
    return x >= 0 && y >= 0 && x < size.x() && y < size.y();
  };
  // Clips the line to the grid. Rounding may leave one node beyond either end.
  double from = 0, to = count;
  for (int axis = 0; axis < 2; ++axis) {
    if (d[axis] == 0) continue;
    const double low = -g[axis] / d[axis], high = (size[axis] - g[axis]) / d[axis];
    from = std::max(from, std::min(low, high));
    to = std::min(to, std::max(low, high) + 1);
  }
  int begin = std::clamp(static_cast<int>(std::ceil(from)), 0, count);
  int end = std::clamp(static_cast<int>(std::ceil(to)), begin, count);
  while (begin < end && !is_on_grid(begin)) ++begin;
  while (begin < end && !is_on_grid(end - 1)) --end;
  std::fill(distances, distances + begin, kFar);
  std::fill(distances + end, distances + count, kFar);
  for (int k = begin; k < end; ++k) {
    const Cell cell = CellAt(g.x() + k * d.x(), g.y() + k * d.y());
    const auto s = static_cast<float>(cell.s), t = static_cast<float>(cell.t);
    const float* node = cell.node;
    const float below = node[0] + s * (node[1] - node[0]);
    const float above = node[columns_] + s * (node[columns_ + 1] - node[columns_]);
    distances[k] = below + t * (above - below);
  }
}

}  // namespace planish
