// Unwrap() into several atlases, and with texels by weight.
#include <algorithm>
#include <array>
#include <cmath>
#include <functional>
#include <map>
#include <set>
#include <vector>

#include "Eigen/Geometry"
#include "core/base/error.h"
#include "core/unwrap/unwrap.h"
#include "core/unwrap/verify.h"
#include "gmock/gmock.h"
#include "gtest/gtest.h"
#include "tests/core/shapes.h"

namespace planish {
namespace {

// Hills side by side, the k-th of 2 sizes[k]^2 faces on a square of side sides[k]; `part` gets the number of each face.
Mesh SeveralHills(const std::vector<int>& sizes, const std::vector<double>& sides, std::vector<std::int32_t>* part) {
  Mesh all;
  for (std::size_t k = 0; k < sizes.size(); ++k) {
    const Mesh one = testing::Hills(sizes[k], sizes[k]);
    const auto first = static_cast<std::int32_t>(all.positions.size());
    for (const Vec3& p : one.positions)
      all.positions.push_back(sides[k] * p + Vec3(10.0 * static_cast<double>(k), 0, 0));
    for (const Face& face : one.faces) {
      all.faces.push_back({first + face[0], first + face[1], first + face[2]});
      part->push_back(static_cast<std::int32_t>(k));
    }
  }
  return all;
}

double UvArea(const UnwrapResult& result, std::size_t f) {
  const std::array<Vec2, 3> p = TriangleOf(result.uv, static_cast<std::int64_t>(f));
  const Vec2 a = p[1] - p[0], b = p[2] - p[0];
  return (a.x() * b.y() - a.y() * b.x()) / 2;
}

double SurfaceArea(const Mesh& mesh, std::size_t f) {
  const Vec3& p = mesh.positions[mesh.faces[f][0]];
  return (mesh.positions[mesh.faces[f][1]] - p).cross(mesh.positions[mesh.faces[f][2]] - p).norm() / 2;
}

// Texels per length of the faces that `is_own` says, by their areas, at a texture size of 1.
template <typename IsOwn>
double Density(const Mesh& mesh, const UnwrapResult& result, const IsOwn& is_own) {
  double uv = 0, surface = 0;
  for (std::size_t f = 0; f < mesh.faces.size(); ++f) {
    if (!is_own(f)) continue;
    uv += UvArea(result, f);
    surface += SurfaceArea(mesh, f);
  }
  return std::sqrt(uv / surface);
}

void ExpectWithin(const UnwrapResult& result, std::size_t f, int tile) {
  for (const Vec2& p : TriangleOf(result.uv, static_cast<std::int64_t>(f))) {
    EXPECT_GE(p.x(), tile % 10) << f;
    EXPECT_LE(p.x(), tile % 10 + 1) << f;
    EXPECT_GE(p.y(), tile / 10) << f;
    EXPECT_LE(p.y(), tile / 10 + 1) << f;
  }
}

// Overlaps among the faces of one atlas, whatever the report says.
std::int64_t OverlapsOf(const UnwrapResult& result, const std::vector<std::int32_t>& part, std::int32_t number) {
  CornerUv uv;
  for (std::size_t f = 0; f < part.size(); ++f) {
    if (part[f] == number) uv.insert(uv.end(), result.uv.begin() + 6 * f, result.uv.begin() + 6 * f + 6);
  }
  return FindOverlaps(uv, 10'000'000).pairs;
}

TEST(Atlases, EachHasTilesOfItsOwnAndAllOneDensity) {
  UnwrapOptions options;
  const Mesh mesh = SeveralHills({12, 8, 10}, {1, 0.3, 0.6}, &options.face_atlas);
  for (std::int32_t& atlas : options.face_atlas) atlas = atlas == 2 ? 11 : atlas;
  options.atlas.texture_size = 256;
  const auto result = Unwrap(mesh, options, {});
  ASSERT_TRUE(result.ok()) << result.status();
  EXPECT_EQ(result->quality.overlapping, 0);
  EXPECT_EQ(result->quality.flipped, 0);
  for (std::size_t f = 0; f < mesh.faces.size(); ++f) ExpectWithin(*result, f, options.face_atlas[f]);
  ASSERT_EQ(result->atlases.size(), 3u);
  EXPECT_EQ(result->tiles, 12);
  double efficiency = 0;
  for (const AtlasReport& atlas : result->atlases) {
    EXPECT_EQ(atlas.first_tile, atlas.atlas);
    EXPECT_EQ(atlas.tiles, 1);
    EXPECT_EQ(atlas.faces, std::count(options.face_atlas.begin(), options.face_atlas.end(), atlas.atlas));
    EXPECT_GE(atlas.charts, 1);
    EXPECT_EQ(atlas.texels_per_unit, result->texels_per_unit);
    const double density = Density(mesh, *result, [&](std::size_t f) { return options.face_atlas[f] == atlas.atlas; });
    EXPECT_NEAR(256 * density / atlas.texels_per_unit, 1, 1e-3) << atlas.atlas;
    efficiency += atlas.packing_efficiency / 3;
  }
  EXPECT_NEAR(result->quality.packing_efficiency, efficiency, 1e-9) << "of the three tiles that are used";
  EXPECT_GT(result->atlases[0].packing_efficiency, 0.7) << "the largest part decides";
}

TEST(Atlases, StackedOnesFillTexturesOfTheirOwn) {
  UnwrapOptions options;
  options.layout = AtlasLayout::kStacked;
  const Mesh mesh = SeveralHills({12, 8, 10}, {1, 0.3, 0.6}, &options.face_atlas);
  const auto result = Unwrap(mesh, options, {});
  ASSERT_TRUE(result.ok()) << result.status();
  EXPECT_EQ(result->tiles, 1);
  EXPECT_EQ(result->quality.overlapping, 0) << "counted within atlases";
  for (std::size_t f = 0; f < mesh.faces.size(); ++f) ExpectWithin(*result, f, 0);
  ASSERT_EQ(result->atlases.size(), 3u);
  for (const AtlasReport& atlas : result->atlases) {
    EXPECT_EQ(OverlapsOf(*result, options.face_atlas, atlas.atlas), 0);
    EXPECT_EQ(atlas.first_tile, 0);
    EXPECT_GT(atlas.packing_efficiency, 0.6);
    const double density = Density(mesh, *result, [&](std::size_t f) { return options.face_atlas[f] == atlas.atlas; });
    EXPECT_NEAR(1024 * density / atlas.texels_per_unit, 1, 1e-3);
  }
  EXPECT_GT(result->atlases[1].texels_per_unit, 2 * result->atlases[0].texels_per_unit) << "as it is smaller";
  EXPECT_EQ(result->texels_per_unit, result->atlases[0].texels_per_unit);
}

TEST(Atlases, ManyChartsStayInTheTilesOfTheirAtlas) {
  // With one flat chart for each hard edge's side: boxes of 6 charts, so that the packer has something to rearrange.
  UnwrapOptions options;
  Mesh mesh;
  for (int k = 0; k < 30; ++k) {
    const double s = 1 + 0.1 * (k % 7);
    const auto first = static_cast<std::int32_t>(mesh.positions.size());
    for (int v = 0; v < 8; ++v) mesh.positions.push_back(Vec3(3 * k + s * (v & 1), s * (v >> 1 & 1), (v >> 2 & 1)));
    for (const Face& f : {Face{0, 2, 1},
                          {1, 2, 3},
                          {4, 5, 6},
                          {5, 7, 6},
                          {0, 1, 4},
                          {1, 5, 4},
                          {2, 6, 3},
                          {3, 6, 7},
                          {0, 4, 2},
                          {2, 4, 6},
                          {1, 3, 5},
                          {3, 7, 5}}) {
      mesh.faces.push_back({first + f[0], first + f[1], first + f[2]});
      options.face_atlas.push_back(k < 20 ? 0 : 1);
    }
  }
  options.seams.policy = SeamPolicy::kKeep;
  options.seams.hard_edge_degrees = 30;
  options.atlas.tiles = 2;
  const auto result = Unwrap(mesh, options, {});
  ASSERT_TRUE(result.ok()) << result.status();
  EXPECT_EQ(result->charts.size(), 180u);
  EXPECT_EQ(result->quality.overlapping, 0);
  ASSERT_EQ(result->atlases.size(), 2u);
  EXPECT_EQ(result->atlases[0].tiles, 2);
  EXPECT_EQ(result->atlases[1].first_tile, 2);
  EXPECT_GT(result->atlases[0].packing_efficiency, 0.7);
  std::set<int> used;
  for (std::size_t f = 0; f < mesh.faces.size(); ++f) {
    const Vec2 p = TriangleOf(result->uv, static_cast<std::int64_t>(f))[0];
    const int tile = static_cast<int>(p.x());
    used.insert(tile);
    EXPECT_EQ(tile / 2, options.face_atlas[f]) << f;
    ExpectWithin(*result, f, tile);
  }
  EXPECT_TRUE(used.contains(0) && used.contains(1) && used.contains(2));
}

TEST(Atlases, ChartsEndBetweenThem) {
  const Mesh mesh = testing::Hills(10, 10);
  UnwrapOptions options;
  for (std::size_t f = 0; f < mesh.faces.size(); ++f) {
    const Vec3& p = mesh.positions[mesh.faces[f][0]];
    options.face_atlas.push_back(p.x() < 0.45 ? 0 : 1);
  }
  // Even where no seam may be added.
  for (std::int32_t c = 0; c < 3 * mesh.num_faces(); ++c) options.seams.uncut_corners.push_back(c);
  for (const SeamPolicy policy : {SeamPolicy::kAuto, SeamPolicy::kNeeded, SeamPolicy::kKeep}) {
    options.seams.policy = policy;
    const auto result = Unwrap(mesh, options, {});
    ASSERT_TRUE(result.ok()) << result.status();
    std::map<std::int32_t, std::set<std::int32_t>> atlases;
    for (std::size_t f = 0; f < mesh.faces.size(); ++f) {
      atlases[result->face_chart[f]].insert(options.face_atlas[f]);
      ExpectWithin(*result, f, options.face_atlas[f]);
    }
    for (const auto& [chart, numbers] : atlases) EXPECT_EQ(numbers.size(), 1u) << chart;
  }
}

TEST(Atlases, PartsWithoutAreaHaveNoChartsButAPlace) {
  UnwrapOptions options;
  Mesh mesh = SeveralHills({6, 6}, {1, 1}, &options.face_atlas);
  const Face face = mesh.faces[0];
  mesh.faces.push_back({face[0], face[0], face[1]});
  options.face_atlas.push_back(3);
  const auto result = Unwrap(mesh, options, {});
  ASSERT_TRUE(result.ok()) << result.status();
  ASSERT_EQ(result->atlases.size(), 3u);
  EXPECT_EQ(result->atlases[2].charts, 0);
  EXPECT_EQ(result->atlases[2].faces, 1);
  EXPECT_EQ(result->tiles, 2);
  ExpectWithin(*result, mesh.faces.size() - 1, 3);
}

TEST(Atlases, SameBytesForAnyThreadsAndAsOneAtlas) {
  UnwrapOptions options;
  const Mesh mesh = SeveralHills({8, 6}, {1, 0.5}, &options.face_atlas);
  for (const AtlasLayout layout : {AtlasLayout::kUdim, AtlasLayout::kStacked}) {
    options.layout = layout;
    options.threads = 1;
    const auto one = Unwrap(mesh, options, {});
    options.threads = 3;
    const auto three = Unwrap(mesh, options, {});
    ASSERT_TRUE(one.ok() && three.ok());
    EXPECT_EQ(one->uv, three->uv);
  }
  // All in one is the same as none.
  std::fill(options.face_atlas.begin(), options.face_atlas.end(), 0);
  const auto all = Unwrap(mesh, options, {});
  options.face_atlas.clear();
  const auto none = Unwrap(mesh, options, {});
  ASSERT_TRUE(all.ok() && none.ok());
  EXPECT_EQ(all->uv, none->uv);
  EXPECT_TRUE(none->atlases.empty());
}

TEST(Weights, AreTexelsPerLength) {
  std::vector<std::int32_t> part;
  const Mesh mesh = SeveralHills({8, 8}, {1, 1}, &part);
  UnwrapOptions options;
  for (const std::int32_t p : part) options.face_weights.push_back(p == 1 ? 3.0F : 1.0F);
  for (const SeamPolicy policy : {SeamPolicy::kAuto, SeamPolicy::kNeeded, SeamPolicy::kKeep}) {
    options.seams.policy = policy;
    const auto result = Unwrap(mesh, options, {});
    ASSERT_TRUE(result.ok()) << result.status();
    EXPECT_EQ(result->quality.overlapping, 0);
    const double light = Density(mesh, *result, [&](std::size_t f) { return part[f] == 0; });
    const double heavy = Density(mesh, *result, [&](std::size_t f) { return part[f] == 1; });
    EXPECT_NEAR(heavy / light, 3, 1e-3);
    EXPECT_NEAR(1024 * light / result->texels_per_unit, 1, 1e-3) << "is told for weight 1";
  }
}

TEST(Weights, ChartsEndBetweenThemUnlessNoSeamMayBeAdded) {
  const Mesh mesh = testing::Hills(10, 10);
  UnwrapOptions options;
  const auto is_heavy = [&](std::size_t f) { return mesh.positions[mesh.faces[f][0]].x() < 0.45; };
  for (std::size_t f = 0; f < mesh.faces.size(); ++f) options.face_weights.push_back(is_heavy(f) ? 2.0F : 1.0F);
  options.seams.policy = SeamPolicy::kNeeded;
  const auto cut = Unwrap(mesh, options, {});
  ASSERT_TRUE(cut.ok()) << cut.status();
  EXPECT_EQ(cut->charts.size(), 2u);
  EXPECT_NEAR(Density(mesh, *cut, is_heavy) / Density(mesh, *cut, [&](std::size_t f) { return !is_heavy(f); }), 2,
              1e-3);

  options.seams.policy = SeamPolicy::kKeep;
  const auto whole = Unwrap(mesh, options, {});
  ASSERT_TRUE(whole.ok()) << whole.status();
  EXPECT_EQ(whole->charts.size(), 1u);
  double area = 0, heavy = 0;
  for (std::size_t f = 0; f < mesh.faces.size(); ++f) {
    area += SurfaceArea(mesh, f);
    heavy += is_heavy(f) ? SurfaceArea(mesh, f) : 0;
  }
  const double density = Density(mesh, *whole, [](std::size_t) { return true; });
  EXPECT_NEAR(1024 * density / whole->texels_per_unit, 1 + heavy / area, 1e-3) << "the mean";
}

TEST(Atlases, WhatDoesNotFitIsRefusedByField) {
  UnwrapOptions good;
  const Mesh mesh = SeveralHills({4, 4}, {1, 1}, &good.face_atlas);
  good.face_weights.assign(mesh.faces.size(), 1.0F);
  const auto refusal = [&](const std::function<void(UnwrapOptions*)>& change) {
    UnwrapOptions options = good;
    change(&options);
    const ErrorInfo info = ErrorInfoOf(Unwrap(mesh, options, {}).status());
    EXPECT_EQ(info.reason, "OPTIONS_INVALID");
    return info.metadata;
  };
  const auto field = [](const std::string& name) { return ::testing::Contains(::testing::Pair("field", name)); };
  const auto face = [](const std::string& id) { return ::testing::Contains(::testing::Pair("face", id)); };
  EXPECT_THAT(refusal([](UnwrapOptions* o) { o->face_atlas.pop_back(); }), field("face_atlas"));
  EXPECT_THAT(refusal([](UnwrapOptions* o) { o->face_atlas[5] = -1; }),
              ::testing::AllOf(field("face_atlas"), face("5")));
  EXPECT_THAT(refusal([](UnwrapOptions* o) { o->face_atlas[7] = 100; }),
              ::testing::AllOf(field("face_atlas"), face("7")));
  EXPECT_THAT(refusal([](UnwrapOptions* o) { o->face_atlas[7] = 50, o->atlas.tiles = 2; }), face("7"));
  EXPECT_THAT(refusal([](UnwrapOptions* o) { o->pack = false; }), field("face_atlas"));
  EXPECT_THAT(refusal([](UnwrapOptions* o) { o->seams.policy = SeamPolicy::kNone; }), field("face_atlas"));
  EXPECT_THAT(refusal([](UnwrapOptions* o) { o->face_weights.push_back(1); }), field("face_weights"));
  for (const float weight : {0.0F, 101.0F, NAN}) {
    EXPECT_THAT(refusal([&](UnwrapOptions* o) { o->face_weights[3] = weight; }),
                ::testing::AllOf(field("face_weights"), face("3")));
  }
  // As textures of their own there may be any number of atlases.
  UnwrapOptions stacked = good;
  stacked.layout = AtlasLayout::kStacked;
  stacked.face_atlas.back() = 2'000'000'000;
  const auto result = Unwrap(mesh, stacked, {});
  ASSERT_TRUE(result.ok()) << result.status();
  EXPECT_EQ(result->atlases.back().atlas, 2'000'000'000);
}

}  // namespace
}  // namespace planish
