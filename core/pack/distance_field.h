// Distances from a chart, as a grid of signed distances in the chart's own frame.
#pragma once

#include <vector>

#include "core/pack/outline.h"

namespace planish {

class DistanceField {
 public:
  // Outside of the outline, distances up to `reach` are exact at the nodes of a grid with this spacing; deep inside
  // they are estimates. In units of the chart, relative to the centre of the outline.
  DistanceField(const Outline& outline, double spacing, double reach);

  // The direction in which the distance grows: a unit vector, or zero. p must be on the grid; every point within
  // `reach` is.
  Vec2 Gradient(const Vec2& p) const {
    const auto [node, s, t] = CellAt((p.x() - low_.x()) * per_unit_, (p.y() - low_.y()) * per_unit_);
    const double a = node[0], b = node[1], c = node[columns_], d = node[columns_ + 1];
    Vec2 gradient((1 - t) * (b - a) + t * (d - c), (1 - s) * (c - a) + s * (d - b));
    const double norm = gradient.norm();
    if (norm > 0) gradient /= norm;
    return gradient;
  }
  // The distance at p, negative inside, by bilinear interpolation; `beyond` if p is off the grid.
  double DistanceNear(const Vec2& p, double beyond) const {
    const double x = (p.x() - low_.x()) * per_unit_, y = (p.y() - low_.y()) * per_unit_;
    if (!(x >= 0 && y >= 0 && x < columns_ - 1 && y < rows_ - 1)) return beyond;
    const auto [node, s, t] = CellAt(x, y);
    const double below = node[0] + s * (node[1] - node[0]);
    const double above = node[columns_] + s * (node[columns_ + 1] - node[columns_]);
    return below + t * (above - below);
  }
  // The distances at first, first + step, ... (`count` of them); kFar for points off the grid.
  static constexpr float kFar = 1e30f;
  void Sample(const Vec2& first, const Vec2& step, int count, float* distances) const;

 private:
  // The cell that holds a point: its lower left node, and the point's offset from that in units of the spacing.
  struct Cell {
    const float* node;
    double s, t;
  };
  Cell CellAt(double x, double y) const {
    const int column = static_cast<int>(x), row = static_cast<int>(y);
    return {values_.data() + static_cast<std::size_t>(row) * columns_ + column, x - column, y - row};
  }
  void MeasureNearEdges(const Outline& outline, double band);
  void Spread();
  float& Node(int x, int y) { return values_[static_cast<std::size_t>(y) * columns_ + x]; }

  double spacing_, per_unit_;  // per_unit_ = 1 / spacing_
  Vec2 low_;
  int columns_, rows_;
  std::vector<float> values_;
};

}  // namespace planish
