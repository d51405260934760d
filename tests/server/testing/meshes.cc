#include "tests/server/testing/meshes.h"

#include <cmath>

namespace planish {

Mesh Bump(int n) {
  Mesh mesh;
  for (int j = 0; j <= n; ++j) {
    for (int i = 0; i <= n; ++i) {
      const double x = 2.0 * i / n - 1;
      const double y = 2.0 * j / n - 1;
      mesh.positions.emplace_back(x, y, 0.7 * std::exp(-2 * (x * x + y * y)));
    }
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

}  // namespace planish
