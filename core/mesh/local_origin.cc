#include "core/mesh/local_origin.h"

#include <cmath>
#include <limits>

namespace planish {
namespace {

bool IsFloat(double value) {
  return std::isfinite(value) && static_cast<double>(static_cast<float>(value)) == value;
}

}  // namespace

Vec3 LocalOrigin(const std::vector<Vec3>& positions) {
  Vec3 low = Vec3::Constant(std::numeric_limits<double>::infinity()), high = -low;
  bool is_float = true;
  for (const Vec3& p : positions) {
    for (int axis = 0; axis < 3; ++axis) {
      if (!std::isfinite(p[axis])) continue;
      low[axis] = std::min(low[axis], p[axis]);
      high[axis] = std::max(high[axis], p[axis]);
      is_float = is_float && IsFloat(p[axis]);
    }
  }
  const double side = (high - low).maxCoeff();
  if (is_float || !std::isfinite(side) || side <= 0) return Vec3::Zero();
  int exponent = 0;
  std::frexp(side, &exponent);
  const double step = std::ldexp(1.0, exponent - 2);  // in (side / 4, side / 2]
  if (step == 0) return Vec3::Zero();
  Vec3 origin = Vec3::Zero();
  for (int axis = 0; axis < 3; ++axis) {
    const double middle = low[axis] / 2 + high[axis] / 2;
    if (std::abs(middle) > side) origin[axis] = std::floor(middle / step + 0.5) * step;
  }
  return origin;
}

}  // namespace planish
