// How far a place is from a chart: a grid of signed distances in the chart's own frame.
#pragma once

#include <vector>

#include "core/pack/outline.h"

namespace planish {

class DistanceField {
 public:
  // Distances up to `reach` from the outline, outside of it, are right at the nodes of a grid of the given spacing;
  // deep inside they are estimates. Units of the chart, round the centre of the outline.
  DistanceField(const Outline& outline, double spacing, double reach);

  struct Value {
    double distance;  // below 0 inside
    Vec2 gradient;    // unit, or zero
  };
  // Whether `p` lies on the grid; what lies off it is farther than `reach`.
  bool Contains(const Vec2& p) const {
    const Vec2 g = (p - low_) * per_unit_;
    return g.x() >= 0 && g.y() >= 0 && g.x() < columns_ - 1 && g.y() < rows_ - 1;
  }
  // Bilinear. p must be on the grid.
  Value At(const Vec2& p) const {
    const double u = (p.x() - low_.x()) * per_unit_, v = (p.y() - low_.y()) * per_unit_;
    const int x = static_cast<int>(u), y = static_cast<int>(v);
    const double s = u - x, t = v - y;
    const float* node = values_.data() + static_cast<std::size_t>(y) * columns_ + x;
    const double a = node[0], b = node[1], c = node[columns_], d = node[columns_ + 1];
    Vec2 gradient((1 - t) * (b - a) + t * (d - c), (1 - s) * (c - a) + s * (d - b));
    const double norm = gradient.norm();
    if (norm > 0) gradient /= norm;
    return {(1 - t) * ((1 - s) * a + s * b) + t * ((1 - s) * c + s * d), gradient};
  }
  // The distance alone, `beyond` off the grid.
  double DistanceNear(const Vec2& p, double beyond) const {
    const double x = (p.x() - low_.x()) * per_unit_, y = (p.y() - low_.y()) * per_unit_;
    if (!(x >= 0 && y >= 0 && x < columns_ - 1 && y < rows_ - 1)) return beyond;
    const int column = static_cast<int>(x), row = static_cast<int>(y);
    const double s = x - column, t = y - row;
    const float* node = values_.data() + static_cast<std::size_t>(row) * columns_ + column;
    const double below = node[0] + s * (node[1] - node[0]);
    const double above = node[columns_] + s * (node[columns_ + 1] - node[columns_]);
    return below + t * (above - below);
  }
  // The distances at first, first + step, ... (count of them); kFar for those off the grid.
  static constexpr float kFar = 1e30f;
  void Sample(const Vec2& first, const Vec2& step, int count, float* distances) const;

 private:
  void MeasureNearEdges(const Outline& outline, double band);
  void Spread();
  void Sign(const Outline& outline);
  float& Node(int x, int y) { return values_[static_cast<std::size_t>(y) * columns_ + x]; }

  double spacing_, per_unit_;  // per_unit_: 1 / spacing_
  Vec2 low_;
  int columns_, rows_;
  std::vector<float> values_;
};

}  // namespace planish
