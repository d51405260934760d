#include "core/unwrap/placement.h"

#include <utility>

#include "core/mesh/box_tree.h"
#include "core/pack/outline.h"

namespace planish {

double PlaceInUnitSquare(std::vector<Vec2> outline, std::vector<Vec2>* points, const Execution& execution) {
  const HullRectangle rectangle = LeastRectangle(ConvexHull(std::move(outline)));
  const Vec2& along = rectangle.along;
  const Vec2 u = rectangle.width >= rectangle.height ? along : Vec2(-along.y(), along.x()), v(-u.y(), u.x());
  const auto n = static_cast<std::int64_t>(points->size());
  const Box bounds = execution.SumUp<Box>(n, [&](std::int64_t i, Box* box) {
    Vec2& p = (*points)[i];
    p = Vec2(p.dot(u), p.dot(v));
    box->Add(p);
  });
  const double side = (bounds.high - bounds.low).maxCoeff();
  if (!(side > 0)) return 1;
  execution.ForEach(n, [&](std::int64_t i) { (*points)[i] = ((*points)[i] - bounds.low) / side; });
  return 1 / side;
}

}  // namespace planish
