#include "tests/testing/meshes.h"

#include <cmath>

namespace planish {

Mesh Grid(int n, const std::function<Vec3(double, double)>& f) {
  Mesh mesh;
  for (int j = 0; j <= n; ++j) {
    for (int i = 0; i <= n; ++i) mesh.positions.push_back(f(1.0 * i / n, 1.0 * j / n));
  }
  for (int j = 0; j < n; ++j) {
    for (int i = 0; i < n; ++i) {
      const int a = j * (n + 1) + i;
      const int d = a + n + 1;
      mesh.faces.push_back({a, a + 1, d + 1});
      mesh.faces.push_back({a, d + 1, d});
    }
  }
  return mesh;
}

Mesh Bump(int n) {
  return Grid(n, [](double s, double t) {
    const double x = 2 * s - 1, y = 2 * t - 1;
    return Vec3(x, y, 0.7 * std::exp(-2 * (x * x + y * y)));
  });
}

Mesh Tetrahedron() {
  return {{{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {0, 0, 1}}, {{0, 2, 1}, {0, 1, 3}, {1, 2, 3}, {2, 0, 3}}};
}

}  // namespace planish
