// Unwrap() keeps its promises on meshes that nobody has seen: random members of families (tests/testing/families.h).
// planish_hunt (tests/bench) tries as many as there is time for.
#include "tests/testing/families.h"

#include <algorithm>
#include <cstdint>
#include <ctime>
#include <initializer_list>
#include <map>
#include <set>
#include <string>
#include <tuple>

#include "core/base/sanitizers.h"
#include "core/unwrap/unwrap.h"
#include "gmock/gmock.h"
#include "gtest/gtest.h"
#include "tests/core/promises.h"
#include "tests/testing/isosurfaces.h"

namespace planish {
namespace {

using ::testing::IsEmpty;

std::vector<std::string> BrokenOf(const std::string& family, std::uint64_t seed, int faces,
                                  Precision precision = Precision::kAuto) {
  const Mesh mesh = testing::MakeFamily(family, seed, faces);
  if (mesh.faces.empty()) return {};
  UnwrapOptions options;
  options.precision = precision;
  return testing::BrokenPromises(mesh, options, Unwrap(mesh, options, {}));
}

class Family : public ::testing::TestWithParam<std::string> {};

TEST_P(Family, KeepsItsPromises) {
  for (std::uint64_t seed = 1; seed <= (kSanitized ? 10 : 20); ++seed) {
    const Precision precision = seed % 2 == 0 ? Precision::kFloat : Precision::kAuto;
    EXPECT_THAT(BrokenOf(GetParam(), seed, 300, precision), IsEmpty()) << seed;
  }
}

TEST_P(Family, IsTheSameForASeed) {
  const Mesh one = testing::MakeFamily(GetParam(), 3, 300), again = testing::MakeFamily(GetParam(), 3, 300);
  EXPECT_EQ(one.positions, again.positions);
  EXPECT_EQ(one.faces, again.faces);
  EXPECT_NE(one.positions, testing::MakeFamily(GetParam(), 4, 300).positions);
}

INSTANTIATE_TEST_SUITE_P(All, Family, ::testing::ValuesIn(testing::Families()),
                         [](const auto& instance) { return instance.param; });

// What planish_hunt found: charts whose outline touches itself at a T-junction, which rounding to float turns into an
// overlap; and small charts that are stretched far beyond the limit.
TEST(FamilyRegression, KeepsItsPromises) {
  for (const auto& [family, seed] : std::multimap<std::string, std::uint64_t>{{"assembly", 1},
                                                                              {"assembly", 5},
                                                                              {"assembly", 18},
                                                                              {"dual_contouring", 6},
                                                                              {"surface_nets", 10},
                                                                              {"skirts", 1}}) {
    EXPECT_THAT(BrokenOf(family, seed, 800), IsEmpty()) << family << ' ' << seed;
  }
}

// More of what planish_hunt found, by family, seed, triangles and type, as it prints them.
struct Found {
  const char* family;
  std::uint64_t seed;
  int faces;
  Precision precision;
};

void ExpectPromisesKept(std::initializer_list<Found> cases) {
  for (const auto& [family, seed, faces, precision] : cases) {
    EXPECT_THAT(BrokenOf(family, seed, faces, precision), IsEmpty()) << family << ' ' << seed;
  }
}

TEST(FamilyRegression, KeepsItsPromisesAsFloat) {
  ExpectPromisesKept({
      // Faces that were still without area after as many widenings as there may be.
      Found{"slivers", 32, 2500, Precision::kFloat},
      // Three faces of 1e-6 beside widened ones were drawn twice as long as wide, and not named.
      Found{"cut_up", 970063, 7405, Precision::kFloat},
      // Faces that the map squashed were named as widened when their chart was enlarged.
      Found{"uneven", 970264, 1035, Precision::kFloat},
      // With angles raised further in each round than in the last a chart was stretched 1.0725 times.
      Found{"winding", 980030, 6719, Precision::kFloat},
  });
}

// Charts that kept the limit as a whole, but not without the faces that the report names as too thin for the type.
TEST(FamilyRegression, KeepsTheLimitOfStretchAsDelivered) {
  ExpectPromisesKept({
      Found{"ribbons", 980177, 735, Precision::kAuto},
      Found{"slivers", 990317, 838, Precision::kFloat},
      Found{"uneven", 990157, 3642, Precision::kFloat},
  });
}

TEST(FamilyRegression, KeepsItsPromisesOnFineMeshes) {
  ExpectPromisesKept({
      // Faces that the map squashes were named as widened.
      Found{"ear_clipped", 600162, 5038, Precision::kAuto},
      Found{"sparse_nets", 200108, 6041, Precision::kAuto},
      // A chart of 1e-16 of the area stayed stretched 442 times: its parts hung together nowhere.
      Found{"uneven", 320017, 4812, Precision::kAuto},
  });
}

// Needles that rounding collapses, or does not, wherever the packer puts them: the charts were widened ten times over,
// and packed at full effort each time.
TEST(FamilyRegression, ChartsThatAreWidenedArePackedByDrafts) {
  const auto seconds = [](const Mesh& mesh) {
    double least = 1e9;
    for (int i = 0; i < 2; ++i) {
      const std::clock_t start = std::clock();
      EXPECT_TRUE(Unwrap(mesh, {}, {}).ok());
      least = std::min(least, static_cast<double>(std::clock() - start) / CLOCKS_PER_SEC);
    }
    return least;
  };
  EXPECT_THAT(BrokenOf("turned", 600462, 5310), IsEmpty());
  const Mesh needles = testing::MakeFamily("turned", 600462, 5310), clean = testing::MakeFamily("spikes", 1, 5310);
  ASSERT_GT(clean.num_faces(), needles.num_faces() / 2);
  EXPECT_LT(seconds(needles),
            4 * seconds(clean) * static_cast<double>(needles.num_faces()) / static_cast<double>(clean.num_faces()));
}

// No cut makes a face shorter. Of 6,348 needles longer than the texture each was a chart, for four times the memory
// that was estimated.
TEST(FamilyRegression, FacesLongerThanTheTextureAreNotCutApart) {
  for (const auto& [family, seed, faces, precision] :
       {Found{"scaled", 970080, 6485, Precision::kFloat}, Found{"ribbons", 960051, 3401, Precision::kFloat}}) {
    const Mesh mesh = testing::MakeFamily(family, seed, faces);
    UnwrapOptions options;
    options.precision = precision;
    const auto result = Unwrap(mesh, options, {});
    EXPECT_THAT(testing::BrokenPromises(mesh, options, result), IsEmpty()) << family;
    ASSERT_TRUE(result.ok()) << result.status();
    EXPECT_LT(4 * result->charts.size(), mesh.faces.size()) << family;
  }
}

// Outlines that touch themselves overlap in float where the packer happens to put some of them. Charts were cut for
// that and all packed again, each of these meshes three times and one of 23,064 faces nine times.
TEST(FamilyRegression, ChartsWhosePlaceIsAtFaultAreMovedByAHair) {
  int packings = 0;
  for (const std::uint64_t seed : {31, 46, 79, 93}) {
    const Mesh mesh = testing::MakeFamily("offset", seed, 9000);
    UnwrapStage stage = UnwrapStage::kCharts;
    UnwrapControl control;
    control.on_progress = [&](const UnwrapProgress& progress) {
      packings += progress.stage == UnwrapStage::kPack && stage != UnwrapStage::kPack ? 1 : 0;
      stage = progress.stage;
    };
    const auto result = Unwrap(mesh, {}, control);
    EXPECT_THAT(testing::BrokenPromises(mesh, {}, result), IsEmpty()) << seed;
  }
  EXPECT_LE(packings, 6);
}

// The judge sees what is wrong: a map that lies on itself, a flipped triangle.
TEST(BrokenPromises, AreSeen) {
  const Mesh mesh = testing::MakeFamily("pages", 1, 100);
  const UnwrapOptions options;
  auto result = Unwrap(mesh, options, {});
  ASSERT_TRUE(result.ok()) << result.status();
  ASSERT_THAT(testing::BrokenPromises(mesh, options, result), IsEmpty());
  auto overlapping = *result;
  for (int i = 0; i < 6; ++i) overlapping.uv[i] = result->uv[6 + i];
  EXPECT_EQ(testing::BrokenPromises(mesh, options, overlapping).size(), 2u) << "and the report does not say so";
  auto flipped = *result;
  std::swap(flipped.uv[0], flipped.uv[2]);
  std::swap(flipped.uv[1], flipped.uv[3]);
  EXPECT_GE(testing::BrokenPromises(mesh, options, flipped).size(), 2u);
  auto stretched = *result;
  for (std::size_t i = 0; i < stretched.uv.size(); i += 2) stretched.uv[i] /= 3;
  EXPECT_EQ(testing::BrokenPromises(mesh, options, stretched).size(), 2u) << "and have another density";
  auto widened = *result;
  widened.widened = {0};
  EXPECT_EQ(testing::BrokenPromises(mesh, options, widened).size(), 1u) << "a face that is thick enough";
}

// Limits are reached in steps (AtlasTuning::first_stretch). Without steps this member of high_genus has 28 charts
// at 1.1 and 41 at 1.2, that of assembly 131 at 1.2 and 157 at 1.3.
TEST(FamilyRegression, MoreStretchMakesNoMoreCharts) {
  for (const auto& [family, seed] : std::multimap<std::string, std::uint64_t>{
           {"high_genus", 4}, {"assembly", 3}, {"spikes", 2}, {"quantized", 3}, {"surface_nets", 3}}) {
    const Mesh mesh = testing::MakeFamily(family, seed, 2500);
    double fewest = static_cast<double>(mesh.num_faces());
    for (const double limit : {1.05, 1.1, 1.2, 1.3, 1.5, 2.0}) {
      UnwrapOptions options;
      options.seams.max_stretch = limit;
      const auto result = Unwrap(mesh, options, {});
      ASSERT_TRUE(result.ok()) << result.status();
      const auto charts = static_cast<double>(result->charts.size());
      EXPECT_LE(charts, 1.05 * fewest) << family << " " << seed << " at " << limit;
      fewest = std::min(fewest, charts);
    }
  }
}

// Of a ball every way of contouring makes a closed surface: each edge has two faces, in opposite senses.
TEST(Isosurface, IsClosed) {
  for (const testing::Contouring contouring :
       {testing::Contouring::kSurfaceNets, testing::Contouring::kDualContouring, testing::Contouring::kMarchingCubes}) {
    const Mesh ball = testing::Isosurface([](const Vec3& p) { return p.norm() - 0.7; }, 12, contouring);
    ASSERT_GT(ball.num_faces(), 100);
    std::map<std::pair<std::int32_t, std::int32_t>, int> edges;
    for (const Face& face : ball.faces) {
      for (int k = 0; k < 3; ++k) ++edges[{face[k], face[Next(k)]}];
    }
    for (const auto& [edge, count] : edges) {
      EXPECT_EQ(count, 1);
      EXPECT_TRUE(edges.contains({edge.second, edge.first}));
    }
    EXPECT_EQ(ball.num_vertices() - std::ssize(edges) / 2 + ball.num_faces(), 2) << "Euler's characteristic";
  }
}

}  // namespace
}  // namespace planish
