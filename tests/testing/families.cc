#include "tests/testing/families.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdlib>
#include <map>
#include <memory>
#include <numbers>
#include <random>
#include <tuple>

#include "Eigen/Geometry"
#include "tests/testing/dice.h"
#include "tests/testing/hard_families.h"
#include "tests/testing/isosurfaces.h"

namespace planish::testing {

void Append(const Mesh& part, Mesh* mesh) {
  const auto first = static_cast<std::int32_t>(mesh->positions.size());
  mesh->positions.insert(mesh->positions.end(), part.positions.begin(), part.positions.end());
  for (const Face& face : part.faces) mesh->faces.push_back({first + face[0], first + face[1], first + face[2]});
}

Mesh Weld(const Mesh& mesh) {
  Mesh welded;
  std::map<std::array<double, 3>, std::int32_t> ids;
  std::vector<std::int32_t> id;
  for (const Vec3& p : mesh.positions) {
    const auto [at, is_new] =
        ids.emplace(std::array<double, 3>{p.x(), p.y(), p.z()}, static_cast<std::int32_t>(welded.positions.size()));
    if (is_new) welded.positions.push_back(p);
    id.push_back(at->second);
  }
  for (const Face& face : mesh.faces) welded.faces.push_back({id[face[0]], id[face[1]], id[face[2]]});
  return welded;
}

void CutByPlane(const Vec3& point, const Vec3& normal, Mesh* mesh) {
  std::map<std::pair<std::int32_t, std::int32_t>, std::int32_t> ids;
  std::vector<double> height;
  for (const Vec3& p : mesh->positions) height.push_back(normal.dot(p - point));
  std::vector<Face> faces;
  const auto cut = [&](std::int32_t a, std::int32_t b) {
    const auto [at, is_new] = ids.emplace(std::minmax(a, b), static_cast<std::int32_t>(mesh->positions.size()));
    if (is_new) {
      const double t = height[a] / (height[a] - height[b]);
      const Vec3 p = mesh->positions[a] + t * (mesh->positions[b] - mesh->positions[a]);
      mesh->positions.push_back(p);
    }
    return at->second;
  };
  for (const Face& face : mesh->faces) {
    int alone = -1;
    for (int k = 0; k < 3; ++k) {
      const bool here = height[face[k]] < 0;
      if (here != (height[face[Next(k)]] < 0) && here != (height[face[Prev(k)]] < 0)) alone = k;
    }
    if (alone < 0) {
      faces.push_back(face);
      continue;
    }
    const std::int32_t a = face[alone], b = face[Next(alone)], c = face[Prev(alone)];
    const std::int32_t p = cut(a, b), q = cut(a, c);
    faces.push_back({a, p, q});
    faces.push_back({p, b, c});
    faces.push_back({p, c, q});
  }
  mesh->faces = std::move(faces);
}

namespace {

constexpr double kPi = std::numbers::pi;

// ---- parts of assemblies

// A closed surface between two loops and their middles: loops of equal length, each from the last by triangles.
Mesh Lathe(const std::vector<std::vector<Vec3>>& loops, bool has_caps) {
  Mesh mesh;
  const auto sides = static_cast<std::int32_t>(loops[0].size());
  for (const std::vector<Vec3>& loop : loops) mesh.positions.insert(mesh.positions.end(), loop.begin(), loop.end());
  for (std::int32_t i = 0; i + 1 < static_cast<std::int32_t>(loops.size()); ++i) {
    for (std::int32_t k = 0; k < sides; ++k) {
      const std::int32_t a = i * sides + k, b = i * sides + (k + 1) % sides;
      AddQuad({a, b, b + sides, a + sides}, &mesh);
    }
  }
  if (!has_caps) return mesh;
  for (const bool is_top : {false, true}) {
    Vec3 middle = Vec3::Zero();
    for (const Vec3& p : is_top ? loops.back() : loops.front()) middle += p / sides;
    const std::int32_t first = is_top ? (static_cast<std::int32_t>(loops.size()) - 1) * sides : 0;
    const auto centre = static_cast<std::int32_t>(mesh.positions.size());
    mesh.positions.push_back(middle);
    for (std::int32_t k = 0; k < sides; ++k) {
      const std::int32_t a = first + k, b = first + (k + 1) % sides;
      if (is_top) {
        mesh.faces.push_back({centre, a, b});
      } else {
        mesh.faces.push_back({centre, b, a});
      }
    }
  }
  return mesh;
}

std::vector<Vec3> Loop(int sides, double z, const std::function<double(double)>& radius) {
  std::vector<Vec3> loop;
  for (int k = 0; k < sides; ++k) {
    const double angle = 2 * kPi * k / sides;
    loop.emplace_back(radius(angle) * std::cos(angle), radius(angle) * std::sin(angle), z);
  }
  return loop;
}

Mesh BevelledBox(Dice& dice) {
  const Vec3 size = dice.Point(0.1, 0.6);
  const double bevel = dice.OneIn(3) ? 0 : dice.In(0.01, 0.3) * size.minCoeff();
  const auto ring = [&](double z, double inset) {
    const double x = size.x() / 2 - inset, y = size.y() / 2 - inset;
    return std::vector<Vec3>{{-x, -y, z}, {x, -y, z}, {x, y, z}, {-x, y, z}};
  };
  const double h = size.z() / 2;
  if (bevel == 0) return Lathe({ring(-h, 0), ring(h, 0)}, true);
  return Lathe({ring(-h, bevel), ring(-h + bevel, 0), ring(h - bevel, 0), ring(h, bevel)}, true);
}

Mesh Tube(Dice& dice) {
  const int sides = 6 + dice.Below(24);
  const double outer = dice.In(0.05, 0.3), inner = outer * dice.In(0.5, 0.98), h = dice.In(0.05, 0.8);
  const auto at = [](double radius) { return [radius](double) { return radius; }; };
  return Lathe({Loop(sides, 0, at(inner)), Loop(sides, 0, at(outer)), Loop(sides, h, at(outer)),
                Loop(sides, h, at(inner)), Loop(sides, 0, at(inner))},
               false);
}

Mesh Gear(Dice& dice) {
  const int teeth = 5 + dice.Below(20);
  const double radius = dice.In(0.1, 0.4), depth = dice.In(0.05, 0.3), h = dice.In(0.02, 0.2);
  const auto tooth = [=](double angle) {
    return std::fmod(angle * teeth / (2 * kPi) + 0.01, 1.0) < 0.5 ? radius : radius * (1 - depth);
  };
  return Lathe({Loop(4 * teeth, 0, tooth), Loop(4 * teeth, h, tooth)}, true);
}

// A plate with square holes; its outline has more vertices below than above where there are T-junctions.
Mesh Plate(Dice& dice) {
  const int n = 4 + dice.Below(6);
  Mesh mesh;
  const double h = dice.In(0.01, 0.1);
  std::vector<char> is_hole(static_cast<std::size_t>(n) * n, 0);
  for (int i = 1; i + 1 < n; ++i) {
    for (int j = 1; j + 1 < n; ++j) is_hole[i * n + j] = dice.OneIn(4);
  }
  const auto filled = [&](int i, int j) { return i >= 0 && j >= 0 && i < n && j < n && !is_hole[i * n + j]; };
  const auto add = [&](const std::array<Vec3, 4>& corners) {
    Mesh quad;
    quad.positions.assign(corners.begin(), corners.end());
    quad.faces = {{0, 1, 2}, {0, 2, 3}};
    Append(quad, &mesh);
  };
  for (int i = 0; i < n; ++i) {
    for (int j = 0; j < n; ++j) {
      if (!filled(i, j)) continue;
      const auto at = [&](int x, int y, int z) { return Vec3(0.6 * x / n, 0.6 * y / n, z * h); };
      add({at(i, j, 1), at(i + 1, j, 1), at(i + 1, j + 1, 1), at(i, j + 1, 1)});
      add({at(i, j, 0), at(i, j + 1, 0), at(i + 1, j + 1, 0), at(i + 1, j, 0)});
      if (!filled(i, j - 1)) add({at(i, j, 0), at(i + 1, j, 0), at(i + 1, j, 1), at(i, j, 1)});
      if (!filled(i, j + 1)) add({at(i + 1, j + 1, 0), at(i, j + 1, 0), at(i, j + 1, 1), at(i + 1, j + 1, 1)});
      if (!filled(i - 1, j)) add({at(i, j + 1, 0), at(i, j, 0), at(i, j, 1), at(i, j + 1, 1)});
      if (!filled(i + 1, j)) add({at(i + 1, j, 0), at(i + 1, j + 1, 0), at(i + 1, j + 1, 1), at(i + 1, j, 1)});
    }
  }
  return Weld(mesh);
}

// A vertex in the middle of one of each face's edges, that the neighbour does not have.
void AddTJunctions(Dice& dice, Mesh* mesh) {
  const std::size_t count = mesh->faces.size();
  for (std::size_t f = 0; f < count; ++f) {
    if (!dice.OneIn(6)) continue;
    const Face face = mesh->faces[f];
    const auto middle = static_cast<std::int32_t>(mesh->positions.size());
    mesh->positions.push_back((mesh->positions[face[0]] + mesh->positions[face[1]]) / 2);
    mesh->faces[f] = {face[0], middle, face[2]};
    mesh->faces.push_back({middle, face[1], face[2]});
  }
}

Mesh Assembly(Dice& dice, int faces) {
  Mesh mesh;
  const double spread = dice.In(0.2, 3);
  const bool is_on_grid = dice.OneIn(2);
  while (mesh.num_faces() < faces) {
    Mesh part;
    switch (dice.Below(4)) {
      case 0:
        part = BevelledBox(dice);
        break;
      case 1:
        part = Tube(dice);
        break;
      case 2:
        part = Gear(dice);
        break;
      default:
        part = Plate(dice);
        break;
    }
    if (dice.OneIn(6)) AddTJunctions(dice, &part);
    if (dice.OneIn(8)) {
      for (Face& face : part.faces) std::swap(face[1], face[2]);
    }
    if (dice.OneIn(8)) {
      for (Face& face : part.faces) {
        if (dice.OneIn(3)) std::swap(face[1], face[2]);
      }
    }
    // On a grid parts touch exactly.
    Eigen::Matrix3d turn = Eigen::Matrix3d::Identity();
    Vec3 to = dice.Point(-spread, spread);
    if (is_on_grid) {
      to = (4 * to).array().round().matrix() / 4;
    } else {
      turn = Eigen::AngleAxisd(dice.In(0, 2 * kPi), dice.Direction()).toRotationMatrix();
    }
    for (Vec3& p : part.positions) p = turn * p + to;
    const int copies = dice.OneIn(10) ? 2 : 1;
    for (int i = 0; i < copies; ++i) Append(part, &mesh);
  }
  return dice.OneIn(2) ? Weld(mesh) : mesh;
}

// ---- the others

Mesh Quantized(Dice& dice, int faces) {
  const int rows = std::max(4, static_cast<int>(std::sqrt(faces / 4.0)));
  const int columns = 2 * rows;
  const std::array<Vec3, 3> waves = {dice.Point(-5, 5), dice.Point(-5, 5), dice.Point(-9, 9)};
  const double height = dice.In(0.02, 0.4), grid = dice.OneIn(3) ? 8 : dice.OneIn(2) ? 40 : 300;
  std::vector<std::vector<Vec3>> loops;
  for (int i = 1; i < rows; ++i) {
    loops.emplace_back();
    for (int k = 0; k < columns; ++k) {
      const double theta = kPi * i / rows, phi = 2 * kPi * k / columns;
      Vec3 p(std::sin(theta) * std::cos(phi), std::sin(theta) * std::sin(phi), -std::cos(theta));
      double r = 1;
      for (const Vec3& wave : waves) r += height / 3 * std::sin(wave.dot(p) + wave.x());
      loops.back().push_back(((r * p) * grid).array().round().matrix() / grid);
    }
  }
  Mesh mesh = Lathe(loops, true);
  return dice.OneIn(2) ? Weld(mesh) : mesh;
}

Mesh Slivers(Dice& dice, int faces) {
  Mesh mesh = dice.OneIn(2) ? Plate(dice) : BevelledBox(dice);
  while (mesh.num_faces() < faces) {
    // Through a vertex but for a hair.
    const Vec3 p = mesh.positions[dice.Below(static_cast<int>(mesh.positions.size()))];
    const double hair = std::pow(10, dice.In(-13, -2));
    const std::int64_t before = mesh.num_faces();
    CutByPlane(p + hair * dice.Direction(), dice.Direction(), &mesh);
    if (mesh.num_faces() == before) break;
  }
  return mesh;
}

Mesh Skirts(Dice& dice, int faces) {
  const int tiles = 1 + dice.Below(4), n = std::max(3, static_cast<int>(std::sqrt(faces / 2.0 / tiles)));
  Mesh mesh;
  for (int tile = 0; tile < tiles; ++tile) {
    const std::array<Vec3, 4> waves = {dice.Point(-4, 4), dice.Point(-8, 8), dice.Point(-20, 20), dice.Point(-60, 60)};
    const double height = dice.In(0.05, 1), depth = dice.In(0.05, 0.5);
    Mesh part;
    for (int j = 0; j <= n + 2; ++j) {
      for (int i = 0; i <= n + 2; ++i) {
        const double x = std::clamp(i - 1, 0, n) * 1.0 / n + tile, y = std::clamp(j - 1, 0, n) * 1.0 / n;
        double z = 0;
        for (std::size_t w = 0; w < waves.size(); ++w) {
          z += height / static_cast<double>(1 << w) * std::sin(waves[w].x() * x + waves[w].y() * y + waves[w].z());
        }
        if (i == 0 || j == 0 || i == n + 2 || j == n + 2) z -= depth;
        part.positions.emplace_back(x, y, z);
      }
    }
    for (std::int32_t j = 0; j <= n + 1; ++j) {
      for (std::int32_t i = 0; i <= n + 1; ++i) {
        const std::int32_t a = j * (n + 3) + i;
        AddQuad({a, a + 1, a + n + 4, a + n + 3}, &part);
      }
    }
    Append(part, &mesh);
  }
  return dice.OneIn(2) ? Weld(mesh) : mesh;
}

Mesh Pages(Dice& dice, int faces) {
  const int pages = 3 + dice.Below(6), n = std::max(2, static_cast<int>(std::sqrt(faces / 2.0 / pages)));
  Mesh mesh;
  for (int page = 0; page < pages; ++page) {
    const double angle = dice.OneIn(5) ? 0 : dice.In(0, 2 * kPi), bend = dice.In(-1, 1);
    const bool is_turned = dice.OneIn(3);
    Mesh part;
    for (int j = 0; j <= n; ++j) {
      for (int i = 0; i <= n; ++i) {
        const double r = 1.0 * i / n, turn = angle + bend * r;
        part.positions.emplace_back(r * std::cos(turn), r * std::sin(turn), 1.0 * j / n);
      }
    }
    for (std::int32_t j = 0; j < n; ++j) {
      for (std::int32_t i = 0; i < n; ++i) {
        const std::int32_t a = j * (n + 1) + i;
        AddQuad({a, a + 1, a + n + 2, a + n + 1}, &part);
      }
    }
    for (Face& face : part.faces) {
      if (is_turned) std::swap(face[1], face[2]);
    }
    Append(part, &mesh);
  }
  return Weld(mesh);
}

Mesh Soup(Dice& dice, int faces) {
  Mesh mesh;
  const int vertices = 4 + faces / (1 + dice.Below(6));
  for (int i = 0; i < vertices; ++i) mesh.positions.push_back(dice.Point(0, 1));
  for (int i = 0; i < faces; ++i)
    mesh.faces.push_back({dice.Below(vertices), dice.Below(vertices), dice.Below(vertices)});
  return mesh;
}

// An isosurface of about `faces` triangles: a grid of n cells has some n^2 of them.
Mesh RandomIsosurface(Dice& dice, std::uint64_t seed, int faces, Contouring contouring) {
  const int n = std::clamp(static_cast<int>(std::sqrt(faces / 6.0)), 8, 512);
  Mesh mesh = Isosurface(RandomField(seed), n, contouring);
  if (dice.OneIn(2)) {
    const double noise = dice.In(0, 0.45) * 2 / n;
    for (Vec3& p : mesh.positions) p += dice.Point(-noise, noise);
  }
  return mesh;
}

// Fewer than three different corners make no face.
Mesh WithoutRepeatedCorners(Mesh mesh) {
  std::erase_if(mesh.faces, [](const Face& f) { return f[0] == f[1] || f[1] == f[2] || f[2] == f[0]; });
  return mesh;
}

}  // namespace

std::vector<std::string> Families() {
  std::vector<std::string> names = {"surface_nets", "sparse_nets", "dual_contouring", "marching_cubes",
                                    "assembly",     "high_genus",  "quantized",       "slivers",
                                    "skirts",       "pages",       "soup"};
  for (std::string& name : HardFamilies()) names.push_back(std::move(name));
  return names;
}

Mesh MakeFamily(const std::string& family, std::uint64_t seed, int faces) {
  Dice dice(seed);
  if (family == "surface_nets") return RandomIsosurface(dice, seed, faces, Contouring::kSurfaceNets);
  if (family == "sparse_nets") return RandomIsosurface(dice, seed, faces, Contouring::kSparseNets);
  if (family == "dual_contouring") return RandomIsosurface(dice, seed, faces, Contouring::kDualContouring);
  if (family == "marching_cubes") return RandomIsosurface(dice, seed, faces, Contouring::kMarchingCubes);
  if (family == "assembly") return WithoutRepeatedCorners(Assembly(dice, faces));
  if (family == "high_genus") {
    const double bars = dice.In(2, 5), thickness = dice.In(0.15, 0.5);
    const int n = std::clamp(static_cast<int>(std::sqrt(faces / 8.0)), 8, 512);
    return Isosurface(
        [=](const Vec3& p) {
          // The distance from the nearest bars of a lattice.
          double least = p.cwiseAbs().maxCoeff() - 0.9;
          Vec3 cell;
          for (int axis = 0; axis < 3; ++axis) cell[axis] = std::sin(bars * p[axis]);
          const double bar = std::min(
              {std::hypot(cell.x(), cell.y()), std::hypot(cell.y(), cell.z()), std::hypot(cell.z(), cell.x())});
          return std::max(least, bar - thickness);
        },
        n, Contouring::kSurfaceNets);
  }
  if (family == "quantized") return WithoutRepeatedCorners(Quantized(dice, faces));
  if (family == "slivers") return WithoutRepeatedCorners(Slivers(dice, faces));
  if (family == "skirts") return WithoutRepeatedCorners(Skirts(dice, faces));
  if (family == "pages") return WithoutRepeatedCorners(Pages(dice, faces));
  if (family == "soup") return WithoutRepeatedCorners(Soup(dice, faces));
  return WithoutRepeatedCorners(MakeHardFamily(family, seed, faces));
}

}  // namespace planish::testing
