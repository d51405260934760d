#include "core/pack/pack.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include "core/base/thread_team.h"
#include "core/mesh/box_tree.h"
#include "core/mesh/predicates.h"
#include "core/pack/board.h"
#include "core/pack/outline.h"
#include "core/pack/silhouette.h"
#include "core/pack/trial.h"
#include "gmock/gmock.h"
#include "gtest/gtest.h"
#include "tests/core/pack_charts.h"
#include "tests/testing/dice.h"

namespace planish {
namespace {

std::vector<PackChart> Charts(const std::string& name) {
  return *testing::MakeCharts(name);
}

// Where every corner of every face lies, as floats hold it.
struct PlacedChart {
  std::vector<std::array<Vec2, 3>> triangles;
  Box box;
  int tile;
};

std::vector<PlacedChart> Place(const std::vector<PackChart>& charts, const Packing& packing) {
  std::vector<PlacedChart> placed;
  for (std::size_t i = 0; i < charts.size(); ++i) {
    placed.push_back({{}, {}, packing.charts[i].tile});
    for (const Face& face : charts[i].faces) {
      std::array<Vec2, 3> triangle;
      for (int k = 0; k < 3; ++k) {
        triangle[k] = packing.charts[i](charts[i].positions[face[k]]).cast<float>().cast<double>();
        placed.back().box.Add(triangle[k]);
      }
      placed.back().triangles.push_back(triangle);
    }
  }
  return placed;
}

double Distance(const Vec2& p, const Vec2& a, const Vec2& b) {
  const double t = std::clamp((p - a).dot(b - a) / std::max((b - a).squaredNorm(), 1e-300), 0.0, 1.0);
  return (a + t * (b - a) - p).norm();
}

double Distance(const std::array<Vec2, 3>& s, const std::array<Vec2, 3>& t) {
  if (InteriorsMeet(s.data(), t.data())) return 0;
  double least = std::numeric_limits<double>::infinity();
  for (int i = 0; i < 3; ++i) {
    for (int k = 0; k < 3; ++k) {
      least = std::min({least, Distance(s[i], t[k], t[Next(k)]), Distance(t[i], s[k], s[Next(k)])});
      if (SegmentsMeet(s[i], s[Next(i)], t[k], t[Next(k)])) return 0;
    }
  }
  return least;
}

// The least distance between two charts, or infinity if all are farther apart than `reach`.
double LeastDistance(const std::vector<PlacedChart>& charts, double reach) {
  double least = std::numeric_limits<double>::infinity();
  for (std::size_t i = 0; i < charts.size(); ++i) {
    Box box = charts[i].box;
    box.low -= Vec2::Constant(reach);
    box.high += Vec2::Constant(reach);
    for (std::size_t j = i + 1; j < charts.size(); ++j) {
      if (!charts[j].box.Meets(box)) continue;
      for (const auto& s : charts[i].triangles) {
        Box near;
        for (const Vec2& p : s) near.Add(p);
        near.low -= Vec2::Constant(reach);
        near.high += Vec2::Constant(reach);
        for (const auto& t : charts[j].triangles) {
          Box other;
          for (const Vec2& p : t) other.Add(p);
          if (other.Meets(near)) least = std::min(least, Distance(s, t));
        }
      }
    }
  }
  return least;
}

// Texels between charts and the rim of their tile; below 0 if some lies beyond.
double LeastFromRim(const std::vector<PlacedChart>& charts) {
  double least = std::numeric_limits<double>::infinity();
  for (const PlacedChart& chart : charts) {
    const Vec2 corner(chart.tile % 10, chart.tile / 10);
    least = std::min({least, (chart.box.low - corner).minCoeff(), (corner + Vec2::Ones() - chart.box.high).minCoeff()});
  }
  return least;
}

double Efficiency(const std::vector<PlacedChart>& charts, int tiles) {
  double area = 0;
  for (const PlacedChart& chart : charts) {
    for (const auto& t : chart.triangles) {
      const Vec2 a = t[1] - t[0], b = t[2] - t[0];
      area += (a.x() * b.y() - a.y() * b.x()) / 2;
    }
  }
  return area / tiles;
}

struct Case {
  std::string charts;
  int texture_size, padding, tiles;
  double efficiency;  // at least
};

class PackingOf : public ::testing::TestWithParam<Case> {};

TEST_P(PackingOf, KeepsEveryPromise) {
  const Case& c = GetParam();
  const std::vector<PackChart> charts = Charts(c.charts);
  PackOptions options;
  options.texture_size = c.texture_size;
  options.padding = c.padding;
  options.tiles = c.tiles;
  const Packing packing = Pack(charts, options);
  ASSERT_EQ(packing.charts.size(), charts.size());
  EXPECT_EQ(packing.padding, c.padding);
  const std::vector<PlacedChart> placed = Place(charts, packing);
  EXPECT_GT(LeastDistance(placed, (c.padding + 1.0) / c.texture_size), 1e-7);
  EXPECT_GE(LeastDistance(placed, (c.padding + 1.0) / c.texture_size) * c.texture_size, c.padding);
  EXPECT_GE(LeastFromRim(placed) * c.texture_size, (c.padding + 1) / 2);
  EXPECT_NEAR(packing.efficiency, Efficiency(placed, packing.tiles), 1e-4);
  EXPECT_GE(packing.efficiency, c.efficiency);
  EXPECT_LE(packing.tiles, c.tiles);
  for (std::size_t i = 0; i < charts.size(); ++i) {
    EXPECT_NEAR(packing.charts[i].scale, packing.scale * charts[i].density, 1e-12);
    EXPECT_GE(packing.charts[i].tile, 0);
    EXPECT_LT(packing.charts[i].tile, packing.tiles);
  }
}

INSTANTIATE_TEST_SUITE_P(Kinds, PackingOf,
                         ::testing::Values(Case{"blobs-1", 1024, 2, 1, 0.6}, Case{"blobs-2", 1024, 2, 1, 0.55},
                                           Case{"blobs-15", 1024, 2, 1, 0.74}, Case{"blobs-15-1", 1024, 0, 1, 0.76},
                                           Case{"rags-20", 1024, 3, 1, 0.66}, Case{"mixed-20-1", 2048, 8, 1, 0.66},
                                           Case{"equal-20", 512, 1, 1, 0.65}, Case{"corners-50", 1024, 2, 1, 0.75},
                                           Case{"strips-40", 1024, 2, 1, 0.7}, Case{"rings-30", 1024, 5, 1, 0.4},
                                           Case{"needles-20", 1024, 2, 1, 0.1}, Case{"blobs-100", 1024, 2, 1, 0.74},
                                           Case{"mixed-200", 2048, 2, 1, 0.66}, Case{"mixed-60", 1024, 2, 12, 0.1},
                                           Case{"blobs-60", 1024, 3, 3, 0.7}),
                         [](const auto& instance) {
                           std::string name =
                               instance.param.charts + "_at_" + std::to_string(instance.param.texture_size);
                           std::replace(name.begin(), name.end(), '-', '_');
                           return name;
                         });

TEST(Pack, EndsAtTheScaleThatIsAskedFor) {
  for (const char* kind : {"blobs-1", "blobs-15", "rings-30", "blobs-400"}) {
    const std::vector<PackChart> charts = Charts(kind);
    PackOptions options;
    options.padding = 1;
    options.texture_size = 2048;
    const double most = Pack(charts, options).scale;
    for (const double part : {0.02, 0.7, 0.95}) {
      options.most_scale = part * most;
      const Packing packing = Pack(charts, options);
      EXPECT_EQ(packing.padding, options.padding);
      EXPECT_LE(packing.scale, options.most_scale * (1 + 1e-12)) << kind << " " << part;
      EXPECT_GE(packing.scale, options.most_scale * (1 - 1e-12)) << kind << " " << part;
      const std::vector<PlacedChart> placed = Place(charts, packing);
      EXPECT_GE(LeastDistance(placed, 3.0 / 2048) * 2048, options.padding) << kind << " " << part;
      EXPECT_GE(LeastFromRim(placed) * 2048, 1) << kind << " " << part;
    }
  }
}

void ExpectSame(const Packing& a, const Packing& b) {
  EXPECT_EQ(a.scale, b.scale);
  EXPECT_EQ(a.tiles, b.tiles);
  ASSERT_EQ(a.charts.size(), b.charts.size());
  for (std::size_t i = 0; i < a.charts.size(); ++i) {
    EXPECT_EQ(a.charts[i].angle, b.charts[i].angle);
    EXPECT_EQ(a.charts[i].scale, b.charts[i].scale);
    EXPECT_EQ(a.charts[i].offset, b.charts[i].offset);
    EXPECT_EQ(a.charts[i].tile, b.charts[i].tile);
  }
}

TEST(Pack, GivesTheSameForAnyNumberOfThreads) {
  const std::vector<PackChart> charts = Charts("mixed-30");
  PackOptions options;
  const Packing alone = Pack(charts, options);
  for (const int threads : {1, 2, 3}) {
    ThreadTeam team(threads);
    Execution execution;
    execution.team = &team;
    ExpectSame(alone, Pack(charts, options, execution));
  }
}

TEST(Pack, BestKeepsThePaddingOnAnyNumberOfThreads) {
  const std::vector<PackChart> charts = Charts("mixed-12");
  PackOptions options;
  options.effort = PackEffort::kBest;
  options.tuning.least_best_work = 2e9;
  const Packing alone = Pack(charts, options);
  EXPECT_GE(LeastDistance(Place(charts, alone), 3.0 / 1024) * 1024, options.padding);
  ThreadTeam team(2);
  Execution execution;
  execution.team = &team;
  ExpectSame(alone, Pack(charts, options, execution));
}

TEST(Pack, DoesNotCareWhereChartsLie) {
  std::vector<PackChart> charts = Charts("blobs-12");
  const Packing before = Pack(charts, {});
  for (std::size_t i = 0; i < charts.size(); ++i) {
    // Exact in double, as the positions are made multiples of a small power of two.
    for (Vec2& p : charts[i].positions) p = (p * 0x1p20).array().round() * 0x1p-20;
  }
  const Packing rounded = Pack(charts, {});
  for (std::size_t i = 0; i < charts.size(); ++i) {
    for (Vec2& p : charts[i].positions) p += Vec2(512.0 * static_cast<double>(i), -1024);
  }
  const Packing moved = Pack(charts, {});
  EXPECT_EQ(rounded.scale, moved.scale);
  EXPECT_NEAR(before.efficiency, rounded.efficiency, 0.05);
  EXPECT_GE(LeastDistance(Place(charts, moved), 3.0 / 1024) * 1024, 2);
}

TEST(Pack, HoldsDensityUpOnSeveralTiles) {
  const std::vector<PackChart> charts = Charts("blobs-40");
  PackOptions options;
  const Packing one = Pack(charts, options);
  options.tiles = 4;
  const Packing four = Pack(charts, options);
  EXPECT_EQ(one.tiles, 1);
  EXPECT_EQ(four.tiles, 4);
  EXPECT_GT(four.scale, 1.8 * one.scale);
}

TEST(Pack, MoreEffortFillsMore) {
  const std::vector<PackChart> charts = Charts("equal-20");
  const auto efficiency = [&](PackEffort effort) {
    PackOptions options;
    options.effort = effort;
    options.tuning.least_best_work = 2e9;
    return Pack(charts, options).efficiency;
  };
  const double fast = efficiency(PackEffort::kFast), best = efficiency(PackEffort::kBest);
  EXPECT_GT(fast, 0.6);
  EXPECT_GT(best, 0.76);
}

// Thousands of charts of a few texels: work in proportion to them, and what fills the texture is charts.
TEST(Pack, TakesThousandsOfSmallCharts) {
  const std::vector<PackChart> charts = Charts("mixed-3000");
  PackOptions options;
  options.texture_size = 4096;
  const Packing packing = Pack(charts, options);
  EXPECT_EQ(packing.padding, options.padding);
  EXPECT_GT(packing.efficiency, 0.6);
  const std::vector<PlacedChart> placed = Place(charts, packing);
  EXPECT_GE(LeastDistance(placed, 3.0 / 4096) * 4096, options.padding);
  EXPECT_GE(LeastFromRim(placed) * 4096, 1);
}

// Of V-shaped needles far fewer fit than their area says: the first scales are much too large.
TEST(Pack, LeavesNoRoomAboveNeedles) {
  for (const int seed : {1, 2, 3}) {
    testing::Dice dice(seed);
    std::vector<PackChart> charts(450);
    for (PackChart& chart : charts) {
      const double length = 0.05 * std::pow(20, dice.In(0, 1)), angle = dice.In(0.3, 1.5);
      const Vec2 inner(std::cos(angle / 2), std::sin(angle / 2)), outer(std::cos(angle), std::sin(angle));
      chart.positions = {Vec2::Zero(), Vec2(length, 0), 0.0005 * inner, length * outer};
      chart.faces = {{0, 1, 2}, {0, 2, 3}};
    }
    double top = 0;
    for (const PlacedChart& chart : Place(charts, Pack(charts, {}))) top = std::max(top, chart.box.high.y());
    EXPECT_GT(top, 0.95) << "seed " << seed;
  }
}

// In the end charts are moved apart until they keep their distances exactly. One that was short of its distance by less
// than the relaxation tolerates stayed where it was, until all had shrunk.
TEST(Pack, KeepsTheScaleWhereItMeasuresExactly) {
  PackOptions options, without_margins;
  without_margins.tuning.settling_margin = 0;
  without_margins.tuning.settling_shrink = 0.9995;
  double efficiency = 0, before = 0;
  for (const std::string name : {"rags-60-1", "rags-60-2", "rags-60-3", "rags-60-4"}) {
    const std::vector<PackChart> charts = Charts(name);
    efficiency += Pack(charts, options).efficiency / 4;
    before += Pack(charts, without_margins).efficiency / 4;
  }
  EXPECT_GT(efficiency, before + 0.0005);
}

TEST(Pack, TakesNoMoreTilesThanCharts) {
  PackOptions options;
  options.tiles = 9;
  EXPECT_EQ(Pack(Charts("blobs-1"), options).tiles, 1);
}

TEST(Pack, ScalesByDensity) {
  std::vector<PackChart> charts = Charts("blobs-6");
  charts[2].density = 3;
  const Packing packing = Pack(charts, {});
  EXPECT_NEAR(packing.charts[2].scale, 3 * packing.charts[0].scale, 1e-12);
}

TEST(Pack, FillsTheHoleOfARing) {
  std::vector<PackChart> charts = Charts("rings-2");                                        // a ring and a blob
  const double size = 0.4 * MakeOutline(charts[0]).radius / MakeOutline(charts[1]).radius;  // too large for the corners
  for (Vec2& p : charts[1].positions) p *= size;
  const Packing packing = Pack(charts, {});
  const Vec2 ring = packing.charts[0](Vec2::Zero()), blob = packing.charts[1](charts[1].positions[0]);
  EXPECT_LT((ring - blob).norm(), 0.4);
  EXPECT_GT(2 * MakeOutline(charts[0]).radius * packing.scale, 0.97) << "the ring alone decides on the scale";
}

TEST(Pack, MakesRoomWhereThePaddingCannotBeKept) {
  PackOptions options;
  options.texture_size = 32;
  options.padding = 4;
  const std::vector<PackChart> charts = Charts("equal-600");
  const Packing packing = Pack(charts, options);
  EXPECT_LT(packing.padding, 4);
  EXPECT_GT(packing.efficiency, 0.2);
  const std::vector<PlacedChart> placed = Place(charts, packing);
  EXPECT_GT(LeastDistance(placed, 1e-3), packing.padding / 32);
  EXPECT_GE(LeastFromRim(placed), 0);
}

TEST(Pack, PlacesWhatHasNoArea) {
  std::vector<PackChart> charts = Charts("blobs-3");
  charts.push_back({{Vec2(5, 5)}, {}, 1});                                         // a point
  charts.push_back({{}, {}, 1});                                                   // nothing
  charts.push_back({{Vec2(0, 0), Vec2(1, 1), Vec2(2, 2)}, {{0, 1, 2}}, 1});        // a segment
  charts.push_back({{Vec2(7, 7), Vec2(7, 7), Vec2(7, 7)}, {{0, 1, 2}}, 1});        // a point with a face
  charts.push_back({{Vec2(0, 0), Vec2(1e-9, 0), Vec2(0, 1e-9)}, {{0, 1, 2}}, 1});  // far below a texel
  charts.push_back({{Vec2(0, 0), Vec2(1, 0), Vec2(0, 1)}, {{0, 1, 2}, {0, 2, 1}, {0, 1, 2}}, 1});  // folded
  const Packing packing = Pack(charts, {});
  const std::vector<PlacedChart> placed = Place(charts, packing);
  EXPECT_GE(LeastFromRim(placed) * 1024, 1);
  EXPECT_GE(LeastDistance(placed, 3.0 / 1024) * 1024, 2);
  const auto& tiny = placed[7].triangles[0];
  EXPECT_EQ(Orientation(tiny[0], tiny[1], tiny[2]), 1) << "an area that floats can tell";
  for (const ChartPlacement& chart : packing.charts)
    EXPECT_TRUE(chart.offset.allFinite() && std::isfinite(chart.scale));
}

TEST(Pack, LeavesNothingUndoneForNothing) {
  const Packing packing = Pack({}, {});
  EXPECT_TRUE(packing.charts.empty());
  EXPECT_TRUE(Pack({PackChart{}}, {}).charts[0].offset.allFinite());
}

TEST(Pack, EndsSoonAfterAnInterrupt) {
  Interrupter interrupter;
  interrupter.Interrupt();
  Execution execution;
  execution.cancel = &interrupter;
  Pack(Charts("equal-1000"), {}, execution);
}

// Searches end, the promises stay: few charts, and so many that they go on shelves.
TEST(Pack, KeepsItsPromisesAfterAStopRequest) {
  for (const std::string name : {"blobs-1", "mixed-60", "needles-20", "blobs-400", "mixed-400"}) {
    SCOPED_TRACE(name);
    const std::vector<PackChart> charts = Charts(name);
    PackOptions options;
    options.texture_size = 2048;
    options.tiles = 2;
    Interrupter stop;
    stop.Interrupt();
    const Packing packing = Pack(charts, options, {nullptr, nullptr, &stop});
    ASSERT_EQ(packing.charts.size(), charts.size());
    EXPECT_EQ(packing.padding, options.padding);
    const std::vector<PlacedChart> placed = Place(charts, packing);
    EXPECT_GE(LeastDistance(placed, 3.0 / 2048) * 2048, options.padding);
    EXPECT_GE(LeastFromRim(placed) * 2048, 1);
    EXPECT_GT(packing.efficiency, name == "needles-20" ? 0.02 : 0.2);
  }
}

TEST(Shelves, HoldBoxesWithoutOverlap) {
  std::vector<Vec2> extents;
  for (int i = 0; i < 200; ++i) extents.emplace_back(0.02 + 0.001 * (i * 37 % 50), 0.02 + 0.001 * (i * 17 % 40));
  const std::vector<int> atlas(extents.size(), 0);
  EXPECT_TRUE(LayOnShelves(extents, atlas, {.tiles = 1}, 0.5).empty());
  EXPECT_TRUE(LayOnShelves({{0.6, 0.1}}, {0}, {.tiles = 9}, 0.5).empty());
  const std::vector<Shelf> shelves = LayOnShelves(extents, atlas, {.tiles = 2}, 0.7);
  ASSERT_EQ(shelves.size(), extents.size());
  for (std::size_t i = 0; i < shelves.size(); ++i) {
    const Vec2 high = shelves[i].low + extents[i];
    EXPECT_GE(shelves[i].low.minCoeff(), 0);
    EXPECT_LE(high.maxCoeff(), 0.7);
    EXPECT_LT(shelves[i].tile, 2);
    for (std::size_t j = 0; j < i; ++j) {
      if (shelves[i].tile != shelves[j].tile) continue;
      const Vec2 other = shelves[j].low + extents[j];
      EXPECT_TRUE(shelves[i].low.x() >= other.x() || shelves[j].low.x() >= high.x() ||
                  shelves[i].low.y() >= other.y() || shelves[j].low.y() >= high.y());
    }
  }
}

// Cells are compared with the definition: a cell belongs to the silhouette if it comes near enough to a face.
TEST(Silhouette, HasTheCellsThatComeNear) {
  const std::vector<PackChart> charts = Charts("mixed-12-3");
  for (const PackChart& chart : charts) {
    const Outline outline = MakeOutline(chart);
    const double scale = 20 / outline.radius, angle = 0.7, radius = 1.3;
    const Silhouette s = MakeSilhouette(outline, angle, scale, radius);
    std::vector<std::array<Vec2, 3>> triangles;
    for (const Face& face : chart.faces) {
      std::array<Vec2, 3> t;
      for (int k = 0; k < 3; ++k) {
        const Vec2 p = scale * (chart.positions[face[k]] - outline.centre);
        t[k] = s.centre + Vec2(std::cos(angle) * p.x() - std::sin(angle) * p.y(),
                               std::sin(angle) * p.x() + std::cos(angle) * p.y());
      }
      triangles.push_back(t);
    }
    for (int y = 0; y < s.height; ++y) {
      for (int x = 0; x < s.width; ++x) {
        const Vec2 a(x, y), b(x + 1, y), c(x + 1, y + 1), d(x, y + 1);
        double distance = std::numeric_limits<double>::infinity();
        for (const auto& t : triangles) {
          distance = std::min({distance, Distance({a, b, c}, t), Distance({a, c, d}, t)});
        }
        const bool within = std::any_of(s.spans.begin() + s.row_begin[y], s.spans.begin() + s.row_begin[y + 1],
                                        [&](const Span& span) { return x >= span.begin && x < span.end; });
        if (std::abs(distance - radius) > 1e-6) {
          ASSERT_EQ(within, distance < radius) << x << ", " << y;
        }
      }
    }
  }
}

TEST(Silhouette, TurnsByARightAngle) {
  for (const PackChart& chart : Charts("mixed-12-3")) {
    const Outline outline = MakeOutline(chart);
    const Silhouette s = MakeSilhouette(outline, 0.7, 20 / outline.radius, 1.3), turned = QuarterTurn(s);
    ASSERT_EQ(turned.width, s.height);
    ASSERT_EQ(turned.height, s.width);
    EXPECT_EQ(turned.cells, s.cells);
    const auto has = [](const Silhouette& of, int x, int y) {
      return std::any_of(of.spans.begin() + of.row_begin[y], of.spans.begin() + of.row_begin[y + 1],
                         [&](const Span& span) { return x >= span.begin && x < span.end; });
    };
    for (int y = 0; y < s.height; ++y) {
      for (int x = 0; x < s.width; ++x) ASSERT_EQ(has(s, x, y), has(turned, s.height - 1 - y, x)) << x << ", " << y;
    }
    EXPECT_NEAR(turned.centre.x() + s.centre.y(), s.height, 1e-12);
    EXPECT_NEAR(turned.centre.y(), s.centre.x(), 1e-12);
    const Silhouette half = HalfTurn(s), twice = QuarterTurn(turned);
    EXPECT_TRUE(half.HasSameCells(twice));
    EXPECT_EQ(half.cells, s.cells);
    EXPECT_EQ(half.height, s.height);
    EXPECT_NEAR((half.centre - twice.centre).norm(), 0, 1e-12);
    EXPECT_FALSE(half.HasSameCells(s) && half.HasSameCells(turned));
  }
}

// Against a look at every cell. Sides of less and more than four words of places, which are searched by other code.
TEST(Board, FindsTheSnuggestPlaceThatACellByCellSearchFinds) {
  testing::Dice dice(7);
  std::vector<Outline> outlines;
  for (const char* kind : {"blobs-8", "corners-8", "rings-4", "strips-6"}) {
    for (const PackChart& chart : Charts(kind)) outlines.push_back(MakeOutline(chart));
  }
  int searches = 0, in_vain = 0;
  for (const int side : {30, 70, 150, 330}) {
    Board board(side, side);
    std::int64_t work = 0;
    board.Clear(side, &work);
    const auto is_taken = [&](int x, int y) {
      return x < Board::kMargin || y < Board::kMargin || x >= Board::kMargin + side || y >= Board::kMargin + side ||
             board.IsTaken(x, y);
    };
    for (int k = 0; k < (side < 100 ? 80 : 12); ++k) {
      const Outline& outline = outlines[dice.Below(static_cast<int>(outlines.size()))];
      const Silhouette s = MakeSilhouette(outline, dice.In(0, 6), dice.In(2, 0.15 * side) / outline.radius, 1);
      const Rim rim = MakeRim(s, 24);
      const auto fits = [&](int x, int y) {
        for (int r = 0; r < s.height; ++r) {
          for (std::int32_t i = s.row_begin[r]; i < s.row_begin[r + 1]; ++i) {
            for (int c = s.spans[i].begin; c < s.spans[i].end; ++c) {
              if (x + c < 0 || y + r < 0 || is_taken(x + c, y + r)) return false;
            }
          }
        }
        return true;
      };
      const int first = Board::kMargin + dice.Below(side / 4), beyond = dice.Below(2) * s.height / 2;
      Spot expected, spot;
      int first_row = -1;
      for (int y = first; y <= Board::kMargin + side && (first_row < 0 || y - first_row <= beyond); ++y) {
        for (int x = 0; x < 2 * Board::kMargin + side; ++x) {
          if (!fits(x, y)) continue;
          if (first_row < 0) first_row = y;
          if ((fits(x - 1, y) && fits(x + 1, y)) || (y > first && fits(x, y - 1) && fits(x, y + 1))) continue;
          const auto taken = std::count_if(rim.cells.begin(), rim.cells.end(),
                                           [&](const Rim::Cell& cell) { return is_taken(x + cell.x, y + cell.y); });
          const double snugness = static_cast<double>(taken) / static_cast<double>(rim.cells.size());
          if (snugness > expected.snugness + 1e-12 ||
              (std::abs(snugness - expected.snugness) < 1e-12 && x + y < expected.x + expected.y)) {
            expected = {x, y, snugness};
          }
        }
      }
      const int row = board.FindSpot(s, rim, Probes(s), first, side + Board::kMargin, beyond, &spot, &work);
      ASSERT_EQ(row, first_row) << "side " << side << ", silhouette " << k;
      ++searches;
      in_vain += row < 0 ? 1 : 0;
      if (row < 0) continue;
      EXPECT_EQ(std::pair(spot.x, spot.y), std::pair(expected.x, expected.y))
          << "side " << side << ", silhouette " << k;
      EXPECT_NEAR(spot.snugness, expected.snugness, 1e-12);
      // Somewhere else now and then, so that rows have gaps.
      const bool moves = dice.OneIn(3);
      board.Add(s, spot.x - Board::kMargin + (moves ? dice.Below(5) : 0), spot.y - Board::kMargin, 0, &work);
    }
  }
  EXPECT_GT(searches - in_vain, 50);
  EXPECT_GT(in_vain, 10) << "full boards as well";
}

}  // namespace
}  // namespace planish
