// The judge of UV: every kind of fault is found where one was made, and only there.
#include <array>
#include <cmath>
#include <limits>
#include <random>
#include <sstream>
#include <string>
#include <vector>

#include "client/cli/check.h"
#include "core/mesh/predicates.h"
#include "gmock/gmock.h"
#include "gtest/gtest.h"
#include "tests/testing/files.h"

namespace planish::cli {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::SizeIs;

constexpr int kN = 4, kFacesPerChart = 2 * kN * kN, kTexels = 1024;
constexpr double kTexel = 1.0 / kTexels;

// Squares of the surface, a chart each: grids of kN x kN squares cut into triangles, with UV that a test may spoil.
struct Charts {
  struct Grid {
    std::vector<Vec2> uv;  // (kN + 1)^2, row by row
    double z = 0;
    std::string material;
  };
  std::vector<Grid> grids;

  // With its lower left corner at `low`, in texels; `size` texels wide; on the surface a unit square.
  Grid& Add(const Vec2& low, double size) {
    Grid grid;
    grid.z = static_cast<double>(grids.size());
    for (int j = 0; j <= kN; ++j) {
      for (int i = 0; i <= kN; ++i) grid.uv.push_back((low + size / kN * Vec2(i, j)) * kTexel);
    }
    grids.push_back(grid);
    return grids.back();
  }

  std::string Obj() const {
    std::ostringstream text;
    text.precision(17);
    for (const Grid& grid : grids) {
      for (int j = 0; j <= kN; ++j) {
        for (int i = 0; i <= kN; ++i) text << "v " << 1.0 * i / kN << " " << 1.0 * j / kN << " " << grid.z << "\n";
      }
      for (const Vec2& p : grid.uv) text << "vt " << p.x() << " " << p.y() << "\n";
    }
    int first = 1;
    for (const Grid& grid : grids) {
      if (!grid.material.empty()) text << "usemtl " << grid.material << "\n";
      const auto face = [&](int a, int b, int c) {
        text << "f";
        for (const int v : {a, b, c}) text << " " << first + v << "/" << first + v;
        text << "\n";
      };
      for (int j = 0; j < kN; ++j) {
        for (int i = 0; i < kN; ++i) {
          const int v = j * (kN + 1) + i;
          face(v, v + 1, v + kN + 2);
          face(v, v + kN + 2, v + kN + 1);
        }
      }
      first += (kN + 1) * (kN + 1);
    }
    return text.str();
  }
};

// Four charts, 10 texels apart.
Charts FourCharts() {
  Charts charts;
  for (const double v : {5.0, 415.0}) {
    for (const double u : {5.0, 415.0}) charts.Add({u, v}, 400);
  }
  return charts;
}

struct Judged {
  CheckedMap map;
  std::vector<std::string> unmet;
  std::string text, json;

