#include "tests/testing/hard_families.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <functional>
#include <numeric>
#include <utility>

#include "Eigen/Geometry"
#include "tests/testing/dice.h"
#include "tests/testing/families.h"
#include "tests/testing/isosurfaces.h"

namespace planish::testing {

Mesh Ordinary(Dice& dice, std::uint64_t seed, int faces) {
  constexpr std::array<const char*, 9> kNames = {"surface_nets", "dual_contouring", "marching_cubes",
                                                 "assembly",     "high_genus",      "quantized",
                                                 "slivers",      "skirts",          "pages"};
  return MakeFamily(kNames[static_cast<std::size_t>(dice.Below(9))], seed, faces);
}

Mesh Grid(int columns, int rows, const std::function<Vec3(double, double)>& place) {
  Mesh mesh;
  for (int j = 0; j <= rows; ++j) {
    for (int i = 0; i <= columns; ++i) mesh.positions.push_back(place(1.0 * i / columns, 1.0 * j / rows));
  }
  for (std::int32_t j = 0; j < rows; ++j) {
    for (std::int32_t i = 0; i < columns; ++i) {
      const std::int32_t a = j * (columns + 1) + i;
      AddQuad({a, a + 1, a + columns + 2, a + columns + 1}, &mesh);
    }
  }
  return mesh;
}

void RoundToFloats(Mesh* mesh) {
  for (Vec3& p : mesh->positions) p = p.cast<float>().cast<double>();
}

void TurnOver(Face* face) {
  std::swap((*face)[1], (*face)[2]);
}

namespace {

// Geographic coordinates: a small mesh a million units from the origin, half of them in float.
Mesh FarAway(Dice& dice, std::uint64_t seed, int faces) {
  Mesh mesh = Ordinary(dice, seed, faces);
  const double size = std::pow(10, dice.In(-1, 3));
  const Vec3 to = 1e6 * dice.Direction();
  for (Vec3& p : mesh.positions) p = size * p + to;
  if (dice.OneIn(2)) RoundToFloats(&mesh);
  return mesh;
}

// In other units, some of them squeezed along an axis.
Mesh Scaled(Dice& dice, std::uint64_t seed, int faces) {
  Mesh mesh = Ordinary(dice, seed, faces);
  const double size = std::pow(10, dice.In(-8, 8));
  Vec3 scale = Vec3::Constant(size);
  if (dice.OneIn(2)) scale[dice.Below(3)] *= std::pow(10, dice.In(-6, 0));
  for (Vec3& p : mesh.positions) p = scale.cwiseProduct(p);
  if (dice.OneIn(2)) RoundToFloats(&mesh);
  return mesh;
}

// Faces missing, twice there or turned over, vertices joined at random, pulled to a neighbour or without a face.
Mesh Damaged(Dice& dice, std::uint64_t seed, int faces) {
  Mesh mesh = Ordinary(dice, seed, faces);
  if (mesh.faces.empty()) return mesh;
  const auto vertices = static_cast<std::int32_t>(mesh.positions.size());
  const int rarity = 5 + dice.Below(60);
  const std::vector<Face> given = mesh.faces;
  mesh.faces.clear();
  const bool loses = dice.OneIn(2), doubles = dice.OneIn(2), turns = dice.OneIn(2), pulls = dice.OneIn(2),
             joins = dice.OneIn(4);
  for (Face face : given) {
    if (loses && dice.OneIn(rarity)) continue;
    if (turns && dice.OneIn(rarity)) TurnOver(&face);
    if (pulls && dice.OneIn(rarity)) mesh.positions[face[0]] = mesh.positions[face[1]];
    if (joins && dice.OneIn(rarity)) face[dice.Below(3)] = dice.Below(vertices);
    mesh.faces.push_back(face);
    for (int copies = doubles && dice.OneIn(rarity) ? 1 + dice.Below(3) : 0; copies > 0; --copies) {
      if (dice.OneIn(2)) TurnOver(&face);
      mesh.faces.push_back({face[1], face[2], face[0]});
    }
  }
  for (int i = dice.Below(5); i > 0; --i) mesh.positions.push_back(dice.Point(-1, 1));
  return mesh;
}

// A closed shell, thinner than its noise: both sides run through each other.
Mesh ThinSheet(Dice& dice, int faces) {
  const int n = std::max(4, static_cast<int>(std::sqrt(faces / 4.0)));
  const Vec3 wave = dice.Point(-4, 4), other = dice.Point(-4, 4);
  const double thickness = std::pow(10, dice.In(-6, -1)), noise = dice.OneIn(3) ? 0 : dice.In(0, 1) / n;
  const auto top = [&](double u, double v) {
    return Vec3(u, v, 0.2 * std::sin(wave.x() * u + wave.y() * v) + 0.1 * std::sin(other.x() * u - other.y() * v));
  };
  Mesh mesh = Grid(n, n, top);
  Mesh below = Grid(n, n, [&](double u, double v) { return Vec3(top(u, v) - thickness * Vec3::UnitZ()); });
  for (Face& face : below.faces) TurnOver(&face);
  const auto first = static_cast<std::int32_t>(mesh.positions.size());
  Append(below, &mesh);
  for (std::int32_t i = 0; i < n; ++i) {
    const std::int32_t row = n + 1;
    const auto side = [&](std::int32_t a, std::int32_t b) { AddQuad({a, a + first, b + first, b}, &mesh); };
    side(i, i + 1);
    side(n * row + i + 1, n * row + i);
    side((i + 1) * row, i * row);
    side(i * row + n, (i + 1) * row + n);
  }
  for (Vec3& p : mesh.positions) p += dice.Point(-noise, noise);
  return mesh;
}

// Moebius strips, Klein bottles and tori through each other, some with faces missing.
Mesh OneSided(Dice& dice, int faces) {
  Mesh mesh;
  const int parts = 1 + dice.Below(4);
  for (int part = 0; part < parts; ++part) {
    const int n = std::max(3, static_cast<int>(std::sqrt(faces / 2.0 / parts)));
    const int kind = dice.Below(3), twists = dice.Below(6);
    const double width = dice.In(0.05, 0.45);
    Mesh one = Grid(2 * n, std::max(1, n / 2), [&](double u, double v) {
      const double a = kTurn * u;
      double across = (v - 0.5) * width, up = 0;
      if (kind == 0) {
        const double turn = twists * a / 2;
        up = across * std::sin(turn), across *= std::cos(turn);
      } else if (kind == 1) {  // a figure of eight that turns by half
        const double b = kTurn * v, s = std::sin(b), t = std::sin(2 * b);
        across = width * (std::cos(a / 2) * s - std::sin(a / 2) * t);
        up = width * (std::sin(a / 2) * s + std::cos(a / 2) * t);
      } else {
        across = width * std::cos(kTurn * v), up = width * std::sin(kTurn * v);
      }
      return Vec3((1 + across) * std::cos(a), (1 + across) * std::sin(a), up);
    });
    // The last column comes to lie on the first: welded as if by a coarse grid.
    for (Vec3& p : one.positions) p = (p * 1e9).array().round().matrix() / 1e9;
    const int missing = dice.OneIn(2) ? 20 : 1 << 30;
    std::erase_if(one.faces, [&](const Face&) { return dice.OneIn(missing); });
    const Eigen::Matrix3d turn = Eigen::AngleAxisd(dice.In(0, kTurn), dice.Direction()).toRotationMatrix();
    one = Weld(one);
    for (Vec3& p : one.positions) p = turn * p;
    Append(one, &mesh);
  }
  return mesh;
}

// Edges collapsed at random, whatever that does: folds, needles, edges of many faces.
Mesh Decimated(Dice& dice, std::uint64_t seed, int faces) {
  Mesh mesh = Ordinary(dice, seed, 3 * faces);
  std::vector<std::int32_t> to(mesh.positions.size());
  std::iota(to.begin(), to.end(), 0);
  const auto root = [&](std::int32_t v) {
    while (to[v] != v) v = to[v] = to[to[v]];
    return v;
  };
  const int collapses = static_cast<int>(mesh.faces.size()) / 3;
  for (int i = 0; i < collapses; ++i) {
    const Face& face = mesh.faces[static_cast<std::size_t>(dice.Below(static_cast<int>(mesh.faces.size())))];
    const int k = dice.Below(3);
    to[root(face[k])] = root(face[(k + 1) % 3]);
  }
  for (Face& face : mesh.faces) face = {root(face[0]), root(face[1]), root(face[2])};
  if (dice.OneIn(2)) {
    const double grid = std::pow(10, dice.In(1, 4));
    for (Vec3& p : mesh.positions) p = (p * grid).array().round().matrix() / grid;
  }
  return mesh;
}

// A terrain as tiles of different resolutions: T-junctions, some of them welded.
Mesh Levels(Dice& dice, int faces) {
  Mesh mesh;
  const int side = 2 + dice.Below(5);
  const int most = std::max(1, static_cast<int>(std::log2(std::sqrt(faces / 2.0) / side)) + 1);
  const Vec3 wave = dice.Point(-9, 9), other = dice.Point(-20, 20);
  const double height = dice.In(0, 0.3);
  for (int i = 0; i < side; ++i) {
    for (int j = 0; j < side; ++j) {
      const int n = 1 << dice.Below(most + 1);
      Append(Grid(n, n,
                  [&](double u, double v) {
                    const double x = i + u, y = j + v;
                    return Vec3(x, y,
                                height * (std::sin(wave.x() * x + wave.y() * y) + std::sin(other.x() * x) * y / side));
                  }),
             &mesh);
    }
  }
  return dice.OneIn(3) ? mesh : Weld(mesh);
}

// What CAD exporters make of round parts: caps as fans from a rim's vertex or strips, walls of two triangles a side.
Mesh Turned(Dice& dice, int faces) {
  Mesh mesh;
  const int parts = 1 + dice.Below(4), sides = std::max(3, faces / 4 / parts);
  for (int part = 0; part < parts; ++part) {
    Mesh one;
    const double radius = std::pow(10, dice.In(-2, 0)), height = std::pow(10, dice.In(-4, 1));
    const double tip = dice.OneIn(3) ? 0 : dice.OneIn(2) ? std::pow(10, dice.In(-12, -2)) : dice.In(0.1, 1);
    for (const double r : {radius, radius * tip}) {
      const double z = one.positions.empty() ? 0 : height;
      for (int k = 0; k < sides; ++k) {
        one.positions.emplace_back(r * std::cos(kTurn * k / sides), r * std::sin(kTurn * k / sides), z);
      }
    }
    for (std::int32_t k = 0; k < sides; ++k) {
      const std::int32_t next = (k + 1) % sides;
      one.faces.push_back({k, next, sides + next});
      one.faces.push_back({k, sides + next, sides + k});
    }
    const bool is_fan = dice.OneIn(2);
    for (std::int32_t k = 1; k + 1 < sides; ++k) {
      if (is_fan) {
        one.faces.push_back({0, k + 1, k});
        one.faces.push_back({sides, sides + k, sides + k + 1});
      } else {  // to and fro between both sides of the rim
        const auto at = [&](std::int32_t i) { return i % 2 == 0 ? i / 2 : sides - 1 - i / 2; };
        Face face = {at(k - 1), at(k), at(k + 1)};
        if (k % 2 == 1) TurnOver(&face);
        one.faces.push_back({face[0], face[2], face[1]});
        one.faces.push_back({sides + face[0], sides + face[1], sides + face[2]});
      }
    }
    const Vec3 to = dice.Point(-1, 1);
    for (Vec3& p : one.positions) p += to;
    Append(one, &mesh);
  }
  return dice.OneIn(2) ? Weld(mesh) : mesh;
}

// Ribbons and wires, up to a million times as long as wide.
Mesh Ribbons(Dice& dice, int faces) {
  Mesh mesh;
  const int parts = 1 + dice.Below(8);
  for (int part = 0; part < parts; ++part) {
    const int n = std::max(4, faces / 4 / parts);
    const double width = std::pow(10, dice.In(-6, -0.5)), turns = dice.In(0, 12), rise = dice.In(0, 0.5);
    const bool is_flat = dice.OneIn(2);
    Mesh one = Grid(n, is_flat ? 2 : 3, [&](double u, double v) {
      const double a = kTurn * turns * u, r = 0.2 + u;
      const Vec3 out(std::cos(a), std::sin(a), 0), at = r * out + rise * turns * u * Vec3::UnitZ();
      if (is_flat) return Vec3(at + width * (v - 0.5) * out);
      return Vec3(at + width * (std::cos(kTurn * v) * out + std::sin(kTurn * v) * Vec3::UnitZ()));
    });
    for (Vec3& p : one.positions) p = (p * 1e12).array().round().matrix() / 1e12;
    const Vec3 to = dice.Point(-1, 1);
    one = Weld(one);
    for (Vec3& p : one.positions) p += to;
    Append(one, &mesh);
  }
  return mesh;
}

// Very many pieces of a few triangles each, of all sizes.
Mesh Crumbs(Dice& dice, int faces) {
  Mesh mesh;
  const double spread = dice.OneIn(2) ? 0 : dice.In(0, 6);
  while (mesh.num_faces() < faces) {
    const int n = 3 + dice.Below(5);
    const double size = std::pow(10, -dice.In(0, std::max(spread, 1e-9)));
    const bool is_regular = dice.OneIn(2);
    const Vec3 to = dice.Point(-1, 1);
    Mesh one;
    for (int k = 0; k < n; ++k) {
      const double a = kTurn * k / n;
      one.positions.push_back(to + size * (is_regular ? Vec3(std::cos(a), std::sin(a), 0) : dice.Point(-1, 1)));
    }
    for (std::int32_t k = 1; k + 1 < n; ++k) one.faces.push_back({0, k, k + 1});
    Append(one, &mesh);
  }
  return mesh;
}

// A sphere whose vertices stand out like a hedgehog's.
Mesh Spikes(Dice& dice, int faces) {
  const int n = std::clamp(static_cast<int>(std::sqrt(faces / 6.0)), 8, 512);
  Mesh mesh = Isosurface([](const Vec3& p) { return p.norm() - 0.8; }, n, Contouring::kSurfaceNets);
  const double height = std::pow(10, dice.In(-1, 2)) / n;
  const int rarity = 1 + dice.Below(30);
  for (Vec3& p : mesh.positions) {
    if (dice.OneIn(rarity)) p *= 1 + dice.In(-0.5, 1) * height;
  }
  return mesh;
}

// A sphere in space that is stretched the more the farther out along each axis: from needles that are much longer than
// the rest of the mesh is large to specks.
Mesh Warped(Dice& dice, int faces) {
  const int n = std::clamp(static_cast<int>(std::sqrt(faces / 6.0)), 8, 512);
  Mesh mesh = Isosurface([](const Vec3& p) { return p.norm() - 0.8; }, n, Contouring::kSurfaceNets);
  const Vec3 power(dice.In(0.1, 6), dice.In(0.1, 6), dice.In(0.1, 1));
  const double noise = dice.OneIn(2) ? 0 : 0.5 / n;
  for (Vec3& p : mesh.positions) {
    for (int axis = 0; axis < 3; ++axis) {
      const double x = p[axis] + dice.In(-noise, noise);
      p[axis] = std::copysign(std::pow(10, power[axis] * std::abs(x)) - 1, x);
    }
  }
  return mesh;
}

// Isosurfaces cut by planes that nearly go through vertices, as boolean operations leave them.
Mesh CutUp(Dice& dice, std::uint64_t seed, int faces) {
  Mesh mesh = MakeFamily(dice.OneIn(2) ? "surface_nets" : "assembly", seed, std::max(1, faces / 3));
  if (mesh.positions.empty()) return mesh;
  const Vec3 normal = dice.Direction();
  for (int i = 0; i < 30 && mesh.num_faces() < faces; ++i) {
    const Vec3& p = mesh.positions[static_cast<std::size_t>(dice.Below(static_cast<int>(mesh.positions.size())))];
    const double hair = dice.OneIn(4) ? 0 : std::pow(10, dice.In(-16, -3));
    const Vec3 tilt = dice.OneIn(2) ? Vec3(hair * dice.Direction()) : dice.Direction();
    CutByPlane(p + hair * dice.Direction(), (normal + tilt).normalized(), &mesh);
  }
  return dice.OneIn(2) ? Weld(mesh) : mesh;
}

// Flat all over: sheets of one plane on each other, folded over, with needles and with faces turned over.
Mesh Folded(Dice& dice, int faces) {
  const int n = std::max(2, static_cast<int>(std::sqrt(faces / 2.0)));
  const double folds = dice.In(0.5, 8), lift = dice.OneIn(2) ? 0 : std::pow(10, dice.In(-12, -2));
  Mesh mesh = Grid(n, n, [&](double u, double v) {
    const double x = folds * u, part = x - std::floor(x);
    return Vec3(std::fmod(std::floor(x), 2) == 0 ? part : 1 - part, v, lift * x);
  });
  const double shift = std::pow(10, dice.In(-9, 0)) / n;
  if (dice.OneIn(2)) {
    for (Vec3& p : mesh.positions) p += Vec3(dice.In(-shift, shift), dice.In(-shift, shift), 0);
  }
  return mesh;
}

std::vector<NamedMaker> Makers() {
  std::vector<NamedMaker> makers = {{"far_away", FarAway},
                                    {"scaled", Scaled},
                                    {"damaged", Damaged},
                                    {"thin_sheet", WithoutSeed<ThinSheet>},
                                    {"one_sided", WithoutSeed<OneSided>},
                                    {"decimated", Decimated},
                                    {"levels", WithoutSeed<Levels>},
                                    {"turned", WithoutSeed<Turned>},
                                    {"ribbons", WithoutSeed<Ribbons>},
                                    {"crumbs", WithoutSeed<Crumbs>},
                                    {"spikes", WithoutSeed<Spikes>},
                                    {"warped", WithoutSeed<Warped>},
                                    {"cut_up", CutUp},
                                    {"folded", WithoutSeed<Folded>}};
  for (const NamedMaker& maker : WildMakers()) makers.push_back(maker);
  return makers;
}

}  // namespace

std::vector<std::string> HardFamilies() {
  std::vector<std::string> names;
  for (const NamedMaker& maker : Makers()) names.emplace_back(maker.name);
  return names;
}

Mesh MakeHardFamily(const std::string& family, std::uint64_t seed, int faces) {
  Dice dice(seed + 1000);
  for (const NamedMaker& maker : Makers()) {
    if (family == maker.name) return maker.make(dice, seed, faces);
  }
  return {};
}

}  // namespace planish::testing
