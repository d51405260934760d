#include "tests/testing/isosurfaces.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <memory>
#include <numbers>
#include <utility>
#include <vector>

#include "Eigen/LU"
#include "tests/testing/dice.h"

namespace planish::testing {
namespace {

struct Samples {
  int n;
  std::vector<double> values;

  Samples(const Field& field, int cells) : n(cells), values(static_cast<std::size_t>(n + 1) * (n + 1) * (n + 1)) {
    for (int z = 0; z <= n; ++z) {
      for (int y = 0; y <= n; ++y) {
        for (int x = 0; x <= n; ++x) {
          double value = field(Place(x, y, z));
          // Closed at the sides of the box.
          if (x == 0 || y == 0 || z == 0 || x == n || y == n || z == n) value = std::max(value, 0.01);
          values[Index(x, y, z)] = value == 0 ? 1e-9 : value;
        }
      }
    }
  }
  std::size_t Index(int x, int y, int z) const {
    return (static_cast<std::size_t>(z) * (n + 1) + static_cast<std::size_t>(y)) * (n + 1) +
           static_cast<std::size_t>(x);
  }
  double At(int x, int y, int z) const { return values[Index(x, y, z)]; }
  Vec3 Place(double x, double y, double z) const { return Vec3(x, y, z) * (2.0 / n) - Vec3::Ones(); }
};

// Corner c of a cell is at (c & 1, c >> 1 & 1, c >> 2).
constexpr std::array<std::array<int, 2>, 12> kCellEdges = {
    {{0, 1}, {2, 3}, {4, 5}, {6, 7}, {0, 2}, {1, 3}, {4, 6}, {5, 7}, {0, 4}, {1, 5}, {2, 6}, {3, 7}}};

// Where the surface crosses the edge between two corners of a cell.
Vec3 Crossing(const Samples& s, const std::array<int, 3>& cell, int a, int b) {
  const auto place = [&](int c) { return s.Place(cell[0] + (c & 1), cell[1] + (c >> 1 & 1), cell[2] + (c >> 2)); };
  const auto value = [&](int c) { return s.At(cell[0] + (c & 1), cell[1] + (c >> 1 & 1), cell[2] + (c >> 2)); };
  const double t = value(a) / (value(a) - value(b));
  return place(a) + t * (place(b) - place(a));
}

Vec3 Gradient(const Field& field, const Vec3& p) {
  constexpr double kStep = 1e-4;
  Vec3 gradient;
  for (int axis = 0; axis < 3; ++axis) {
    const Vec3 step = kStep * Vec3::Unit(axis);
    gradient[axis] = (field(p + step) - field(p - step)) / (2 * kStep);
  }
  return gradient;
}

// Nearest to the planes (point, unit normal), staying near the mean of the points.
Vec3 MeetingPoint(const std::vector<std::pair<Vec3, Vec3>>& planes, const Vec3& mean) {
  Eigen::Matrix3d a = 0.05 * Eigen::Matrix3d::Identity();
  Vec3 b = Vec3::Zero();
  for (const auto& [point, normal] : planes) {
    a += normal * normal.transpose();
    b += normal * normal.dot(point - mean);
  }
  return mean + a.inverse() * b;
}

Mesh Nets(const Field& field, const Samples& s, Contouring contouring) {
  Mesh mesh;
  const int n = s.n;
  std::vector<std::int32_t> vertex(static_cast<std::size_t>(n) * n * n, -1);
  const auto id = [&](int x, int y, int z) -> std::int32_t& {
    return vertex[(static_cast<std::size_t>(z) * n + static_cast<std::size_t>(y)) * n + static_cast<std::size_t>(x)];
  };
  for (int z = 0; z < n; ++z) {
    for (int y = 0; y < n; ++y) {
      for (int x = 0; x < n; ++x) {
        std::vector<std::pair<Vec3, Vec3>> planes;
        Vec3 mean = Vec3::Zero();
        for (const auto& [a, b] : kCellEdges) {
          const auto value = [&](int c) { return s.At(x + (c & 1), y + (c >> 1 & 1), z + (c >> 2)); };
          if ((value(a) < 0) == (value(b) < 0)) continue;
          const Vec3 point = Crossing(s, {x, y, z}, a, b);
          mean += point;
          planes.emplace_back(point, Vec3::Zero());
        }
        if (planes.empty()) continue;
        mean /= static_cast<double>(planes.size());
        if (contouring == Contouring::kDualContouring) {
          for (auto& [point, normal] : planes) normal = Gradient(field, point).normalized();
          const Vec3 low = s.Place(x, y, z), high = s.Place(x + 1, y + 1, z + 1);
          mean = MeetingPoint(planes, mean).cwiseMax(low).cwiseMin(high);
        }
        id(x, y, z) = static_cast<std::int32_t>(mesh.positions.size());
        mesh.positions.push_back(mean);
      }
    }
  }
  // Round each grid edge along `axis` from (x, y, z) on.
  for (int axis = 0; axis < 3; ++axis) {
    const int u = (axis + 1) % 3, v = (axis + 2) % 3;
    std::array<int, 3> at;
    for (at[2] = 0; at[2] < n; ++at[2]) {
      for (at[1] = 0; at[1] < n; ++at[1]) {
        for (at[0] = 0; at[0] < n; ++at[0]) {
          if (at[u] == 0 || at[v] == 0) continue;
          std::array<std::int32_t, 4> quad;
          for (int k = 0; k < 4; ++k) {
            std::array<int, 3> cell = at;
            if (k == 0 || k == 3) --cell[u];
            if (k == 0 || k == 1) --cell[v];
            quad[k] = id(cell[0], cell[1], cell[2]);
          }
          std::array<int, 3> end = at;
          ++end[axis];
          const bool from = s.At(at[0], at[1], at[2]) < 0, to = s.At(end[0], end[1], end[2]) < 0;
          const bool all = std::all_of(quad.begin(), quad.end(), [](std::int32_t i) { return i >= 0; });
          if (!all || (from == to && contouring != Contouring::kSparseNets)) continue;
          if (to && !from) std::swap(quad[1], quad[3]);
          AddQuad(quad, &mesh);
        }
      }
    }
  }
  return mesh;
}

// Along the sides of each cell the crossings are joined with the solid at the left, two by two round each corner of the
// solid where a side has four; the loops that result are fans.
Mesh Cubes(const Samples& s) {
  Mesh mesh;
  std::map<std::pair<std::size_t, std::size_t>, std::int32_t> ids;
  // Corners of each side in turn, seen from outside.
  constexpr std::array<std::array<int, 4>, 6> kSides = {
      {{0, 4, 6, 2}, {1, 3, 7, 5}, {0, 1, 5, 4}, {2, 6, 7, 3}, {0, 2, 3, 1}, {4, 5, 7, 6}}};
  for (int z = 0; z < s.n; ++z) {
    for (int y = 0; y < s.n; ++y) {
      for (int x = 0; x < s.n; ++x) {
        const auto index = [&](int c) { return s.Index(x + (c & 1), y + (c >> 1 & 1), z + (c >> 2)); };
        const auto solid = [&](int c) { return s.values[index(c)] < 0; };
        const auto vertex = [&](int a, int b) {
          const auto [at, is_new] =
              ids.emplace(std::minmax(index(a), index(b)), static_cast<std::int32_t>(mesh.positions.size()));
          if (is_new) mesh.positions.push_back(Crossing(s, {x, y, z}, a, b));
          return at->second;
        };
        std::map<std::int32_t, std::int32_t> next;
        for (const auto& side : kSides) {
          for (int k = 0; k < 4; ++k) {
            // From where the side's outline leaves the solid back to where it entered it.
            if (!solid(side[k]) || solid(side[(k + 1) % 4])) continue;
            int entry = k;
            while (solid(side[(entry + 3) % 4])) entry = (entry + 3) % 4;
            next[vertex(side[(entry + 3) % 4], side[entry])] = vertex(side[k], side[(k + 1) % 4]);
          }
        }
        while (!next.empty()) {
          std::vector<std::int32_t> loop;
          for (auto at = next.begin(); at != next.end(); at = next.find(loop.back())) {
            loop.push_back(at->second);
            next.erase(at);
          }
          for (std::size_t k = 2; k < loop.size(); ++k) mesh.faces.push_back({loop[0], loop[k - 1], loop[k]});
        }
      }
    }
  }
  return mesh;
}

}  // namespace

void AddQuad(const std::array<std::int32_t, 4>& q, Mesh* mesh) {
  const auto& p = mesh->positions;
  if ((p[q[0]] - p[q[2]]).squaredNorm() <= (p[q[1]] - p[q[3]]).squaredNorm()) {
    mesh->faces.push_back({q[0], q[1], q[2]});
    mesh->faces.push_back({q[0], q[2], q[3]});
  } else {
    mesh->faces.push_back({q[0], q[1], q[3]});
    mesh->faces.push_back({q[1], q[2], q[3]});
  }
}

Field RandomField(std::uint64_t seed) {
  auto dice = std::make_shared<Dice>(seed ^ 0x5EED);
  const int kind = dice->Below(4);
  struct Wave {
    Vec3 direction;
    double phase, weight;
  };
  std::vector<Wave> waves;
  for (int i = 0; i < 8; ++i) {
    waves.push_back({dice->In(1, 9) * dice->Direction(), dice->In(0, 2 * std::numbers::pi), dice->In(0.2, 1)});
  }
  std::vector<std::pair<Vec3, double>> blobs;
  for (int i = 0; i < 3 + dice->Below(20); ++i) blobs.emplace_back(dice->Point(-0.8, 0.8), dice->In(0.05, 0.35));
  const double level = dice->In(-0.6, 0.6), sheet = dice->In(0.02, 0.2), frequency = dice->In(2, 6);
  const auto wavy = [waves](const Vec3& p) {
    double sum = 0;
    for (const Wave& wave : waves) sum += wave.weight * std::sin(wave.direction.dot(p) + wave.phase);
    return sum;
  };
  switch (kind) {
    case 0:
      return [=](const Vec3& p) { return std::max(wavy(p) + level, p.norm() - 0.95); };
    case 1:  // a thin sheet
      return [=](const Vec3& p) { return std::max(std::abs(wavy(p) + level) - sheet, p.norm() - 0.95); };
    case 2:
      return [=](const Vec3& p) {
        double least = 1;
        for (const auto& [centre, radius] : blobs) {
          // Joined smoothly.
          const double d = (p - centre).norm() - radius, k = 0.08;
          const double h = std::max(k - std::abs(least - d), 0.0) / k;
          least = std::min(least, d) - h * h * k / 4;
        }
        return least;
      };
    default:
      return [=](const Vec3& p) {
        const Vec3 q = frequency * std::numbers::pi * p;
        const double gyroid =
            std::sin(q.x()) * std::cos(q.y()) + std::sin(q.y()) * std::cos(q.z()) + std::sin(q.z()) * std::cos(q.x());
        return std::max(std::abs(gyroid) - 5 * sheet, p.norm() - 0.9);
      };
  }
}

Mesh Isosurface(const Field& field, int n, Contouring contouring) {
  const Samples samples(field, n);
  Mesh mesh = contouring == Contouring::kMarchingCubes ? Cubes(samples) : Nets(field, samples, contouring);
  std::erase_if(mesh.faces, [](const Face& f) { return f[0] == f[1] || f[1] == f[2] || f[2] == f[0]; });
  return mesh;
}

}  // namespace planish::testing
