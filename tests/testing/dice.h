// Random numbers for generated meshes: the same for a seed everywhere.
#pragma once

#include <cstdint>
#include <random>

#include "core/mesh/mesh.h"

namespace planish::testing {

class Dice {
 public:
  explicit Dice(std::uint64_t seed) : random_(seed * 0x9E3779B97F4A7C15u + 1) {}
  double In(double low, double high) { return low + (high - low) * static_cast<double>(random_() >> 11) * 0x1p-53; }
  int Below(int n) { return static_cast<int>(random_() % static_cast<std::uint64_t>(n)); }
  bool OneIn(int n) { return Below(n) == 0; }
  Vec3 Point(double low, double high) {
    const double x = In(low, high), y = In(low, high), z = In(low, high);
    return {x, y, z};
  }
  Vec3 Direction() {
    while (true) {
      const Vec3 p = Point(-1, 1);
      if (p.norm() > 0.1 && p.norm() < 1) return p.normalized();
    }
  }

 private:
  std::mt19937_64 random_;
};

}  // namespace planish::testing
