// UV islands in new places: rigid, apart, of equal density.
#include "client/cli/repack.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <string>
#include <vector>

#include "core/mesh/predicates.h"
#include "gtest/gtest.h"
#include "planish/error.h"

namespace planish::cli {
namespace {

// Rectangles of the surface with UV of any kind, each a grid of 2 n^2 triangles and an island of its own.
struct Sheet {
  static constexpr int kN = 3, kFaces = 2 * kN * kN;
  Mesh mesh;
  std::vector<double> uv;

  // `size` on the surface; (u, v) = origin + s x + t y for (s, t) in [0, 1]^2.
  void Add(const Vec2& size, const Vec2& origin, const Vec2& x, const Vec2& y) {
    const auto first = static_cast<std::int32_t>(mesh.positions.size());
    const double z = first;
    std::vector<Vec2> at;
    for (int j = 0; j <= kN; ++j) {
      for (int i = 0; i <= kN; ++i) {
        const double s = 1.0 * i / kN, t = 1.0 * j / kN;
        mesh.positions.emplace_back(s * size.x(), t * size.y(), z);
        at.push_back(origin + s * x + t * y);
      }
    }
    const auto add = [&](std::int32_t a, std::int32_t b, std::int32_t c) {
      mesh.faces.push_back({first + a, first + b, first + c});
      for (const std::int32_t v : {a, b, c}) uv.insert(uv.end(), {at[v].x(), at[v].y()});
    };
    for (int j = 0; j < kN; ++j) {
      for (int i = 0; i < kN; ++i) {
        const int v = j * (kN + 1) + i;
        add(v, v + 1, v + kN + 2);
        add(v, v + kN + 2, v + kN + 1);
      }
    }
  }
};

// Five islands on each other, some mirrored, skewed, far off, or of another scale.
Sheet FiveIslands() {
  Sheet sheet;
  sheet.Add({1, 1}, {0, 0}, {1, 0}, {0, 1});
  sheet.Add({1, 2}, {0, 0}, {0.1, 0}, {0, 0.2});
  sheet.Add({2, 1}, {0.5, 0}, {-2, 0}, {0, 1});  // mirrored
  sheet.Add({0.5, 0.5}, {700, -300}, {3, 1}, {1, 2});
  sheet.Add({1, 1}, {0, 0}, {1, 0}, {0, 1});
  return sheet;
}

template <typename Numbers>
Vec2 At(const Numbers& uv, std::size_t corner) {
  return {uv[2 * corner], uv[2 * corner + 1]};
}

template <typename Numbers>
double SignedArea(const Numbers& uv, std::size_t f) {
  const Vec2 a = At(uv, 3 * f), b = At(uv, 3 * f + 1), c = At(uv, 3 * f + 2);
  return ((b - a).x() * (c - a).y() - (b - a).y() * (c - a).x()) / 2;
}

double SurfaceArea(const Mesh& mesh, std::size_t f) {
  const Vec3& p = mesh.positions[mesh.faces[f][0]];
  const Vec3 a = mesh.positions[mesh.faces[f][1]] - p, b = mesh.positions[mesh.faces[f][2]] - p;
  return std::hypot(a.y() * b.z() - a.z() * b.y(), a.z() * b.x() - a.x() * b.z(), a.x() * b.y() - a.y() * b.x()) / 2;
}

// The least distance between triangles of different islands, 0 where they meet, by looking at all pairs.
double LeastDistance(const std::vector<float>& uv, int faces_per_island) {
  const auto from_segment = [](const Vec2& p, const Vec2& a, const Vec2& b) {
    const double t = std::clamp((p - a).dot(b - a) / std::max((b - a).squaredNorm(), 1e-300), 0.0, 1.0);
    return (a + t * (b - a) - p).norm();
  };
  double least = std::numeric_limits<double>::infinity();
  for (std::size_t f = 0; f < uv.size() / 6; ++f) {
    for (std::size_t g = 0; g < f; ++g) {
      if (f / faces_per_island == g / faces_per_island) continue;
      std::array<Vec2, 3> s, t;
      for (std::size_t k = 0; k < 3; ++k) {
        s[k] = At(uv, 3 * f + k);
        t[k] = At(uv, 3 * g + k);
      }
      if (SignedArea(uv, f) < 0) std::swap(s[1], s[2]);
      if (SignedArea(uv, g) < 0) std::swap(t[1], t[2]);
      if (InteriorsMeet(s.data(), t.data())) return 0;
      for (std::size_t k = 0; k < 3; ++k) {
        for (std::size_t l = 0; l < 3; ++l) {
          least = std::min({least, from_segment(s[k], t[l], t[(l + 1) % 3]), from_segment(t[k], s[l], s[(l + 1) % 3])});
        }
      }
    }
  }
  return least;
}

// Each island is the old one turned and scaled: returns its scale.
double ScaleOfIsland(const Sheet& sheet, const std::vector<float>& uv, std::size_t first_face) {
  const double scale = std::sqrt(SignedArea(uv, first_face) / SignedArea(sheet.uv, first_face));
  for (std::size_t c = 3 * first_face; c < 3 * (first_face + Sheet::kFaces); ++c) {
    const double before = (At(sheet.uv, c) - At(sheet.uv, 3 * first_face)).norm();
    const double after = (At(uv, c) - At(uv, 3 * first_face)).norm();
    EXPECT_NEAR(after, scale * before, 1e-6) << "corner " << c;
  }
  for (std::size_t f = first_face; f < first_face + Sheet::kFaces; ++f) {
    EXPECT_GT(SignedArea(uv, f) * SignedArea(sheet.uv, f), 0) << "face " << f;
  }
  return scale;
}

RepackOptions Options(bool keep) {
  RepackOptions options;
  options.atlas.texture_size = 256;
  options.atlas.padding = 4;
  options.keep_density = keep;
  return options;
}

TEST(Repack, WeightsScaleIslands) {
  const Sheet sheet = FiveIslands();
  RepackOptions options = Options(false);
  options.face_weights.assign(5 * Sheet::kFaces, 1);
  for (std::size_t f = Sheet::kFaces; f < 2 * Sheet::kFaces; ++f) options.face_weights[f] = 3;
  const Repacking done = Repack(sheet.mesh, sheet.uv, {}, options);
  EXPECT_GE(LeastDistance(done.uv, Sheet::kFaces), 4.0 / 256);
  for (std::size_t f = 0; f < 5 * Sheet::kFaces; ++f) {
    const double density = 256 * std::sqrt(std::abs(SignedArea(done.uv, f)) / SurfaceArea(sheet.mesh, f));
    EXPECT_NEAR(density / done.texels_per_unit, options.face_weights[f], 1e-3) << "face " << f;
  }
}

TEST(Repack, EqualDensityOfIslandsThatStayAsTheyAre) {
  const Sheet sheet = FiveIslands();
  const Repacking done = Repack(sheet.mesh, sheet.uv, {}, Options(false));
  EXPECT_EQ(done.islands, 5);
  EXPECT_EQ(done.mirrored, 1);
  EXPECT_EQ(done.without_area, 0);
  EXPECT_EQ(done.lost_to_rounding, 0);
  EXPECT_EQ(done.packing.padding, 4);
  EXPECT_GE(LeastDistance(done.uv, Sheet::kFaces), 4.0 / 256);
  for (const float x : done.uv) {
    EXPECT_GE(x, 2.0 / 256);
    EXPECT_LE(x, 1 - 2.0 / 256);
  }
  double area = 0;
  for (std::size_t i = 0; i < 5; ++i) {
    ScaleOfIsland(sheet, done.uv, i * Sheet::kFaces);
    for (std::size_t f = i * Sheet::kFaces; f < (i + 1) * Sheet::kFaces; ++f) {
      const double density = 256 * std::sqrt(std::abs(SignedArea(done.uv, f)) / SurfaceArea(sheet.mesh, f));
      EXPECT_NEAR(density / done.texels_per_unit, 1, 1e-4) << "face " << f;
      area += std::abs(SignedArea(done.uv, f));
    }
  }
  EXPECT_NEAR(done.covered, area, 0.005);
  EXPECT_GT(area, 0.5);
}

TEST(Repack, IslandsHaveTheDensityThatIsAskedFor) {
  const Sheet sheet = FiveIslands();
  RepackOptions options = Options(false);
  options.texels_per_unit = 200;
  try {
    Repack(sheet.mesh, sheet.uv, {}, options);
    FAIL() << "six squares of 200 texels do not fit into 256";
  } catch (const Error& error) {
    EXPECT_EQ(error.reason(), "OPTIONS_INVALID");
    EXPECT_EQ(error.metadata().at("field"), "texels_per_unit");
    const double most = Repack(sheet.mesh, sheet.uv, {}, Options(false)).texels_per_unit;
    EXPECT_NEAR(std::stod(error.metadata().at("most")), most, 1e-3 * most);
  }
  options.finds_texture_size = true;
  const Repacking done = Repack(sheet.mesh, sheet.uv, {}, options);
  EXPECT_EQ(done.texture_size, 1024);
  EXPECT_NEAR(done.texels_per_unit, 200, 1e-6);
  for (std::size_t f = 0; f < 5 * Sheet::kFaces; ++f) {
    const double density = 1024 * std::sqrt(std::abs(SignedArea(done.uv, f)) / SurfaceArea(sheet.mesh, f));
    EXPECT_NEAR(density, 200, 0.1) << "face " << f;
  }
}

TEST(Repack, KeepsRelativeSizesIfAsked) {
  const Sheet sheet = FiveIslands();
  const Repacking done = Repack(sheet.mesh, sheet.uv, {}, Options(true));
  EXPECT_GE(LeastDistance(done.uv, Sheet::kFaces), 4.0 / 256);
  const double scale = ScaleOfIsland(sheet, done.uv, 0);
  for (std::size_t i = 1; i < 5; ++i) {
    EXPECT_NEAR(ScaleOfIsland(sheet, done.uv, i * Sheet::kFaces) / scale, 1, 2e-4) << "island " << i;
  }
  EXPECT_EQ(done.texels_per_unit, 0);
}

TEST(Repack, SameForAnyNumberOfThreadsAndWhereverTheUvLie) {
  const Sheet sheet = FiveIslands();
  const Repacking alone = Repack(sheet.mesh, sheet.uv, {}, Options(false));
  ThreadTeam team(3);
  Execution execution;
  execution.team = &team;
  EXPECT_EQ(Repack(sheet.mesh, sheet.uv, {}, Options(false), execution).uv, alone.uv);
  Sheet moved = sheet;
  for (double& x : moved.uv) x += 64;
  const std::vector<float> uv = Repack(moved.mesh, moved.uv, {}, Options(false)).uv;
  for (std::size_t i = 0; i < uv.size(); ++i) EXPECT_NEAR(uv[i], alone.uv[i], 1e-6);
}

TEST(Repack, IslandsWithoutArea) {
  Sheet sheet = FiveIslands();
  sheet.Add({1, 1}, {0.3, 0.3}, {0, 0}, {0, 0});  // a point in the map
  sheet.Add({1, 1}, {0, 0}, {1, 0}, {1, 0});      // a line in the map
  sheet.Add({0, 0}, {0, 0}, {1, 0}, {0, 1});      // a point on the surface
  sheet.Add({0, 0}, {5, 5}, {0, 0}, {0, 0});      // a point in both
  for (const bool keep : {false, true}) {
    const Repacking done = Repack(sheet.mesh, sheet.uv, {}, Options(keep));
    EXPECT_EQ(done.islands, 9) << "the faces of the last one are one place";
    EXPECT_EQ(done.without_area, 3);
    for (const float x : done.uv) {
      EXPECT_GE(x, 2.0 / 256);
      EXPECT_LE(x, 1 - 2.0 / 256);
    }
    EXPECT_GE(LeastDistance(done.uv, Sheet::kFaces), 4.0 / 256) << "points and lines keep the padding too";
  }
  // Nothing but points.
  Sheet points;
  points.Add({1, 1}, {0.3, 0.3}, {0, 0}, {0, 0});
  points.Add({0, 0}, {0, 0}, {0, 0}, {0, 0});
  for (const float x : Repack(points.mesh, points.uv, {}, Options(false)).uv) {
    EXPECT_GT(x, 0);
    EXPECT_LT(x, 1);
  }
}

TEST(Repack, CoverageCountsEachPlaceOnce) {
  Sheet sheet = FiveIslands();
  const double plain = Repack(sheet.mesh, sheet.uv, {}, Options(true)).covered;
  // The same surface once more: by position and UV it is the same islands, each lying twice where it lay.
  const std::vector<Face> faces = sheet.mesh.faces;
  const std::vector<double> uv = sheet.uv;
  sheet.mesh.faces.insert(sheet.mesh.faces.end(), faces.begin(), faces.end());
  sheet.uv.insert(sheet.uv.end(), uv.begin(), uv.end());
  const Repacking twice = Repack(sheet.mesh, sheet.uv, {}, Options(true));
  EXPECT_EQ(twice.islands, 5);
  EXPECT_LT(twice.covered, 1);
  EXPECT_NEAR(twice.covered, plain, 0.1);
  EXPECT_GT(twice.packing.efficiency, 1.5 * twice.covered);
}

TEST(Repack, SeveralTiles) {
  const Sheet sheet = FiveIslands();
  RepackOptions options = Options(false);
  const double one_tile = Repack(sheet.mesh, sheet.uv, {}, options).texels_per_unit;
  options.atlas.tiles = 3;
  const Repacking done = Repack(sheet.mesh, sheet.uv, {}, options);
  EXPECT_GT(done.packing.tiles, 1);
  EXPECT_LE(done.packing.tiles, 3);
  EXPECT_GT(done.texels_per_unit, 1.2 * one_tile);
  EXPECT_LT(*std::max_element(done.uv.begin(), done.uv.end()), done.packing.tiles);
  EXPECT_GE(LeastDistance(done.uv, Sheet::kFaces), 4.0 / 256);
}

}  // namespace
}  // namespace planish::cli
