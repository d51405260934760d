// Families of meshes as strangers send them: copies, cracks, foliage, depth images, voxels.
#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <numeric>
#include <utility>

#include "Eigen/Geometry"
#include "tests/testing/dice.h"
#include "tests/testing/hard_families.h"
#include "tests/testing/isosurfaces.h"

namespace planish::testing {
namespace {

// Shells round or beside another mesh, along its vertices' normals, as offset tools make them: they run through
// themselves, touch the mesh where the distance is 0, and share its vertices in places.
Mesh Offset(Dice& dice, std::uint64_t seed, int faces) {
  Mesh mesh = Ordinary(dice, seed, faces / 2);
  std::vector<Vec3> normals(mesh.positions.size(), Vec3::Zero());
  for (const Face& face : mesh.faces) {
    const Vec3& a = mesh.positions[face[0]];
    const Vec3 normal = (mesh.positions[face[1]] - a).cross(mesh.positions[face[2]] - a);
    for (const std::int32_t v : face) normals[v] += normal;
  }
  const double distance = (dice.OneIn(2) ? 1 : -1) * std::pow(10, dice.In(-9, 0));
  const int shared = dice.OneIn(3) ? 1 << 30 : 1 + dice.Below(40);
  const Vec3 wave = dice.Point(-6, 6);
  std::vector<std::int32_t> twin;
  const std::size_t count = mesh.positions.size();
  for (std::size_t v = 0; v < count; ++v) {
    const double part = dice.OneIn(2) ? 1 : std::max(0.0, std::sin(wave.dot(mesh.positions[v])));
    const bool is_shared = dice.OneIn(shared) || part == 0;
    twin.push_back(static_cast<std::int32_t>(is_shared ? v : mesh.positions.size()));
    if (is_shared) continue;
    mesh.positions.push_back(mesh.positions[v] + part * distance * normals[v].normalized());
  }
  const bool is_closed = dice.OneIn(2);
  for (std::size_t f = mesh.faces.size(); f-- > 0;) {
    Face face = {twin[mesh.faces[f][0]], twin[mesh.faces[f][1]], twin[mesh.faces[f][2]]};
    if (is_closed) TurnOver(&face);
    mesh.faces.push_back(face);
  }
  return mesh;
}

// A mesh many times over in one place: as it is, mirrored, turned inside out, a hair beside, with vertices in common.
Mesh Copies(Dice& dice, std::uint64_t seed, int faces) {
  const int copies = 2 + dice.Below(dice.OneIn(3) ? 40 : 4);
  const Mesh one = Ordinary(dice, seed, std::max(20, faces / copies));
  Mesh mesh = one;
  const int plane = dice.Below(3);
  const double hair = dice.OneIn(2) ? 0 : std::pow(10, dice.In(-16, -3));
  for (int copy = 1; copy < copies; ++copy) {
    Mesh other = one;
    const Vec3 to = hair * dice.Direction();
    for (Vec3& p : other.positions) p += to;
    if (dice.OneIn(3)) {
      for (Vec3& p : other.positions) p[plane] = -p[plane];
    }
    if (dice.OneIn(3)) {
      for (Face& face : other.faces) TurnOver(&face);
    }
    Append(other, &mesh);
  }
  return dice.OneIn(2) ? Weld(mesh) : mesh;
}

// Patches whose common borders are not quite the same: gaps and overlaps of a hair, some of them filled by slivers.
Mesh Cracks(Dice& dice, std::uint64_t seed, int faces) {
  const Mesh whole = Ordinary(dice, seed, faces);
  const double hair = std::pow(10, dice.In(-16, -2)), cell = dice.In(0.05, 1);
  const bool is_filled = dice.OneIn(2);
  Mesh mesh;
  std::map<std::array<std::int32_t, 4>, std::int32_t> ids;  // by vertex and patch
  std::map<std::pair<std::int32_t, std::int32_t>, std::array<std::int32_t, 2>> edges;
  for (const Face& face : whole.faces) {
    Vec3 middle = Vec3::Zero();
    for (const std::int32_t v : face) middle += whole.positions[v] / (3 * cell);
    std::array<std::int32_t, 3> patch;
    for (int k = 0; k < 3; ++k) patch[k] = static_cast<std::int32_t>(std::floor(std::clamp(middle[k], -1e6, 1e6)));
    Face own;
    for (int k = 0; k < 3; ++k) {
      const auto [at, is_new] = ids.emplace(std::array{face[k], patch[0], patch[1], patch[2]},
                                            static_cast<std::int32_t>(mesh.positions.size()));
      if (is_new) mesh.positions.push_back(whole.positions[face[k]] + hair * dice.Direction());
      own[k] = at->second;
    }
    mesh.faces.push_back(own);
    for (int k = 0; is_filled && k < 3; ++k) {
      edges[{face[k], face[(k + 1) % 3]}] = {own[k], own[(k + 1) % 3]};
      const auto beside = edges.find({face[(k + 1) % 3], face[k]});
      if (beside == edges.end() || beside->second[0] == own[(k + 1) % 3] || dice.OneIn(5)) continue;
      mesh.faces.push_back({own[(k + 1) % 3], own[k], beside->second[1]});
      mesh.faces.push_back({own[(k + 1) % 3], beside->second[1], beside->second[0]});
    }
  }
  return mesh;
}

// Triangles of all sizes: a mesh that is refined towards points, up to a billionfold, and a huge floor under some.
Mesh Uneven(Dice& dice, std::uint64_t seed, int faces) {
  Mesh mesh = Ordinary(dice, seed, std::max(20, faces / 4));
  if (mesh.faces.empty()) return mesh;
  const int depth = 1 + dice.Below(30);
  const double share = dice.OneIn(2) ? 1.0 / 3 : dice.In(0.001, 0.6);
  while (mesh.num_faces() < faces) {
    std::size_t f = static_cast<std::size_t>(dice.Below(static_cast<int>(mesh.faces.size())));
    for (int level = 0; level < depth; ++level) {
      const auto [a, b, c] = mesh.faces[f];
      const auto middle = static_cast<std::int32_t>(mesh.positions.size());
      const Vec3 p = mesh.positions[a], q = (mesh.positions[b] + mesh.positions[c]) / 2;
      mesh.positions.push_back(p + share * (q - p));
      mesh.faces[f] = {a, b, middle};
      mesh.faces.push_back({b, c, middle});
      mesh.faces.push_back({c, a, middle});
      if (dice.OneIn(3)) f = mesh.faces.size() - 1;
    }
  }
  if (!dice.OneIn(3)) return mesh;
  Mesh floor = Grid(1, 1, [](double u, double v) { return Vec3(u - 0.5, v - 0.5, -2e-7); });
  const double size = std::pow(10, dice.In(0, 7));
  for (Vec3& p : floor.positions) p *= size;
  Append(floor, &mesh);
  return mesh;
}

// Ramps that wind round an axis many times, pointed cones, and fans whose spokes are of all lengths.
Mesh Winding(Dice& dice, int faces) {
  Mesh mesh;
  const int parts = 1 + dice.Below(3), n = std::max(4, faces / parts);
  for (int part = 0; part < parts; ++part) {
    const double turns = dice.OneIn(3) ? 1 : dice.In(0.01, 30), rise = dice.OneIn(3) ? 0 : std::pow(10, dice.In(-6, 1)),
                 spread = dice.OneIn(2) ? 0 : dice.In(0, 6), wave = dice.OneIn(2) ? 0 : dice.In(0, 5);
    const bool is_closed = dice.OneIn(2);
    Mesh one;
    one.positions.push_back(Vec3::Zero());
    for (int k = 0; k <= n; ++k) {
      const double a = kTurn * turns * k / n, r = std::pow(10, -dice.In(0, std::max(spread, 1e-9)));
      one.positions.push_back(r * Vec3(std::cos(a), std::sin(a), rise * k / n + wave * std::sin(7 * a)));
    }
    for (std::int32_t k = 1; k <= n; ++k) one.faces.push_back({0, k, k + 1});
    if (is_closed) one.faces.push_back({0, n + 1, 1});
    const Vec3 to = dice.Point(-1, 1);
    for (Vec3& p : one.positions) p += to;
    Append(one, &mesh);
  }
  return mesh;
}

// Steiner's Roman surface and cross-caps: one-sided, closed, through themselves, with points of no normal.
Mesh Roman(Dice& dice, int faces) {
  const int n = std::max(4, static_cast<int>(std::sqrt(faces / 2.0)));
  const double mix = dice.OneIn(3) ? 0 : dice.OneIn(2) ? 1 : dice.In(0, 1), squeeze = std::pow(10, dice.In(-4, 0));
  Mesh mesh = Grid(n, n, [&](double u, double v) {
    const double a = kTurn * u / 2, b = kTurn * v / 2;  // opposite points of a sphere are one
    const Vec3 p(std::sin(b) * std::cos(a), std::sin(b) * std::sin(a), std::cos(b));
    const Vec3 roman(p.y() * p.z(), p.z() * p.x(), p.x() * p.y());
    const Vec3 cap(p.y() * p.z(), 2 * p.x() * p.y(), p.x() * p.x() - p.y() * p.y());
    return Vec3(((mix * roman + (1 - mix) * cap).cwiseProduct(Vec3(1, 1, squeeze)) * 1e9).array().round() / 1e9);
  });
  return dice.OneIn(4) ? mesh : Weld(mesh);
}

// Depth images as triangles: grids with noise in steps, holes, and long triangles across the jumps.
Mesh DepthImage(Dice& dice, int faces) {
  const int n = std::max(3, static_cast<int>(std::sqrt(faces / 2.0)));
  const double steps = dice.OneIn(2) ? 256 : 65536, noise = std::pow(10, dice.In(-4, -1));
  std::vector<Vec3> blobs;
  for (int i = 1 + dice.Below(12); i > 0; --i) blobs.push_back(dice.Point(0, 1));
  Mesh mesh = Grid(n, n, [&](double u, double v) {
    double depth = 0.9;
    for (const Vec3& blob : blobs) {
      if (std::hypot(u - blob.x(), v - blob.y()) < 0.3 * blob.z()) depth = std::min(depth, blob.z());
    }
    depth = std::max(1.0, std::round(steps * (depth + dice.In(-noise, noise)))) / steps;
    return Vec3(depth * (u - 0.5), depth * (v - 0.5), depth);
  });
  const double cut = dice.OneIn(2) ? 10 : dice.In(0.01, 0.5);
  const int missing = dice.OneIn(2) ? 1 << 30 : 2 + dice.Below(50);
  std::erase_if(mesh.faces, [&](const Face& f) {
    double low = 1, high = 0;
    for (const std::int32_t v : f) {
      low = std::min(low, mesh.positions[v].z());
      high = std::max(high, mesh.positions[v].z());
    }
    return high - low > cut || dice.OneIn(missing);
  });
  return mesh;
}

// Cards through each other, as of foliage, all of them two-sided; some share the edge in which they cross.
Mesh Cards(Dice& dice, int faces) {
  Mesh mesh;
  const bool shares = dice.OneIn(2), is_two_sided = dice.OneIn(2);
  const int cells = 1 + dice.Below(3);
  while (mesh.num_faces() < faces) {
    const int cards = 1 + dice.Below(4);
    const Vec3 at = dice.Point(-1, 1);
    const double size = std::pow(10, dice.In(-3, 0));
    Mesh clump;
    for (int card = 0; card < cards; ++card) {
      const double a = kTurn * card / (2 * cards);
      Mesh one = Grid(2 * cells, 2 * cells, [&](double u, double v) {
        return Vec3(at + size * Vec3((u - 0.5) * std::cos(a), (u - 0.5) * std::sin(a), v));
      });
      const std::vector<Face> front = one.faces;
      for (std::size_t f = 0; is_two_sided && f < front.size(); ++f) {
        one.faces.push_back({front[f][0], front[f][2], front[f][1]});
      }
      Append(one, &clump);
    }
    Append(shares ? Weld(clump) : clump, &mesh);
  }
  return mesh;
}

// Cubes of a grid at random: edges of four faces, pieces that meet in a vertex; or all sides of each cube.
Mesh Voxels(Dice& dice, int faces) {
  const int n = std::max(2, static_cast<int>(std::cbrt(faces / 4.0)));
  const double full = dice.In(0.05, 0.95);
  const bool is_open = dice.OneIn(4);
  std::vector<char> filled(static_cast<std::size_t>(n) * n * n);
  for (char& cube : filled) cube = dice.In(0, 1) < full;
  const auto at = [&](const std::array<int, 3>& p) {
    const bool is_inside = std::all_of(p.begin(), p.end(), [&](int x) { return x >= 0 && x < n; });
    return is_inside && filled[(static_cast<std::size_t>(p[2]) * n + p[1]) * n + p[0]] != 0;
  };
  Mesh mesh;
  std::map<std::array<int, 3>, std::int32_t> ids;
  for (int cube = 0; cube < n * n * n && mesh.num_faces() < 2 * faces; ++cube) {
    const std::array<int, 3> p = {cube % n, cube / n % n, cube / n / n};
    for (int side = 0; at(p) && side < 6; ++side) {
      const int axis = side / 2, u = (axis + 1) % 3, v = (axis + 2) % 3;
      std::array<int, 3> beside = p;
      beside[axis] += side % 2 == 0 ? -1 : 1;
      if (at(beside) && !is_open) continue;
      std::array<std::int32_t, 4> quad;
      for (int k = 0; k < 4; ++k) {
        std::array<int, 3> corner = p;
        corner[axis] += side % 2;
        corner[u] += k == 1 || k == 2;
        corner[v] += k >= 2;
        const auto [id, is_new] = ids.emplace(corner, static_cast<std::int32_t>(mesh.positions.size()));
        if (is_new) mesh.positions.emplace_back(corner[0], corner[1], corner[2]);
        quad[k] = id->second;
      }
      if (side % 2 == 0) std::swap(quad[1], quad[3]);
      AddQuad(quad, &mesh);
    }
  }
  return mesh;
}

// Faces by the thousand at one edge, round one vertex, or in one place.
Mesh Piles(Dice& dice, int faces) {
  Mesh mesh;
  const int kind = dice.Below(4);
  const double height = dice.OneIn(2) ? 0 : std::pow(10, dice.In(-12, 0));
  mesh.positions = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}};
  for (std::int32_t i = 0; i < faces; ++i) {
    const auto last = static_cast<std::int32_t>(mesh.positions.size());
    if (kind == 0) {  // at an edge, all round it
      const double a = dice.In(0, kTurn);
      mesh.positions.emplace_back(dice.In(-1, 2), std::cos(a), std::sin(a));
      mesh.faces.push_back(dice.OneIn(2) ? Face{0, 1, last} : Face{1, 0, last});
    } else if (kind == 1) {  // round a vertex, without another in common
      mesh.positions.push_back(dice.Direction());
      mesh.positions.push_back(dice.Direction());
      mesh.faces.push_back({0, last, last + 1});
    } else if (kind == 2) {  // the same corners
      mesh.faces.push_back(dice.OneIn(2) ? Face{0, 1, 2} : Face{0, 2, 1});
    } else {  // the same place, about
      for (const Vec3& p : {Vec3(0, 0, 0), Vec3(1, 0, 0), Vec3(0, 1, 0)}) {
        mesh.positions.push_back(p + height * dice.Direction());
      }
      mesh.faces.push_back({last, last + 1, last + 2});
    }
  }
  return mesh;
}

