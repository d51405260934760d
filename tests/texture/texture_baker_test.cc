#include "client/texture/texture_baker.h"

#include <array>
#include <cmath>
#include <ctime>
#include <vector>

#include "gmock/gmock.h"
#include "gtest/gtest.h"
#include "tests/texture/sample_textures.h"

namespace planish {
namespace {

TextureImage Bake(const TextureImage& from, const std::vector<TextureTriangle>& triangles, int side,
                  const BakeOptions& options = {}, TextureSource source = {}, int threads = 1) {
  ThreadTeam team(threads);
  ImageHeader header = from.header;
  header.width = header.height = side;
  TextureBaker baker(header, &team);
  source.image = &from;
  EXPECT_TRUE(baker.Draw(source, {triangles}, options).ok());
  return baker.Finish();
}

const BakeOptions kData = {TextureMeaning::kData, false, 1};

TEST(TextureBaker, TheSameMapGivesTheSameImage) {
  const TextureImage image = NoiseTexture(64, 64, 1);
  std::vector<TextureTriangle> square(2);
  square[0].from = square[0].to = {Vec2(0, 0), Vec2(1, 0), Vec2(1, 1)};
  square[1].from = square[1].to = {Vec2(0, 0), Vec2(1, 1), Vec2(0, 1)};
  EXPECT_EQ(Bake(image, square, 64).texels, image.texels);
  EXPECT_EQ(Bake(image, square, 64, kData).texels, image.texels);
}

TEST(TextureBaker, SmoothContentLooksTheSame) {
  for (const double turn : {0.3, 0.7, 1.1}) {
    const std::vector<TextureTriangle> sheet = TurnedSheet(4, turn, 1);
    for (const TextureMeaning meaning : {TextureMeaning::kColor, TextureMeaning::kData}) {
      const TextureImage before = SmoothTexture(256, 256, 0.125, 3);
      // 1 / 0.45 as many texels: the same per length.
      const TextureImage after = Bake(before, sheet, 569, {meaning, false, 1});
      const Difference difference = Compare(before, after, sheet, 20000);
      EXPECT_LE(difference.mean, 2) << turn;
      EXPECT_LE(difference.percentile99, 12) << turn;
    }
  }
}

// Of what the old image shows: the mean of 8 x 8 points of a texel.
TextureImage Reference(const TextureImage& before, const std::vector<TextureTriangle>& triangles, int side) {
  std::vector<double> values(static_cast<std::size_t>(side) * static_cast<std::size_t>(side) * 3, 0);
  for (int y = 0; y < side; ++y) {
    for (int x = 0; x < side; ++x) {
      const Vec2 p(x + 0.5, y + 0.5);
      for (const TextureTriangle& t : triangles) {
        const Vec2 a = t.to[0] * side, e1 = t.to[1] * side - a, e2 = t.to[2] * side - a;
        const double area = e1.x() * e2.y() - e1.y() * e2.x();
        const auto weights = [&](const Vec2& q) {
          const Vec2 d = q - a;
          return Vec2((d.x() * e2.y() - d.y() * e2.x()) / area, (e1.x() * d.y() - e1.y() * d.x()) / area);
        };
        const Vec2 w = weights(p);
        // Beside the chart as well, from the first triangle that comes near.
        if (w.minCoeff() < -0.02 || w.sum() > 1.02) continue;
        for (int k = 0; k < 64; ++k) {
          const Vec2 q = weights(Vec2(x + (k % 8 + 0.5) / 8, y + (k / 8 + 0.5) / 8));
          const Vec2 uv = t.from[0] + q.x() * (t.from[1] - t.from[0]) + q.y() * (t.from[2] - t.from[0]);
          const std::vector<double> shown = Shown(before, uv);
          for (std::size_t c = 0; c < 3; ++c) {
            values[3 * static_cast<std::size_t>(y * side + x) + c] += shown[c] / 64;
          }
        }
        break;
      }
    }
  }
  return MakeTexture(side, side, 3, 8, [&](double x, double y, int c) {
    return values[3 * static_cast<std::size_t>(static_cast<int>(y) * side + static_cast<int>(x)) +
                  static_cast<std::size_t>(c)] /
           255;
  });
}

TEST(TextureBaker, NoiseIsNoWorseThanInAReferenceOf64Samples) {
  const std::vector<TextureTriangle> sheet = TurnedSheet(2, 0.5, 1);
  const TextureImage noise = NoiseTexture(96, 96, 5);
  for (const double density : {0.7, 1.0, 1.5}) {
    const int side = static_cast<int>(96 / 0.45 * density);
    const double reference = Compare(noise, Reference(noise, sheet, side), sheet, 20000).mean;
    const double ours = Compare(noise, Bake(noise, sheet, side, kData), sheet, 20000).mean;
    EXPECT_LE(ours, 1.1 * reference) << density << ": " << ours << " against " << reference;
    if (getenv("PRINT")) printf("%g: %g %g\n", density, ours, reference);
  }
}

TEST(TextureBaker, ThreadsChangeNothing) {
  const std::vector<TextureTriangle> sheet = TurnedSheet(4, 0.7, 1);
  const TextureImage before = NoiseTexture(100, 60, 3);
  EXPECT_EQ(Bake(before, sheet, 300).texels, Bake(before, sheet, 300, {}, {}, 3).texels);
}

// 800 triangles of one colour each, as one source with colours of corners, and as 800 sources with factors.
TEST(TextureBaker, ManySourcesTakeNoLongerThanTheirTriangles) {
  constexpr int kSquares = 20, kSide = 400;
  std::vector<TextureTriangle> triangles;
  std::vector<CornerColor> colors;
  for (int i = 0; i < 2 * kSquares * kSquares; ++i) {
    const Vec2 low = Vec2(i / 2 % kSquares, i / 2 / kSquares) / kSquares;
    const auto at = [&](double x, double y) { return Vec2(low + 0.93 * Vec2(x, y) / kSquares); };
    TextureTriangle triangle;
    triangle.to = i % 2 == 0 ? std::array{at(0, 0), at(1, 0), at(1, 1)} : std::array{at(0, 0), at(1, 1), at(0, 1)};
    triangles.push_back(triangle);
    const auto shade = [i](int period) { return static_cast<float>(i % period) / static_cast<float>(period); };
    colors.insert(colors.end(), 3, CornerColor{shade(7), shade(31), shade(401), 1});
  }
  const TextureImage white = MakeTexture(1, 1, 3, 8, [](double, double, int) { return 1; });
  TextureSource source;
  source.image = &white;
  ThreadTeam team(1);
  const ImageHeader header = {ImageKind::kPng, kSide, kSide, 3, 8};
  const auto seconds = [](std::clock_t begin) { return static_cast<double>(std::clock() - begin) / CLOCKS_PER_SEC; };
  std::clock_t begin = std::clock();
  TextureBaker one(header, &team);
  ASSERT_TRUE(one.Draw(source, {triangles, {}, colors}, {}).ok());
  const double at_once = seconds(begin);
  begin = std::clock();
  TextureBaker many(header, &team);
  many.Claim(triangles);
  for (std::size_t t = 0; t < triangles.size(); ++t) {
    BakeOptions options;
    options.factor = colors[3 * t];
    ASSERT_TRUE(many.Draw(source, {{&triangles[t], 1}, {}, {}, t}, options).ok());
  }
  const double apart = seconds(begin);
  EXPECT_LE(apart, 20 * at_once);
  EXPECT_EQ(one.Finish().texels, many.Finish().texels);
}

TEST(TextureBaker, MinifiedContentIsAveraged) {
  // A chessboard of single texels, and a new image of an eighth of the texels per length.
  const TextureImage board = MakeTexture(
      512, 512, 1, 8, [](double x, double y, int) { return (static_cast<int>(x) + static_cast<int>(y)) % 2; });
  std::vector<TextureTriangle> square(2);
  square[0].from = square[0].to = {Vec2(0, 0), Vec2(1, 0), Vec2(1, 1)};
  square[1].from = square[1].to = {Vec2(0, 0), Vec2(1, 1), Vec2(0, 1)};
  for (const std::uint8_t value : Bake(board, square, 61, kData).texels) EXPECT_NEAR(value, 127.5, 6);
  // In linear light the mean of black and white is 188.
  for (const std::uint8_t value : Bake(board, square, 61).texels) EXPECT_NEAR(value, 188, 5);
}

TEST(TextureBaker, ColoursOfWhatIsTransparentDoNotBleed) {
  // Opaque red on transparent green.
  const TextureImage leaf = MakeTexture(64, 64, 4, 8, [](double x, double, int c) {
    const bool inside = x < 32;
    return c == 0 ? inside : c == 1 ? !inside : c == 3 ? inside : 0;
  });
  std::vector<TextureTriangle> square(2);
  square[0].from = square[0].to = {Vec2(0, 0), Vec2(1, 0), Vec2(1, 1)};
  square[1].from = square[1].to = {Vec2(0, 0), Vec2(1, 1), Vec2(0, 1)};
  const TextureImage small = Bake(leaf, square, 15, {TextureMeaning::kColor, true, 1});
  for (std::size_t i = 0; i < small.texels.size(); i += 4) {
    if (small.texels[i + 3] > 0) {
      EXPECT_EQ(small.texels[i + 1], 0);
    }
  }
}

TEST(TextureBaker, TilesAndMirrorsAsTheSamplerSays) {
  const TextureImage image = SmoothTexture(64, 64, 0.1, 9);
  std::vector<TextureTriangle> square(2);
  const double from = -1.25, to = 1.5;
  square[0].to = {Vec2(0, 0), Vec2(1, 0), Vec2(1, 1)};
  square[1].to = {Vec2(0, 0), Vec2(1, 1), Vec2(0, 1)};
  square[0].from = {Vec2(from, from), Vec2(to, from), Vec2(to, to)};
  square[1].from = {Vec2(from, from), Vec2(to, to), Vec2(from, to)};
  TextureSource source;
  const TextureImage tiled = Bake(image, square, 176, kData, source);
  source.wrap_u = source.wrap_v = TextureWrap::kMirror;
  const TextureImage mirrored = Bake(image, square, 176, kData, source);
  source.wrap_u = source.wrap_v = TextureWrap::kClamp;
  const TextureImage clamped = Bake(image, square, 176, kData, source);
  for (const int texel : {3, 50, 90, 120, 170}) {
    const double uv = from + (to - from) * (texel + 0.5) / 176;
    const auto shown = [&](double u) { return Shown(image, Vec2(u, 0.5 - from < 0 ? 0 : u))[0]; };
    const std::size_t at = 3 * static_cast<std::size_t>(texel * 176 + texel);
    EXPECT_NEAR(tiled.texels[at], shown(uv), 3) << texel;
    const double folded = uv - 2 * std::floor(uv / 2);
    const double inside = folded > 1 ? 2 - folded : folded;
    if (inside > 0.02 && inside < 0.98) {
      EXPECT_NEAR(mirrored.texels[at], shown(inside), 3) << texel;
    }
    EXPECT_NEAR(clamped.texels[at], shown(std::clamp(uv, 0.5 / 64, 1 - 0.5 / 64)), 3) << texel;
  }
}

TEST(TextureBaker, NoMipmapShowsABackground) {
  // A white chart in the corner of a black image that nothing refers to.
  const TextureImage image = MakeTexture(128, 128, 3, 8, [](double x, double y, int) { return x < 40 && y < 40; });
  std::vector<TextureTriangle> corner(1);
  corner[0].from = {Vec2(0.02, 0.02), Vec2(0.28, 0.02), Vec2(0.02, 0.28)};
  corner[0].to = {Vec2(0.6, 0.6), Vec2(0.9, 0.6), Vec2(0.6, 0.9)};
  for (const std::uint8_t value : Bake(image, corner, 100).texels) EXPECT_EQ(value, 255);
}

TEST(TextureBaker, NothingBeyondTheBorderOfAChartIsRead) {
  // A white square of exactly the chart's size on black, minified: samples stay on the chart.
  const TextureImage image =
      MakeTexture(256, 256, 3, 8, [](double x, double y, int) { return x > 62 && x < 194 && y > 62 && y < 194; });
  std::vector<TextureTriangle> square(2);
  square[0].from = {Vec2(0.25, 0.25), Vec2(0.75, 0.25), Vec2(0.75, 0.75)};
  square[1].from = {Vec2(0.25, 0.25), Vec2(0.75, 0.75), Vec2(0.25, 0.75)};
  square[0].to = {Vec2(0.1, 0.1), Vec2(0.9, 0.1), Vec2(0.9, 0.9)};
  square[1].to = {Vec2(0.1, 0.1), Vec2(0.9, 0.9), Vec2(0.1, 0.9)};
  for (const int side : {20, 50, 150, 300}) {
    const TextureImage small = Bake(image, square, side);
    // At the corners the triangle beside the nearest one may be left a little.
    EXPECT_THAT(small.texels, ::testing::Each(::testing::Ge(side == 20 ? 200 : 250))) << side;
  }
}

TEST(TextureBaker, NumbersThatAreNoneDoNoHarm) {
  const TextureImage image = NoiseTexture(16, 16, 2);
  const double nan = std::nan(""), inf = HUGE_VAL;
  std::vector<TextureTriangle> bad(4);
  for (TextureTriangle& t : bad) t.from = t.to = {Vec2(0, 0), Vec2(1, 0), Vec2(1, 1)};
  bad[0].from[1] = Vec2(nan, inf);
  bad[1].to[1] = Vec2(nan, inf);
  bad[2].from[2] = Vec2(1e300, -1e300);
  bad[3].to = {Vec2(0, 0), Vec2(1e-300, 0), Vec2(0, 1e-300)};
  EXPECT_EQ(Bake(image, bad, 32).header.width, 32);
}

TEST(TextureBaker, KeepsTheDensityOfTheDensestTenth) {
  std::vector<TextureTriangle> triangles(2);
  triangles[0].to = triangles[1].to = {Vec2(0, 0), Vec2(0.5, 0), Vec2(0, 0.5)};
  triangles[0].from = {Vec2(0, 0), Vec2(1, 0), Vec2(0, 1)};
  triangles[1].from = {Vec2(0, 0), Vec2(0.25, 0), Vec2(0, 0.25)};
  EXPECT_DOUBLE_EQ(TextureSideOf(triangles, std::vector<double>{1, 1}, 512, 512), 1024);
  EXPECT_DOUBLE_EQ(TextureSideOf(triangles, std::vector<double>{1, 20}, 512, 512), 256);
}

}  // namespace
}  // namespace planish