  const MapCheck& check() const { return map.check; }
};

Requirements Everything(double min_padding = 10) {
  Requirements wanted;
  wanted.required = {Requirement::kUv,       Requirement::kNoOverlap,    Requirement::kNoFlip,
                     Requirement::kNoMirror, Requirement::kNoDegenerate, Requirement::kInTile};
  wanted.min_padding = min_padding;
  wanted.max_stretch = 1.001;
  return wanted;
}

Judged JudgeObj(const std::string& obj, const Requirements& wanted = Everything(), int tiles = 1) {
  TempDir directory;
  PutFile(directory.Path("in.obj"), obj);
  const MeshInput input(directory.Path("in.obj"));
  MapCheckOptions options;
  options.texture_size = kTexels;
  options.tiles = tiles;
  options.min_padding = wanted.min_padding;
  Judged judged;
  judged.map = CheckMapOf(input, options, {});
  const std::vector<RequirementResult> results = CheckRequirements(wanted, judged.map);
  for (const RequirementResult& result : results) {
    if (!result.met) judged.unmet.push_back(result.name);
  }
  judged.text = CheckText(input, 0, {0}, options, judged.map, results);
  judged.json = ToLine(CheckJson(input, 0, {0}, options, judged.map, results));
  return judged;
}

Judged JudgeCharts(const Charts& charts, int tiles = 1) {
  return JudgeObj(charts.Obj(), Everything(), tiles);
}

TEST(CheckMap, AGoodMapIsGood) {
  const Judged judged = JudgeCharts(FourCharts());
  EXPECT_THAT(judged.unmet, IsEmpty());
  EXPECT_EQ(judged.map.triangles, 4 * kFacesPerChart);
  EXPECT_EQ(judged.map.topology.num_charts, 4);
  EXPECT_EQ(judged.check().overlaps.pairs, 0);
  EXPECT_NEAR(judged.check().spacing.nearest.distance, 10, 1e-9);
  EXPECT_NEAR(judged.check().stretch_l2, 1, 1e-12);
  EXPECT_NEAR(judged.check().angle_error_max_deg, 0, 1e-6);
  EXPECT_NEAR(judged.check().packing_efficiency, 4 * 400.0 * 400 / kTexels / kTexels, 1e-12);
  EXPECT_EQ(judged.check().seam_length, 0);  // the surface ends where charts end
  ASSERT_THAT(judged.check().densities, SizeIs(1));
  EXPECT_NEAR(judged.check().densities[0].mean, 400, 1e-9);
  for (const float stretch : judged.check().face_stretch) EXPECT_NEAR(stretch, 0, 1e-6);
}

TEST(CheckMap, FindsOneFlippedFace) {
  Charts charts = FourCharts();
  // The corner of a chart that only one face has, moved over the diagonal: that face is the one at the lower right.
  charts.grids[2].uv[kN] += Vec2(-150, 150) * kTexel;
  const Judged judged = JudgeCharts(charts);
  const int face = 2 * kFacesPerChart + 2 * (kN - 1);
  EXPECT_EQ(judged.check().flipped, 1);
  EXPECT_EQ(judged.check().faults[face] & kFlippedFace, kFlippedFace);
  EXPECT_EQ(judged.check().mirrored_charts, 0);
  EXPECT_THAT(judged.unmet, ::testing::Contains("no-flip"));
  EXPECT_THAT(judged.json, HasSubstr("\"flipped\":{\"count\":1,\"faces\":[" + std::to_string(face) + "]}"));
  EXPECT_THAT(judged.text, HasSubstr("NOT MET: no-flip: 1 triangle is flipped"));
}

TEST(CheckMap, AMirroredChartIsNotAFlippedFace) {
  Charts charts = FourCharts();
  for (Vec2& p : charts.grids[1].uv) p.x() = (415 + 815) * kTexel - p.x();
  const Judged judged = JudgeCharts(charts);
  EXPECT_THAT(judged.unmet, ElementsAre("no-mirror"));
  EXPECT_EQ(judged.check().flipped, 0);
  EXPECT_EQ(judged.check().mirrored_charts, 1);
  EXPECT_EQ(judged.check().mirrored_triangles, kFacesPerChart);
  EXPECT_TRUE(judged.check().charts[1].is_mirrored);
  EXPECT_EQ(judged.check().overlaps.pairs, 0);
}

TEST(CheckMap, FindsTwoChartsOneTexelTooNear) {
  Charts charts = FourCharts();
  for (Vec2& p : charts.grids[3].uv) p.y() -= kTexel;
  const Judged judged = JudgeCharts(charts);
  EXPECT_THAT(judged.unmet, ElementsAre("min-padding"));
  EXPECT_NEAR(judged.check().spacing.nearest.distance, 9, 1e-9);
  EXPECT_EQ(judged.check().spacing.nearest.a, 1);
  EXPECT_EQ(judged.check().spacing.nearest.b, 3);
  EXPECT_THAT(judged.text, HasSubstr("1 pair of charts is nearer than 10 texels; the nearest are 9 texels apart"));
}

TEST(CheckMap, FindsAnOverlapOfAMillionthOfTheTile) {
  Charts charts = FourCharts();
  // Corners that reach into each other by a thousandth of the tile either way.
  const Vec2 shift = Vec2::Constant(-10 * kTexel - 1e-3);
  for (Vec2& p : charts.grids[3].uv) p += shift;
  for (Vec2& p : charts.grids[1].uv) p.x() += 20 * kTexel;
  for (Vec2& p : charts.grids[2].uv) p.y() += 20 * kTexel;
  charts.grids.erase(charts.grids.begin() + 1, charts.grids.begin() + 3);
  const Judged judged = JudgeCharts(charts);
  EXPECT_THAT(judged.unmet, ElementsAre("no-overlap", "min-padding"));
  EXPECT_GE(judged.check().overlaps.pairs, 1);
  EXPECT_FALSE(judged.check().overlaps.limited);
  EXPECT_EQ(judged.check().spacing.nearest.distance, 0);
  // Only triangles at the two corners.
  for (std::size_t f = 0; f < judged.check().faults.size(); ++f) {
    const bool at_corner = f + 2 >= kFacesPerChart && f < kFacesPerChart + 2;
    if (!at_corner) {
      EXPECT_EQ(judged.check().faults[f], 0) << f;
    }
  }
}

TEST(CheckMap, AChartInsideAnotherOneOverlapsIt) {
  Charts charts;
  charts.Add({100, 100}, 800);
  charts.Add({510, 430}, 10);
  const Judged judged = JudgeCharts(charts);
  EXPECT_GT(judged.check().overlaps.pairs, 0);
  EXPECT_EQ(judged.check().spacing.nearest.distance, 0);
  EXPECT_EQ(judged.check().overlapping_pairs.size(), 2 * static_cast<std::size_t>(judged.check().overlaps.pairs));
}

TEST(CheckMap, TilesAreThoseThatAreAllowed) {
  Charts charts = FourCharts();
  for (Vec2& p : charts.grids[3].uv) p.x() += 1;
  EXPECT_THAT(JudgeCharts(charts).unmet, ElementsAre("in-tile"));
  const Judged two = JudgeCharts(charts, 2);
  EXPECT_THAT(two.unmet, IsEmpty());
  EXPECT_EQ(two.check().tiles_used, 2);
  EXPECT_EQ(two.check().charts[3].tile, 1);
  EXPECT_NEAR(two.check().packing_efficiency, 2 * 400.0 * 400 / kTexels / kTexels, 1e-12);
  for (Vec2& p : charts.grids[3].uv) p.x() -= 0.5;  // over the border between both
  EXPECT_THAT(JudgeCharts(charts, 2).unmet, ::testing::Contains("in-tile"));
}

TEST(CheckMap, TileBordersBelongToBothTiles) {
  Charts charts;
  charts.Add({0, 0}, kTexels);
  const Judged judged = JudgeObj(charts.Obj(), Everything(0));
  EXPECT_THAT(judged.unmet, IsEmpty());
  EXPECT_EQ(judged.check().packing_efficiency, 1);
}

TEST(CheckMap, ChartsOfDifferentTilesAreNotTooNear) {
  Charts charts;
  charts.Add({kTexels - 401.0, 10}, 400);
  charts.Add({kTexels + 1.0, 10}, 400);
  EXPECT_THAT(JudgeCharts(charts, 2).unmet, IsEmpty());
}

TEST(CheckMap, DegenerateTrianglesAndMissingUv) {
  Charts charts = FourCharts();
  for (int i = 0; i <= kN; ++i) charts.grids[0].uv[i] = charts.grids[0].uv[kN + 1 + i];
  Judged judged = JudgeCharts(charts);
  EXPECT_EQ(judged.check().degenerate, 2 * kN);
  EXPECT_THAT(judged.unmet, ElementsAre("no-degenerate"));

  judged = JudgeObj(FourCharts().Obj() + "f 1 2 7\nf 1 7 6\n");
  EXPECT_THAT(judged.unmet, ElementsAre("uv"));
  EXPECT_THAT(judged.map.without_uv, ElementsAre(4 * kFacesPerChart, 4 * kFacesPerChart + 1));

  judged = JudgeObj(FourCharts().Obj() + "vt nan 0\nf 1/1 2/101 7/7\n");
  EXPECT_THAT(judged.unmet, ElementsAre("uv"));
  EXPECT_THAT(judged.map.not_finite, ElementsAre(4 * kFacesPerChart));

  judged = JudgeObj("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n");
  EXPECT_FALSE(judged.map.has_uv());
  EXPECT_THAT(judged.unmet, ElementsAre("uv"));
  EXPECT_THAT(judged.text, HasSubstr("1 triangle, no UV"));
}

// unwrap gave them UV without a promise and said "no degenerate triangles"; check said that there were some.
TEST(CheckMap, FacesWithoutAreaAreNoFaultOfTheMap) {
  // Three vertices on a line, one of them twice, and a face that lies over others in the map.
  const Judged judged = JudgeObj(FourCharts().Obj() + "f 1/1 2/2 3/3\nf 1/1 2/2 2/2\nf 1/1 3/8 5/5\n", Everything(0));
  EXPECT_THAT(judged.unmet, IsEmpty());
  EXPECT_EQ(judged.check().degenerate, 0);
  EXPECT_EQ(judged.check().flipped, 0);
  EXPECT_EQ(judged.check().without_area, 3);
  EXPECT_THAT(judged.text, HasSubstr("no area on surface  3 (face 128 "));
  EXPECT_EQ(Json::parse(judged.json)["without_area"]["count"], 3);
}

TEST(CheckMap, StretchAndAnglesAreThoseOfTheFormulas) {
  Charts charts;
  Charts::Grid& grid = charts.Add({10, 10}, 400);
  for (Vec2& p : grid.uv) p.y() /= 2;
  const Judged judged = JudgeCharts(charts);
  // A unit square of 400 x 200 texels: singular values 1 / 400 and 1 / 200, relative to the root of the area.
  const double stretch = std::sqrt((1 / 400.0 / 400 + 1 / 200.0 / 200) / 2) * std::sqrt(400.0 * 200);
  EXPECT_NEAR(judged.check().stretch_l2, stretch, 1e-9);
  EXPECT_NEAR(judged.check().charts[0].stretch_l2, stretch, 1e-9);
  EXPECT_THAT(judged.unmet, ElementsAre("max-stretch"));
  EXPECT_NEAR(judged.check().angle_error_max_deg, 45 - std::atan(0.5) * 180 / std::acos(-1.0), 1e-6);
  for (const float s : judged.check().face_stretch) EXPECT_NEAR(s, 0.5, 1e-6);
}

TEST(CheckMap, DensitiesAreToldByMaterial) {
  Charts charts;
  charts.Add({10, 10}, 400).material = "skin";
  charts.Add({450, 10}, 100).material = "cloth";
  charts.Add({600, 10}, 200).material = "cloth";
  const Judged judged = JudgeCharts(charts);
  ASSERT_THAT(judged.check().densities, SizeIs(2));
  EXPECT_NEAR(judged.check().densities[0].mean, 400, 1e-9);
  EXPECT_NEAR(judged.check().densities[1].low, 100, 1e-9);
  EXPECT_NEAR(judged.check().densities[1].high, 200, 1e-9);
  EXPECT_NEAR(judged.check().densities[1].mean, std::sqrt((100.0 * 100 + 200 * 200) / 2), 1e-9);
  EXPECT_THAT(judged.text, HasSubstr("[cloth]"));
}

TEST(CheckMap, SeamsAreEdgesWhereTheMapParts) {
  // A strip of two squares, 1 x 1 each, which share an edge on the surface and nothing in the map.
  const Judged judged = JudgeObj(
      "v 0 0 0\nv 1 0 0\nv 2 0 0\nv 0 1 0\nv 1 1 0\nv 2 1 0\n"
      "vt 0 0\nvt .4 0\nvt .4 .4\nvt 0 .4\nvt .5 0\nvt .9 0\nvt .9 .4\nvt .5 .4\n"
      "f 1/1 2/2 5/3 4/4\nf 2/5 3/6 6/7 5/8\n");
  EXPECT_EQ(judged.map.topology.num_charts, 2);
  EXPECT_NEAR(judged.check().seam_length, 1 / std::sqrt(2.0), 1e-12);
  EXPECT_NEAR(judged.check().seams.visible_length, 1 / std::sqrt(2.0), 1e-6);
  EXPECT_EQ(judged.check().seams.symmetry, 1);
  EXPECT_THAT(judged.text, HasSubstr("in view"));
}

TEST(CheckMap, PilesOfTrianglesAreCountedUpToACap) {
  // 3,000 triangles in one place: 4.5 million pairs.
  std::string obj = "v 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\nvt 1 0\nvt 0 1\n";
  for (int i = 0; i < 3000; ++i) obj += "f 1/1 2/2 3/3\n";
  const Judged judged = JudgeObj(obj, Everything(0));
  EXPECT_EQ(judged.check().overlaps.pairs, kMaxOverlaps);
  EXPECT_TRUE(judged.check().overlaps.limited);
  EXPECT_THAT(judged.text, HasSubstr("at least 1,000,000"));
}

// Triangles at random, against all pairs looked at one by one; and with a team, and with a limit.
TEST(FindOverlaps, FindsWhatAllPairsHave) {
  std::mt19937 random(7);
  std::uniform_real_distribution<double> place(0, 1), offset(-0.03, 0.03);
  constexpr int kFaces = 5000;
  CornerUv uv;
  for (int f = 0; f < kFaces; ++f) {
    const Vec2 centre(place(random), place(random));
    for (int k = 0; k < 3; ++k) {
      uv.push_back(centre.x() + offset(random));
      uv.push_back(centre.y() + offset(random));
    }
  }
  std::vector<std::array<Vec2, 3>> upright(kFaces);
  for (int f = 0; f < kFaces; ++f) {
    for (int k = 0; k < 3; ++k) upright[f][k] = UvOf(uv, 3 * f + k);
    if (Orientation(upright[f][0], upright[f][1], upright[f][2]) < 0) std::swap(upright[f][1], upright[f][2]);
  }
  std::int64_t pairs = 0;
  for (int f = 0; f < kFaces; ++f) {
    for (int g = f + 1; g < kFaces; ++g) pairs += InteriorsMeet(upright[f].data(), upright[g].data());
  }
  ThreadTeam team(2);
  Execution execution;
  execution.team = &team;
  std::vector<std::int32_t> named, named_by_team;
  const Overlaps alone = FindOverlaps(uv, kMaxOverlapTests, &named);
  const Overlaps by_team = FindOverlaps(uv, kMaxOverlapTests, &named_by_team, execution);
  EXPECT_EQ(alone.pairs, pairs);
  EXPECT_FALSE(alone.limited);
  EXPECT_EQ(by_team.pairs, pairs);
  EXPECT_EQ(named, named_by_team);
  EXPECT_THAT(named, SizeIs(2 * pairs));

  named.clear(), named_by_team.clear();
  const Overlaps some = FindOverlaps(uv, 20'000, &named);
  const Overlaps some_by_team = FindOverlaps(uv, 20'000, &named_by_team, execution);
  EXPECT_TRUE(some.limited);
  EXPECT_GT(some.pairs, 0);
  EXPECT_LT(some.pairs, pairs);
  EXPECT_EQ(some.pairs, some_by_team.pairs);
  EXPECT_EQ(named, named_by_team);
}

// Segments at random in a few charts, against all pairs.
TEST(FindChartSpacing, FindsWhatAllPairsHave) {
  for (int seed = 0; seed < 50; ++seed) {
    std::mt19937 random(static_cast<unsigned>(seed));
    std::uniform_real_distribution<double> place(0, 1), offset(-0.02, 0.02);
    constexpr int kCharts = 6, kSegments = 8;
    std::vector<OutlineSegment> segments;
    for (int c = 0; c < kCharts; ++c) {
      const Vec2 centre(place(random), place(random));
      for (int i = 0; i < kSegments; ++i) {
        segments.push_back(
            {centre + Vec2(offset(random), offset(random)), centre + Vec2(offset(random), offset(random)), c});
      }
    }
    double nearest = std::numeric_limits<double>::infinity();
    std::vector<char> is_near(kCharts * kCharts, 0);
    constexpr double kWanted = 0.2;
    for (const OutlineSegment& s : segments) {
      for (const OutlineSegment& t : segments) {
        if (s.chart >= t.chart) continue;
        double d =
            std::sqrt(std::min({SquaredDistanceToSegment(s.a, t.a, t.b), SquaredDistanceToSegment(s.b, t.a, t.b),
                                SquaredDistanceToSegment(t.a, s.a, s.b), SquaredDistanceToSegment(t.b, s.a, s.b)}));
        if (SegmentsMeet(s.a, s.b, t.a, t.b)) d = 0;
        nearest = std::min(nearest, d);
        if (d < kWanted) is_near[s.chart * kCharts + t.chart] = 1;
      }
    }
    const ChartSpacing found =
        FindChartSpacing(segments, std::vector<std::int32_t>(kCharts, 0), 1, kWanted, kMaxOverlapTests);
    EXPECT_EQ(found.nearest.distance, nearest) << seed;
    EXPECT_EQ(found.near.size(), static_cast<std::size_t>(std::count(is_near.begin(), is_near.end(), 1))) << seed;
    EXPECT_FALSE(found.limited);
  }
}

}  // namespace
}  // namespace planish::cli
