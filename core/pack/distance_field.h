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
  Value At(const Vec2& p) const;
  // The distance alone.
  double DistanceAt(const Vec2& p) const {
    const Vec2 g = (p - low_) * per_unit_;
    const int x = static_cast<int>(g.x()), y = static_cast<int>(g.y());
    const double s = g.x() - x, t = g.y() - y;
    const float* node = values_.data() + static_cast<std::size_t>(y) * columns_ + x;
    const double below = node[0] + s * (node[1] - node[0]);
    const double above = node[columns_] + s * (node[columns_ + 1] - node[columns_]);
    return below + t * (above - below);
  }

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
