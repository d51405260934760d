// UnwrapOptions::texels_per_unit: charts have the density that was asked for, to the last digits, in the smallest power
// of two where the size is free; every other promise holds, and an error says what there would be room for.
#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <string>
#include <vector>

#include "Eigen/Geometry"
#include "core/base/error.h"
#include "core/unwrap/unwrap.h"
#include "gmock/gmock.h"
#include "gtest/gtest.h"
#include "tests/core/promises.h"
#include "tests/core/shapes.h"
#include "tests/testing/dice.h"

namespace planish {
namespace {

using ::testing::IsEmpty;

// Bumps of many sizes side by side: a chart each, and more.
Mesh Bumps(int count, std::uint64_t seed) {
  testing::Dice dice(seed);
  Mesh all;
  for (int i = 0; i < count; ++i) {
    const Mesh bump = i % 3 == 2 ? testing::Tetrahedron() : testing::Hills(3 + i % 4, 4);
    const double size = dice.In(0.2, 2);
    const auto first = static_cast<std::int32_t>(all.positions.size());
    for (const Vec3& p : bump.positions) all.positions.push_back(size * p + Vec3(3.0 * i, 0, 0));
    for (const Face& face : bump.faces) all.faces.push_back({face[0] + first, face[1] + first, face[2] + first});
  }
  return all;
}

// Texels per unit of every face, by its area.
std::vector<double> DensitiesOf(const Mesh& mesh, const UnwrapResult& result) {
  std::vector<double> densities;
  for (std::size_t f = 0; f < mesh.faces.size(); ++f) {
    const Face& face = mesh.faces[f];
    const Vec3 a = mesh.positions[face[1]] - mesh.positions[face[0]],
               b = mesh.positions[face[2]] - mesh.positions[face[0]];
    const auto uv = [&](int k, int i) { return result.uv[6 * f + 2 * k + i]; };
    const double area = (uv(1, 0) - uv(0, 0)) * (uv(2, 1) - uv(0, 1)) - (uv(2, 0) - uv(0, 0)) * (uv(1, 1) - uv(0, 1));
    densities.push_back(result.texture_size * std::sqrt(std::abs(area) / a.cross(b).norm()));
  }
  return densities;
}

// The density of the map as a whole.
double DensityOf(const Mesh& mesh, const UnwrapResult& result) {
  double area = 0, texels = 0;
  const std::vector<double> densities = DensitiesOf(mesh, result);
  for (std::size_t f = 0; f < mesh.faces.size(); ++f) {
    const Face& face = mesh.faces[f];
    const double own = (mesh.positions[face[1]] - mesh.positions[face[0]])
                           .cross(mesh.positions[face[2]] - mesh.positions[face[0]])
                           .norm();
    area += own;
    texels += own * densities[f] * densities[f];
  }
  return std::sqrt(texels / area);
}

TEST(AskedDensity, IsKeptInTheSmallestTextureThatHasRoom) {
  for (const int charts : {1, 2, 7, 30}) {
    const Mesh mesh = Bumps(charts, 5 + charts);
    UnwrapOptions options;
    const auto filled = Unwrap(mesh, options, {});
    ASSERT_TRUE(filled.ok()) << filled.status();
    const double most = filled->texels_per_unit;  // in 1,024 texels
    for (const double part : {0.013, 0.3, 0.8, 0.999, 1.3, 9.0}) {
      options.texels_per_unit = part * most;
      options.finds_texture_size = true;
      const auto result = Unwrap(mesh, options, {});
      ASSERT_TRUE(result.ok()) << result.status();
      EXPECT_NEAR(result->texels_per_unit, options.texels_per_unit, 1e-6 * options.texels_per_unit);
      const bool varies = std::any_of(result->warnings.begin(), result->warnings.end(),
                                      [](const UnwrapWarning& warning) { return warning.reason == "DENSITY_VARIES"; });
      if (!varies) {
        EXPECT_NEAR(DensityOf(mesh, *result) / DensityOf(mesh, *filled), part, 2e-3 * part) << charts << " " << part;
      }
      UnwrapOptions judged = options;
      judged.atlas.texture_size = result->texture_size;
      EXPECT_THAT(testing::BrokenPromises(mesh, judged, result), IsEmpty()) << charts << " " << part;
      EXPECT_EQ(result->padding, options.atlas.padding) << charts << " " << part;
      // Half of the texture has no room, or is no texture.
      if (result->texture_size == kMinTextureSize) continue;
      options.finds_texture_size = false;
      options.atlas.texture_size = result->texture_size / 2;
      const auto half = Unwrap(mesh, options, {});
      ASSERT_FALSE(half.ok()) << charts << " " << part << ": " << result->texture_size;
      const ErrorInfo info = ErrorInfoOf(half.status());
      EXPECT_EQ(info.reason, "OPTIONS_INVALID");
      EXPECT_EQ(info.metadata.at("field"), "texels_per_unit");
      // And what the error says there is room for does fit. (The search ends elsewhere, so not to the last digit.)
      options.texels_per_unit = 0.97 * std::atof(info.metadata.at("most").c_str());
      EXPECT_TRUE(Unwrap(mesh, options, {}).ok()) << charts << " " << part;
    }
  }
}

TEST(AskedDensity, FollowsWeightsAtlasesAndTiles) {
  const Mesh mesh = Bumps(6, 3);
  UnwrapOptions options;
  options.texels_per_unit = 100;
  options.finds_texture_size = true;
  for (std::size_t f = 0; f < mesh.faces.size(); ++f) {
    const bool is_far = mesh.positions[mesh.faces[f][0]].x() > 8;
    options.face_atlas.push_back(is_far ? 1 : 0);
    options.face_weights.push_back(is_far ? 2.0F : 1.0F);
  }
  for (const AtlasLayout layout : {AtlasLayout::kUdim, AtlasLayout::kStacked}) {
    options.layout = layout;
    const auto result = Unwrap(mesh, options, {});
    ASSERT_TRUE(result.ok()) << result.status();
    for (const AtlasReport& atlas : result->atlases) EXPECT_NEAR(atlas.texels_per_unit, 100, 1e-4);
    const std::vector<double> densities = DensitiesOf(mesh, *result);
    for (std::size_t f = 0; f < mesh.faces.size(); ++f) {
      EXPECT_NEAR(densities[f] / (100 * options.face_weights[f]), 1, 0.5) << f;
    }
  }
  options = {};
  options.texels_per_unit = 100;
  options.finds_texture_size = true;
  options.atlas.tiles = 16;
  const auto tiled = Unwrap(mesh, options, {});
  ASSERT_TRUE(tiled.ok()) << tiled.status();
  EXPECT_NEAR(tiled->texels_per_unit, 100, 1e-4);
}

TEST(AskedDensity, BeyondTheLargestTextureAnErrorSaysByHowMuch) {
  UnwrapOptions options;
  options.texels_per_unit = 1e6;
  options.finds_texture_size = true;
  const auto result = Unwrap(testing::Hills(4, 4), options, {});
  ASSERT_FALSE(result.ok());
  EXPECT_THAT(std::string(result.status().message()), ::testing::HasSubstr("65536 x 65536"));
  EXPECT_THAT(std::string(result.status().message()), ::testing::HasSubstr("of the 1e+06 asked for"));
  options.pack = false;
  EXPECT_EQ(ErrorInfoOf(options.Validate()).metadata.at("field"), "texels_per_unit");
  options.pack = true;
  options.seams.policy = SeamPolicy::kNone;
  EXPECT_EQ(ErrorInfoOf(options.Validate()).metadata.at("field"), "texels_per_unit");
}

}  // namespace
}  // namespace planish
