#include "client/pictures/uv_preview.h"

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <random>
#include <string>
#include <vector>

#include "client/files/uv_islands.h"
#include "gmock/gmock.h"
#include "gtest/gtest.h"

namespace planish {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::Not;

struct Map {
  Mesh mesh;
  std::vector<double> uv;
};

// 2 n^2 triangles on the unit square; the UV are the positions, and z is noise of that height.
Map Grid(int n, double noise = 0) {
  Map map;
  std::mt19937 random(7);
  const auto uniform = [&] { return static_cast<double>(random()) / 4294967296.0; };
  for (int y = 0; y <= n; ++y) {
    for (int x = 0; x <= n; ++x) map.mesh.positions.emplace_back(1.0 * x / n, 1.0 * y / n, noise * uniform());
  }
  for (int y = 0; y < n; ++y) {
    for (int x = 0; x < n; ++x) {
      const int v = y * (n + 1) + x;
      map.mesh.faces.push_back({v, v + 1, v + n + 2});
      map.mesh.faces.push_back({v, v + n + 2, v + n + 1});
    }
  }
  for (const Face& face : map.mesh.faces) {
    for (const std::int32_t v : face) {
      map.uv.insert(map.uv.end(), {map.mesh.positions[v].x(), map.mesh.positions[v].y()});
    }
  }
  return map;
}

// Two triangles of a square, the second as a chart of its own: moved, and scaled about (1, 1).
Map TwoCharts(double scale, double move) {
  Map map = Grid(1);
  for (std::size_t i = 6; i < 12; ++i) map.uv[i] = 1 - scale * (1 - map.uv[i]) + (i % 2 == 0 ? move : 0);
  return map;
}

// Twice the area inside the closed lines of the path data "M x y l dx dy ...", summed with sign.
double TwiceArea(const std::string& data) {
  double sum = 0, x = 0, y = 0, x0 = 0, y0 = 0;
  const char* at = data.c_str();
  while (*at != 0) {
    if (*at == 'M') {
      char* end = nullptr;
      x = x0 = std::strtod(at + 1, &end);
      y = y0 = std::strtod(end, &end);
      at = end;
    } else if (*at == 'z') {
      sum += x * y0 - x0 * y;
      ++at;
    } else {
      char* end = nullptr;
      const double dx = std::strtod(*at == 'l' ? at + 1 : at, &end), dy = std::strtod(end, &end);
      sum += x * (y + dy) - (x + dx) * y;
      x += dx;
      y += dy;
      at = end;
    }
  }
  return sum;
}

std::vector<std::string> PathsOfClass(const std::string& svg, const std::string& name) {
  std::vector<std::string> found;
  const std::string head = "class=\"" + name + "\" d=\"";
  for (std::size_t at = svg.find(head); at != std::string::npos; at = svg.find(head, at)) {
    at += head.size();
    found.push_back(svg.substr(at, svg.find('"', at) - at));
  }
  return found;
}

bool IsRed(const Rgb& p) {
  return p.r > p.b + 60;
}
bool IsBlue(const Rgb& p) {
  return p.b > p.r + 60;
}

TEST(UvIslands, JoinAcrossVerticesSplitForNormals) {
  Map map = Grid(1);
  map.mesh.positions.push_back(map.mesh.positions[0]);
  map.mesh.positions.push_back(map.mesh.positions[3]);
  map.mesh.faces[1] = {4, 5, 2};
  map.uv[6] = -0.0;
  const UvIslands one = FindUvIslands(map.mesh, map.uv);
  EXPECT_EQ(one.count, 1);
  EXPECT_EQ(one.num_places, 4);
  EXPECT_THAT(one.is_outline, ElementsAre(1, 0, 1, 1, 1, 0));
}

TEST(UvIslands, PartWhereUvDiffer) {
  const Map map = TwoCharts(0.5, 0);
  const UvIslands two = FindUvIslands(map.mesh, map.uv);
  EXPECT_EQ(two.count, 2) << "they share one place, which is no edge";
  EXPECT_EQ(two.num_places, 5);
  EXPECT_THAT(two.is_outline, ElementsAre(1, 1, 1, 1, 1, 1));
  EXPECT_EQ(FindUvIslands(map.mesh, map.uv, {8, 8}).count, 1) << "triangles of one polygon";
  EXPECT_EQ(FindUvIslands({}, {}).count, 0);
}

TEST(UvPreview, PaintsWhatShrankBlueAndWhatGrewRed) {
  const Map map = TwoCharts(0.5, 0);
  const Image image = DrawUvPreview(map.mesh, map.uv);
  ASSERT_EQ(image.width, 1024 + 40);
  const auto at = [&](double u, double v) { return image.At(20 + int(1024 * u), 20 + int(1024 * (1 - v))); };
  EXPECT_TRUE(IsRed(at(0.7, 0.2)));
  EXPECT_TRUE(IsBlue(at(0.7, 0.9)));
  const Rgb free = at(0.2, 0.6), line = at(0.25, 0.2505);
  EXPECT_EQ(free.r + free.g + free.b, 3 * 255);
  EXPECT_LT(line.r + line.g + line.b, 200);
}

TEST(UvPreview, AMapWithoutDistortionIsGrey) {
  const Map map = Grid(4);
  const Image image = DrawUvPreview(map.mesh, map.uv);
  for (int i = 100; i < 1000; i += 37) {
    const Rgb p = image.At(i, 1024 - i / 2);
    EXPECT_LE(std::abs(p.r - p.b), 4) << i;
    EXPECT_LT(p.r, 240) << i;
  }
}

TEST(UvPreview, TrianglesAgainstTheirChartAreYellow) {
  Map map = Grid(4);
  // A vertex inside moves over the far side of one of its triangles.
  for (std::size_t c = 0; c < map.uv.size() / 2; ++c) {
    if (map.mesh.faces[c / 3][c % 3] == 12) map.uv[2 * c] = map.uv[2 * c + 1] = 0.9;
  }
  const std::string svg = UvPreviewSvg(map.mesh, map.uv);
  EXPECT_THAT(svg, HasSubstr(" turned over (yellow)"));
  EXPECT_FALSE(PathsOfClass(svg, "c17").empty());
  const Image image = DrawUvPreview(map.mesh, map.uv);
  EXPECT_GT(std::count_if(image.pixels.begin(), image.pixels.end(),
                          [](const Rgb& p) { return p.r > 250 && p.g > 200 && p.b < 5; }),
            1000);
}

TEST(UvPreviewSvg, FillsCoverExactlyTheCharts) {
  Map map = Grid(60, 0.02);
  // Half of them mirrored in the surface and the map alike must not matter.
  for (std::size_t f = 0; f < map.mesh.faces.size(); f += 2) {
    std::swap(map.mesh.faces[f][1], map.mesh.faces[f][2]);
    std::swap(map.uv[6 * f + 2], map.uv[6 * f + 4]);
    std::swap(map.uv[6 * f + 3], map.uv[6 * f + 5]);
  }
  const std::string svg = UvPreviewSvg(map.mesh, map.uv);
  double area = 0;
  int colours = 0;
  for (int c = 0; c < 18; ++c) {
    for (const std::string& data : PathsOfClass(svg, "c" + std::to_string(c))) {
      area += std::abs(TwiceArea(data)) / 2;
      ++colours;
    }
  }
  EXPECT_GE(colours, 4);
  EXPECT_NEAR(area / (4096.0 * 4096), 1, 1e-12);
  ASSERT_EQ(PathsOfClass(svg, "o").size(), 1u);
  EXPECT_NEAR(std::abs(TwiceArea(PathsOfClass(svg, "o")[0])) / 2, 4096.0 * 4096, 0.5);
}

TEST(UvPreviewSvg, MergesTrianglesOfOneColour) {
  const Map map = Grid(100);
  const std::string svg = UvPreviewSvg(map.mesh, map.uv);
  EXPECT_THAT(svg, HasSubstr("<path class=\"c8\" d=\"M0 4096l4096 0 0-4096-4096 0z\"/>"));
  EXPECT_THAT(svg, HasSubstr(">1 chart, 20000 triangles<"));
  EXPECT_LT(svg.size(), 5000u);
}

TEST(UvPreviewSvg, OneOutlinePerChartAndTilesSideBySide) {
  const Map map = TwoCharts(0.5, 1);
  const std::string svg = UvPreviewSvg(map.mesh, map.uv);
  EXPECT_EQ(PathsOfClass(svg, "o").size(), 2u);
  EXPECT_THAT(svg, HasSubstr(">tile 1001<"));
  EXPECT_THAT(svg, HasSubstr(">tile 1002<"));
  const Image image = DrawUvPreview(map.mesh, map.uv);
  EXPECT_EQ(image.width, 3 * 20 + 2 * 768);
  EXPECT_TRUE(IsRed(image.At(20 + 500, 20 + 600)));
  EXPECT_TRUE(IsBlue(image.At(2 * 20 + 768 + 540, 20 + 70)));
}

TEST(UvPreview, FitsWhatLiesInNoTileIntoOneFrame) {
  for (const double move : {-3.0, 0.3, 40.0}) {
    const Map map = TwoCharts(1, move);
    const std::string svg = UvPreviewSvg(map.mesh, map.uv);
    EXPECT_THAT(svg, Not(HasSubstr(">tile "))) << move;
    double area = 0;
    for (const std::string& data : PathsOfClass(svg, "o")) area += std::abs(TwiceArea(data)) / 2;
    const double side = 4096 / (1.04 * (1 + std::abs(move)));
    EXPECT_NEAR(area / (side * side), 1, 0.03) << move;
  }
  // The same where it is asked for: the chart fills the frame up to a small margin.
  Map tiny = Grid(1);
  for (double& x : tiny.uv) x = 0.5 + 0.001 * x;
  const std::string svg = UvPreviewSvg(tiny.mesh, tiny.uv, {.fit = true});
  ASSERT_EQ(PathsOfClass(svg, "o").size(), 1u);
  EXPECT_NEAR(std::abs(TwiceArea(PathsOfClass(svg, "o")[0])) / 2, std::pow(4096 / 1.04, 2), 10000);
}

TEST(UvPreviewSvg, StaysSmallWhateverTheColours) {
  const Map many = Grid(223, 0.02);  // 99,458 triangles; nearly all differ from their neighbours
  const std::string each = UvPreviewSvg(many.mesh, many.uv);
  EXPECT_THAT(each, Not(HasSubstr("too many triangles")));
  EXPECT_LT(each.size(), 2500000u);
  EXPECT_GT(each.size(), 500000u) << "not a hard case";

  const Map more = Grid(500, 0.02);
  const std::string chart = UvPreviewSvg(more.mesh, more.uv);
  EXPECT_THAT(chart, HasSubstr("of each chart (too many triangles to show each)"));
  EXPECT_LT(chart.size(), 10000u);
}

TEST(UvPreview, NothingToDraw) {
  EXPECT_THAT(UvPreviewSvg({}, {}), HasSubstr("0 charts, 0 triangles"));
  EXPECT_EQ(DrawUvPreview({}, {}).width, 1024 + 40);
  // A map that is one point.
  Map map = Grid(1);
  map.uv.assign(12, 0.25);
  EXPECT_THAT(UvPreviewSvg(map.mesh, map.uv), HasSubstr("1 chart, 2 triangles"));
}

}  // namespace
}  // namespace planish
