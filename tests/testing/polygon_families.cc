#include "tests/testing/polygon_families.h"

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <map>
#include <numbers>
#include <set>

#include "tests/testing/dice.h"

namespace planish::testing {
namespace {

constexpr double kFullTurn = 2 * std::numbers::pi;

int SideOf(int size) {
  return std::max(2, static_cast<int>(std::sqrt(size)));
}

Polygons Quads(Dice& dice, int size) {
  const int n = SideOf(size);
  const double bump = dice.In(0, 0.6), wave = dice.In(0.5, 3);
  Polygons mesh;
  for (int i = 0; i <= n; ++i) {
    for (int j = 0; j <= n; ++j) {
      const double x = i + dice.In(-0.3, 0.3), y = j + dice.In(-0.3, 0.3);
      mesh.positions.emplace_back(x, y, bump * n * std::sin(wave * x / n) * std::cos(wave * y / n) + dice.In(-0.2, 0.2));
    }
  }
  for (int i = 0; i < n; ++i) {
    for (int j = 0; j < n; ++j) {
      const int a = i * (n + 1) + j;
      mesh.polygons.push_back({a, a + n + 1, a + n + 2, a + 1});
    }
  }
  return mesh;
}

Polygons Mixed(Dice& dice, int size) {
  Polygons mesh = Quads(dice, size);
  std::vector<std::vector<std::int32_t>> result;
  const int n = SideOf(size);
  for (std::size_t q = 0; q < mesh.polygons.size(); ++q) {
    const std::vector<std::int32_t> quad = mesh.polygons[q];
    const int kind = dice.Below(4);
    if (kind == 0) {
      result.push_back({quad[0], quad[1], quad[2]});
      result.push_back({quad[0], quad[2], quad[3]});
    } else if (kind == 1 && (q + 1) % static_cast<std::size_t>(n) != 0 && q + 1 < mesh.polygons.size()) {
      const std::vector<std::int32_t>& next = mesh.polygons[++q];
      result.push_back({quad[0], quad[1], next[1], next[2], next[3], quad[3]});  // with corners in the middle of sides
    } else {
      result.push_back(quad);
    }
  }
  mesh.polygons = std::move(result);
  return mesh;
}

Polygons Concave(Dice& dice, int size) {
  Polygons mesh;
  for (int made = 0; made < size;) {
    const int tips = 3 + dice.Below(9);
    const Vec3 middle = dice.Point(-10, 10);
    const double depth = dice.OneIn(3) ? 0 : dice.In(0.1, 2), inner = dice.In(0.1, 0.9);
    const auto first = static_cast<std::int32_t>(mesh.positions.size());
    for (const double z : {0.0, depth}) {
      for (int k = 0; k < 2 * tips; ++k) {
        const double angle = kFullTurn * k / (2 * tips), r = k % 2 == 0 ? 1 : inner;
        mesh.positions.push_back(middle + Vec3(r * std::cos(angle), r * std::sin(angle), z));
      }
    }
    std::vector<std::int32_t> top, bottom;
    for (int k = 0; k < 2 * tips; ++k) {
      top.push_back(first + 2 * tips + k);
      bottom.push_back(first + 2 * tips - 1 - k);
    }
    mesh.polygons.push_back(top);
    mesh.polygons.push_back(bottom);
    for (int k = 0; k < 2 * tips; ++k) {
      const int next = (k + 1) % (2 * tips);
      mesh.polygons.push_back({first + k, first + next, first + 2 * tips + next, first + 2 * tips + k});
    }
    made += 2 + 2 * tips;
  }
  return mesh;
}

Polygons BowTies(Dice& dice, int size) {
  Polygons mesh = dice.OneIn(2) ? Quads(dice, size) : Mixed(dice, size);
  for (std::vector<std::int32_t>& polygon : mesh.polygons) {
    if (dice.OneIn(6)) std::swap(polygon[1], polygon[2]);
  }
  return mesh;
}

Polygons Mirrored(Dice& dice, int size) {
  Polygons mesh = dice.OneIn(2) ? Quads(dice, size / 2) : Mixed(dice, size / 2);
  const auto count = static_cast<std::int32_t>(mesh.positions.size());
  const double plane = dice.In(0, SideOf(size / 2));
  std::vector<std::int32_t> image(mesh.positions.size());
  for (std::int32_t v = 0; v < count; ++v) {
    Vec3 p = mesh.positions[v];
    // Near the plane the halves share vertices. The images of some others lie on them, too.
    if (std::abs(p.x() - plane) < 0.7 || dice.OneIn(3)) {
      image[v] = v;
      continue;
    }
    p.x() = dice.OneIn(2) ? 2 * plane - p.x() : p.x();
    image[v] = static_cast<std::int32_t>(mesh.positions.size());
    mesh.positions.push_back(p);
  }
  const std::size_t before = mesh.polygons.size();
  for (std::size_t i = 0; i < before; ++i) {
    std::vector<std::int32_t> turned;
    for (const std::int32_t v : mesh.polygons[i]) turned.insert(turned.begin(), image[v]);
    mesh.polygons.push_back(turned);
  }
  return mesh;
}

Polygons Repeated(Dice& dice, int size) {
  Polygons mesh = Mixed(dice, size);
  for (std::vector<std::int32_t>& polygon : mesh.polygons) {
    const int kind = dice.Below(8);
    const int at = dice.Below(static_cast<int>(polygon.size()));
    if (kind == 0) polygon.insert(polygon.begin() + at, polygon[at]);
    if (kind == 1) polygon.push_back(polygon[dice.Below(static_cast<int>(polygon.size()))]);
    if (kind == 2) polygon[at] = polygon[dice.Below(static_cast<int>(polygon.size()))];
    if (kind == 3) {
      // A hole in the middle, and a bridge to it.
      const auto first = static_cast<std::int32_t>(mesh.positions.size());
      Vec3 middle = Vec3::Zero();
      for (const std::int32_t v : polygon) middle += mesh.positions[v] / static_cast<double>(polygon.size());
      std::vector<std::int32_t> keyhole(polygon.begin(), polygon.end());
      keyhole.push_back(polygon.front());
      for (std::size_t k = 0; k < polygon.size(); ++k) {
        const Vec3 corner = mesh.positions[polygon[(polygon.size() - k) % polygon.size()]];
        mesh.positions.push_back(middle + 0.4 * (corner - middle));
        keyhole.push_back(first + static_cast<std::int32_t>(k));
      }
      keyhole.push_back(first);
      polygon = keyhole;
    }
  }
  return mesh;
}

// The edges of a group of polygons that belong to one of them only, put together to loops; the first loop.
std::vector<std::int32_t> OutlineOf(const std::vector<std::vector<std::int32_t>>& group) {
  std::map<std::pair<std::int32_t, std::int32_t>, int> sides;
  for (const auto& polygon : group) {
    for (std::size_t k = 0; k < polygon.size(); ++k) {
      ++sides[std::minmax(polygon[k], polygon[(k + 1) % polygon.size()])];
    }
  }
  std::map<std::int32_t, std::vector<std::int32_t>> next;
  for (const auto& polygon : group) {
    for (std::size_t k = 0; k < polygon.size(); ++k) {
      const std::int32_t a = polygon[k], b = polygon[(k + 1) % polygon.size()];
      if (sides[std::minmax(a, b)] == 1) next[a].push_back(b);
    }
  }
  std::vector<std::int32_t> loop;
  if (next.empty()) return loop;
  std::int32_t at = next.begin()->first;
  while (!next[at].empty()) {
    loop.push_back(at);
    const std::int32_t to = next[at].back();
    next[at].pop_back();
    at = to;
  }
  return loop;
}

Polygons Merged(Dice& dice, int size) {
  Polygons mesh = dice.OneIn(2) ? Quads(dice, 3 * size) : Mixed(dice, 3 * size);
  const double steep = dice.In(0, 3);
  for (Vec3& p : mesh.positions) p.z() *= steep;
  std::vector<std::vector<std::int32_t>> result;
  for (std::size_t i = 0; i < mesh.polygons.size();) {
    const auto end = std::min(mesh.polygons.size(), i + 1 + static_cast<std::size_t>(dice.Below(4)));
    const std::vector<std::vector<std::int32_t>> group(mesh.polygons.begin() + static_cast<std::ptrdiff_t>(i),
                                                       mesh.polygons.begin() + static_cast<std::ptrdiff_t>(end));
    const std::vector<std::int32_t> outline = OutlineOf(group);
    if (outline.size() >= 3) result.push_back(outline);
    i = end;
  }
  mesh.polygons = std::move(result);
  return mesh;
}

Polygons Flaps(Dice& dice, int size) {
  Polygons mesh = dice.OneIn(2) ? Quads(dice, size) : Mixed(dice, size);
  const std::size_t before = mesh.polygons.size();
  for (std::size_t i = 0; i < before; ++i) {
    if (!dice.OneIn(3)) continue;
    const std::vector<std::int32_t> polygon = mesh.polygons[i];
    const int n = static_cast<int>(polygon.size());
    const int a = dice.Below(n), b = (a + 1 + dice.Below(n - 1)) % n;  // an edge or a diagonal
    const auto tip = static_cast<std::int32_t>(mesh.positions.size());
    for (int copies = 1 + dice.Below(3); copies > 0; --copies) {
      std::vector<std::int32_t> flap = {polygon[a], polygon[b], tip};
      mesh.positions.push_back((mesh.positions[polygon[a]] + mesh.positions[polygon[b]]) / 2 + dice.Point(-1, 1));
      if (dice.OneIn(2)) {
        mesh.positions.push_back(mesh.positions[polygon[a]] + dice.Point(-1, 1));
        flap.push_back(static_cast<std::int32_t>(mesh.positions.size()) - 1);
      }
      if (dice.OneIn(2)) std::reverse(flap.begin(), flap.end());
      mesh.polygons.push_back(flap);
    }
    // A quad with the other diagonal of this one as an edge.
    if (n == 4 && dice.OneIn(3)) mesh.polygons.push_back({polygon[1], polygon[3], polygon[0], tip});
  }
  return mesh;
}

Polygons QuadVoxels(Dice& dice, int size) {
  const int n = std::max(2, static_cast<int>(std::cbrt(size)));
  std::vector<char> is_full(static_cast<std::size_t>(n * n * n));
  for (char& full : is_full) full = dice.OneIn(2);
  const auto full = [&](const std::array<int, 3>& c) {
    for (const int x : c) {
      if (x < 0 || x >= n) return false;
    }
    return is_full[static_cast<std::size_t>((c[0] * n + c[1]) * n + c[2])] != 0;
  };
  Polygons mesh;
  std::map<std::array<int, 3>, std::int32_t> number;
  const auto vertex = [&](const std::array<int, 3>& p) {
    const auto [at, is_new] = number.emplace(p, static_cast<std::int32_t>(mesh.positions.size()));
    if (is_new) mesh.positions.emplace_back(p[0], p[1], p[2]);
    return at->second;
  };
  for (int i = 0; i < n * n * n; ++i) {
    const std::array<int, 3> cell = {i / (n * n), i / n % n, i % n};
    if (!full(cell)) continue;
    for (int axis = 0; axis < 3; ++axis) {
      for (const int side : {0, 1}) {
        std::array<int, 3> beyond = cell;
        beyond[axis] += side == 1 ? 1 : -1;
        if (full(beyond)) continue;
        const int u = (axis + 1) % 3, v = (axis + 2) % 3;
        std::vector<std::int32_t> quad;
        for (const auto& [a, b] : {std::pair(0, 0), {1, 0}, {1, 1}, {0, 1}}) {
          std::array<int, 3> p = cell;
          p[axis] += side;
          p[u] += a;
          p[v] += b;
          quad.push_back(vertex(p));
        }
        if (side == 0) std::reverse(quad.begin(), quad.end());
        mesh.polygons.push_back(quad);
      }
    }
  }
  if (mesh.polygons.empty()) return Quads(dice, size);
  return mesh;
}

Polygons PolygonSoup(Dice& dice, int size) {
  Polygons mesh;
  const int vertices = 5 + dice.Below(std::max(1, size));
  for (int v = 0; v < vertices; ++v) mesh.positions.push_back(dice.Point(-1, 1));
  for (int i = 0; i < size; ++i) {
    const int n = 3 + dice.Below(4);
    std::vector<std::int32_t> polygon;
    while (static_cast<int>(polygon.size()) < std::min(n, vertices)) {
      const std::int32_t v = dice.Below(vertices);
      if (dice.OneIn(20) || std::find(polygon.begin(), polygon.end(), v) == polygon.end()) polygon.push_back(v);
    }
    mesh.polygons.push_back(polygon);
  }
  return mesh;
}

Polygons Doubled(Dice& dice, int size) {
  Polygons mesh = Mixed(dice, size);
  const std::size_t before = mesh.polygons.size();
  for (std::size_t i = 0; i < before; ++i) {
    std::vector<std::int32_t> copy = mesh.polygons[i];
    const int kind = dice.Below(6);
    if (kind == 0) std::reverse(copy.begin(), copy.end());
    if (kind == 1) std::rotate(copy.begin(), copy.begin() + 1, copy.end());
    if (kind < 3) mesh.polygons.push_back(copy);
    if (kind == 3) {
      for (std::size_t k = 1; k + 1 < copy.size(); ++k) mesh.polygons.push_back({copy[0], copy[k], copy[k + 1]});
    }
  }
  return mesh;
}

Polygons Thin(Dice& dice, int size) {
  Polygons mesh = Mixed(dice, size);
  const std::size_t before = mesh.polygons.size();
  for (std::size_t i = 0; i < before; ++i) {
    std::vector<std::int32_t>& polygon = mesh.polygons[i];
    const int kind = dice.Below(8), at = dice.Below(static_cast<int>(polygon.size()));
    const Vec3 a = mesh.positions[polygon[at]];
    const Vec3 b = mesh.positions[polygon[(at + 1) % static_cast<int>(polygon.size())]];
    if (kind < 3) {
      const double height = kind == 0 ? 0 : std::pow(10, dice.In(-9, -2));
      mesh.positions.push_back(a + dice.In(0, 1) * (b - a) + height * dice.Direction());
      polygon.insert(polygon.begin() + at + 1, static_cast<std::int32_t>(mesh.positions.size()) - 1);
    } else if (kind == 3) {
      mesh.positions.push_back(a);
      polygon.insert(polygon.begin() + at, static_cast<std::int32_t>(mesh.positions.size()) - 1);
    } else if (kind == 4 && dice.OneIn(4)) {
      for (const std::int32_t v : polygon) mesh.positions[v] = a + 1e-3 * (mesh.positions[v] - a).cwiseProduct(Vec3(1, 0, 0));
    }
  }
  return mesh;
}

Polygons Spirals(Dice& dice, int size) {
  Polygons mesh;
  for (int made = 0; made < size; ++made) {
    const int n = 5 + dice.Below(8);
    const Vec3 middle = dice.Point(-10, 10);
    const double turns = dice.In(0.5, 2.5), rise = dice.In(0, 1);
    std::vector<std::int32_t> polygon = {static_cast<std::int32_t>(mesh.positions.size())};
    mesh.positions.push_back(middle);
    for (int k = 0; k < n; ++k) {
      const double angle = kFullTurn * turns * k / n;
      polygon.push_back(static_cast<std::int32_t>(mesh.positions.size()));
      mesh.positions.push_back(middle + Vec3(std::cos(angle), std::sin(angle), rise * angle + dice.In(-0.1, 0.1)));
    }
    mesh.polygons.push_back(polygon);
  }
  return mesh;
}

Polygons Caps(Dice& dice, int size) {
  Polygons mesh;
  const int n = std::max(5, size / 2);
  for (const double z : {0.0, dice.In(0.1, 3)}) {
    for (int k = 0; k < n; ++k) {
      const double angle = kFullTurn * k / n;
      mesh.positions.emplace_back(std::cos(angle), std::sin(angle), z + dice.In(0, 0.01) * dice.Below(2));
    }
  }
  std::vector<std::int32_t> top, bottom;
  for (int k = 0; k < n; ++k) {
    bottom.push_back(n - 1 - k);
    top.push_back(n + k);
    const int next = (k + 1) % n;
    mesh.polygons.push_back({k, next, n + next, n + k});
  }
  mesh.polygons.push_back(top);
  mesh.polygons.push_back(bottom);
  return mesh;
}

struct Family {
  const char* name;
  Polygons (*make)(Dice& dice, int size);
};
constexpr Family kFamilies[] = {{"quads", Quads},       {"mixed", Mixed},       {"concave", Concave},
                                {"bow_ties", BowTies},  {"mirrored", Mirrored}, {"repeated", Repeated},
                                {"merged", Merged},     {"flaps", Flaps},       {"voxels", QuadVoxels},
                                {"soup", PolygonSoup},         {"doubled", Doubled},   {"thin", Thin},
                                {"spirals", Spirals},   {"caps", Caps}};

void AppendDigits(double value, std::string* text) {
  char digits[32];
  const auto end = std::to_chars(digits, digits + sizeof digits, value).ptr;
  text->append(digits, end);
}

}  // namespace

std::vector<std::string> PolygonFamilies() {
  std::vector<std::string> names;
  for (const Family& family : kFamilies) names.emplace_back(family.name);
  return names;
}

Polygons MakePolygons(const std::string& family, std::uint64_t seed, int size) {
  Dice dice(seed);
  for (const Family& each : kFamilies) {
    if (each.name == family) return each.make(dice, size);
  }
  return {};
}

std::string ObjText(const Polygons& mesh) {
  std::string text;
  for (const Vec3& p : mesh.positions) {
    text += 'v';
    for (const double x : p) {
      text += ' ';
      AppendDigits(x, &text);
    }
    text += '\n';
  }
  for (const auto& polygon : mesh.polygons) {
    text += 'f';
    for (const std::int32_t v : polygon) text += " " + std::to_string(v + 1);
    text += '\n';
  }
  return text;
}

}  // namespace planish::testing
