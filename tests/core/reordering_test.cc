// Meshes unwrapped in spatial order: what the caller hears is in the caller's numbers (core/unwrap/reordering.h).
#include "core/unwrap/reordering.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <string>
#include <utility>
#include <vector>

#include "core/base/error.h"
#include "core/base/radix_sort.h"
#include "core/unwrap/unwrap.h"
#include "gmock/gmock.h"
#include "gtest/gtest.h"
#include "tests/core/promises.h"
#include "tests/testing/dice.h"
#include "tests/testing/families.h"

namespace planish {
namespace {

using ::testing::ElementsAre;
using ::testing::IsEmpty;

constexpr std::int64_t kNever = std::numeric_limits<std::int64_t>::max();

// Any order but a spatial one.
Mesh Shuffled(const Mesh& mesh, std::uint64_t seed) {
  testing::Dice dice(seed);
  const auto shuffle = [&](std::vector<std::int32_t>* order) {
    for (std::size_t i = order->size(); i > 1; --i) {
      std::swap((*order)[i - 1], (*order)[dice.Below(static_cast<int>(i))]);
    }
  };
  std::vector<std::int32_t> vertex = Indices(mesh.positions.size()), face = Indices(mesh.faces.size());
  shuffle(&vertex);
  shuffle(&face);
  Mesh shuffled;
  shuffled.positions.resize(vertex.size());
  for (std::size_t v = 0; v < vertex.size(); ++v) shuffled.positions[vertex[v]] = mesh.positions[v];
  for (const std::int32_t f : face) {
    const auto& [a, b, c] = mesh.faces[f];
    shuffled.faces.push_back({vertex[a], vertex[b], vertex[c]});
  }
  return shuffled;
}

// A square of 2 n n triangles in shuffled order.
Mesh ShuffledSquare(int n, std::uint64_t seed) {
  Mesh square;
  for (std::int32_t j = 0; j <= n; ++j) {
    for (std::int32_t i = 0; i <= n; ++i) square.positions.emplace_back(i, j, 0);
  }
  for (std::int32_t j = 0; j < n; ++j) {
    for (std::int32_t i = 0; i < n; ++i) {
      const std::int32_t a = j * (n + 1) + i;
      square.faces.push_back({a, a + 1, a + n + 2});
      square.faces.push_back({a, a + n + 2, a + n + 1});
    }
  }
  return Shuffled(square, seed);
}

Vec3 CentreOf(const Mesh& mesh, std::size_t f) {
  const auto& [a, b, c] = mesh.faces[f];
  return (mesh.positions[a] + mesh.positions[b] + mesh.positions[c]) / 3;
}

UnwrapOptions InSpatialOrderAlways() {
  UnwrapOptions options;
  options.tuning.reordered_faces = 0;
  return options;
}

TEST(Reordering, KeepsThePromisesOfAnyMesh) {
  for (const std::string& family : testing::Families()) {
    for (std::uint64_t seed = 1; seed <= 2; ++seed) {
      const Mesh mesh = Shuffled(testing::MakeFamily(family, seed, 400), seed);
      const auto result = Unwrap(mesh, InSpatialOrderAlways(), {});
      EXPECT_THAT(testing::BrokenPromises(mesh, InSpatialOrderAlways(), result), IsEmpty()) << family << ' ' << seed;
    }
  }
}

TEST(Reordering, GivesEachFaceItsAtlasItsWeightAndItsChart) {
  const Mesh mesh = ShuffledSquare(12, 3);
  UnwrapOptions options = InSpatialOrderAlways();
  for (std::size_t f = 0; f < mesh.faces.size(); ++f) {
    options.face_atlas.push_back(CentreOf(mesh, f).x() < 6 ? 0 : 1);
    options.face_weights.push_back(CentreOf(mesh, f).y() < 6 ? 1.0F : 2.0F);
  }
  const auto result = Unwrap(mesh, options, {});
  ASSERT_TRUE(result.ok()) << result.status();
  EXPECT_THAT(testing::BrokenPromises(mesh, options, result), IsEmpty());
  std::map<float, double> area;
  for (std::size_t f = 0; f < mesh.faces.size(); ++f) {
    const double* uv = &result->uv[6 * f];
    EXPECT_EQ(static_cast<int>(std::floor(std::min({uv[0], uv[2], uv[4]}))), options.face_atlas[f]) << f;
    area[options.face_weights[f]] += (uv[2] - uv[0]) * (uv[5] - uv[1]) - (uv[4] - uv[0]) * (uv[3] - uv[1]);
  }
  EXPECT_NEAR(area[2] / area[1], 4, 1e-3);
  ASSERT_EQ(result->face_chart.size(), mesh.faces.size());
  for (std::size_t f = 0; f < mesh.faces.size(); ++f) {
    for (std::size_t g = 0; g < f; ++g) {
      const bool are_alike =
          options.face_atlas[f] == options.face_atlas[g] && options.face_weights[f] == options.face_weights[g];
      EXPECT_TRUE(are_alike || result->face_chart[f] != result->face_chart[g]) << f << ' ' << g;
    }
  }
}

TEST(Reordering, CutsAtTheGivenSeams) {
  const Mesh mesh = ShuffledSquare(10, 5);
  UnwrapOptions options = InSpatialOrderAlways();
  options.seams.policy = SeamPolicy::kKeep;
  std::vector<std::int32_t> left;
  for (std::int32_t f = 0; f < static_cast<std::int32_t>(mesh.faces.size()); ++f) {
    for (std::int32_t k = 0; k < 3; ++k) {
      const Vec3 &p = mesh.positions[mesh.faces[f][Next(k)]], &q = mesh.positions[mesh.faces[f][Prev(k)]];
      if (p.x() == 5 && q.x() == 5) options.seams.corners.push_back(3 * f + k);
    }
    if (CentreOf(mesh, f).x() < 5) left.push_back(f);
  }
  const auto result = Unwrap(mesh, options, {});
  ASSERT_TRUE(result.ok()) << result.status();
  ASSERT_EQ(result->charts.size(), 2u);
  std::vector<std::int32_t> with_the_first;
  for (std::int32_t f = 0; f < static_cast<std::int32_t>(mesh.faces.size()); ++f) {
    if (result->face_chart[f] == result->face_chart[left.front()]) with_the_first.push_back(f);
  }
  EXPECT_EQ(with_the_first, left);
}

TEST(Reordering, NamesTheCallersFaces) {
  Mesh mesh = ShuffledSquare(10, 7);
  const std::int32_t v = mesh.faces[0][0], other = mesh.faces[9][1];
  mesh.positions.push_back(mesh.positions[v]);
  mesh.faces.insert(mesh.faces.begin() + 20, {v, other, static_cast<std::int32_t>(mesh.positions.size()) - 1});
  mesh.faces.push_back({v, other, v});
  const auto result = Unwrap(mesh, InSpatialOrderAlways(), {});
  ASSERT_TRUE(result.ok()) << result.status();
  const auto warning = std::find_if(result->warnings.begin(), result->warnings.end(),
                                    [](const UnwrapWarning& w) { return w.reason == "FACES_WITHOUT_AREA"; });
  ASSERT_NE(warning, result->warnings.end());
  EXPECT_THAT(warning->faces, ElementsAre(20, 201));
  EXPECT_EQ(warning->metadata.at("faces"), "20,201");
}

// Errors are the same as without.
TEST(Reordering, RefusesInTheCallersNumbers) {
  Mesh not_finite = ShuffledSquare(10, 1), beyond = not_finite;
  not_finite.positions[17].y() = NAN;
  beyond.faces[33][2] = 1000;
  UnwrapOptions keep = InSpatialOrderAlways();
  keep.seams.policy = SeamPolicy::kKeep;
  Mesh closed = Shuffled(testing::MakeFamily("high_genus", 2, 600), 4);
  for (const auto& [mesh, options] : {std::pair(not_finite, InSpatialOrderAlways()),
                                      std::pair(beyond, InSpatialOrderAlways()), std::pair(closed, keep)}) {
    UnwrapOptions as_given = options;
    as_given.tuning.reordered_faces = kNever;
    const absl::Status status = Unwrap(mesh, options, {}).status();
    EXPECT_EQ(status.code(), absl::StatusCode::kInvalidArgument);
    EXPECT_EQ(status, Unwrap(mesh, as_given, {}).status());
    EXPECT_FALSE(ErrorInfoOf(status).metadata.empty());
  }
}

}  // namespace
}  // namespace planish