// A polygon with many corners as CAD kernels cut it up, one ear after the other, and the same below with a wall
// between.
Mesh EarClipped(Dice& dice, int faces) {
  const int n = std::clamp(faces / 4, 5, 3000);
  const double depth = dice.In(0, 0.95), height = std::pow(10, dice.In(-6, 0));
  const int teeth = dice.OneIn(2) ? n : 1 + dice.Below(n);
  Mesh mesh;
  for (int k = 0; k < n; ++k) {
    const double a = kTurn * k / n, r = 1 - depth * (k * 1LL * teeth / n % 2 == 0 ? 0 : dice.In(0.5, 1));
    mesh.positions.emplace_back(r * std::cos(a), r * std::sin(a), 0);
  }
  const auto area = [&](std::int32_t a, std::int32_t b, std::int32_t c) {
    const Vec3 &p = mesh.positions[a], &q = mesh.positions[b], &r = mesh.positions[c];
    return (q - p).cross(r - p).z();
  };
  std::vector<std::int32_t> rest(n);
  std::iota(rest.begin(), rest.end(), 0);
  for (std::size_t k = 0, in_vain = 0; rest.size() > 2 && in_vain <= rest.size(); ++k) {
    const std::size_t m = rest.size(), i = k % m;
    const std::int32_t a = rest[(i + m - 1) % m], b = rest[i], c = rest[(i + 1) % m];
    const bool is_ear =
        area(a, b, c) > 0 && std::none_of(rest.begin(), rest.end(), [&](std::int32_t v) {
          return v != a && v != b && v != c && area(a, b, v) >= 0 && area(b, c, v) >= 0 && area(c, a, v) >= 0;
        });
    ++in_vain;
    if (!is_ear) continue;
    mesh.faces.push_back({a, b, c});
    rest.erase(rest.begin() + static_cast<std::ptrdiff_t>(i));
    in_vain = 0;
  }
  const std::vector<Face> above = mesh.faces;
  for (std::int32_t v = 0; v < n; ++v) mesh.positions.push_back(mesh.positions[v] - height * Vec3::UnitZ());
  for (const Face& face : above) mesh.faces.push_back({face[0] + n, face[2] + n, face[1] + n});
  for (std::int32_t v = 0; v < n; ++v) AddQuad({v, v + n, (v + 1) % n + n, (v + 1) % n}, &mesh);
  return mesh;
}

}  // namespace

std::vector<NamedMaker> WildMakers() {
  return {{"offset", Offset},
          {"copies", Copies},
          {"cracks", Cracks},
          {"uneven", Uneven},
          {"winding", WithoutSeed<Winding>},
          {"roman", WithoutSeed<Roman>},
          {"depth_image", WithoutSeed<DepthImage>},
          {"cards", WithoutSeed<Cards>},
          {"voxels", WithoutSeed<Voxels>},
          {"piles", WithoutSeed<Piles>},
          {"ear_clipped", WithoutSeed<EarClipped>}};
}

}  // namespace planish::testing
