#include "core/unwrap/estimate.h"

#include <cmath>
#include <limits>

#include "gtest/gtest.h"

namespace planish {
namespace {

UnwrapOptions WithSeams(SeamPolicy policy) {
  UnwrapOptions options;
  options.seams.policy = policy;
  return options;
}

TEST(Estimate, GrowsWithTheMesh) {
  for (const SeamPolicy policy : {SeamPolicy::kNone, SeamPolicy::kKeep, SeamPolicy::kNeeded, SeamPolicy::kAuto}) {
    Estimate last = EstimateUnwrap(0, 0, 0, WithSeams(policy));
    EXPECT_GT(last.peak_bytes, 0);
    for (std::int64_t faces = 1; faces < 1'000'000'000; faces *= 3) {
      const Estimate estimate = EstimateUnwrap(faces, faces / 2 + 2, 8 * faces, WithSeams(policy));
      EXPECT_GT(estimate.peak_bytes, last.peak_bytes);
      EXPECT_GT(estimate.seconds, last.seconds);
      last = estimate;
    }
  }
}

// Of planish_hunt: 98,560 triangles on 32,853 random vertices, 139 MB; nets of 60,000 with edges of many
// faces, 41 MB; 136,951 triangles by themselves, 206 MB. A job that takes more than the estimate is run again.
TEST(Estimate, HasRoomForLooseTrianglesAndNotMuchMoreThanNetsTake) {
  const UnwrapOptions options = WithSeams(SeamPolicy::kAuto);
  EXPECT_GT(EstimateUnwrap(98'560, 32'853, 788'480, options).peak_bytes, 140'000'000);
  EXPECT_GT(EstimateUnwrap(136'951, 410'853, 1'095'608, options).peak_bytes, 210'000'000);
  EXPECT_LT(EstimateUnwrap(60'100, 19'769, 480'800, options).peak_bytes, 3 * 40'000'000);
}

// Of results/memory.md: koala, 99,994 triangles, 57 MB and 1.1 to 2 s; a disc of a million, 790 MB.
TEST(Estimate, IsAboveWhatWasMeasuredButNotFar) {
  const Estimate koala = EstimateUnwrap(99'994, 49'999, 840'000, WithSeams(SeamPolicy::kAuto));
  EXPECT_GT(koala.peak_bytes, 70'000'000);
  EXPECT_LT(koala.peak_bytes, 171'000'000);
  EXPECT_GT(koala.seconds, 0.6);
  EXPECT_LT(koala.seconds, 5.4);
  const Estimate foot = EstimateUnwrap(1'000'000, 501'000, 8'700'000, WithSeams(SeamPolicy::kNone));
  EXPECT_GT(foot.peak_bytes, 790'000'000);
  EXPECT_LT(foot.peak_bytes, 1'580'000'000);
}

TEST(Estimate, KnowsWhatCostsMore) {
  const auto of = [](const UnwrapOptions& options, std::int64_t vertices = 50'002) {
    return EstimateUnwrap(100'000, vertices, 800'000, options);
  };
  const Estimate plain = of({});
  UnwrapOptions direct;
  direct.flatten.solver = SolverType::kDirect;
  EXPECT_GT(of(direct).peak_bytes, 1.2 * static_cast<double>(plain.peak_bytes));
  UnwrapOptions convex;
  convex.flatten.boundary = BoundaryType::kConvex;
  EXPECT_GT(of(convex).seconds, plain.seconds);
  UnwrapOptions as_in_the_paper;
  as_in_the_paper.flatten.system = SystemType::kFull;
  EXPECT_GT(of(as_in_the_paper).seconds, 10 * plain.seconds);
  UnwrapOptions threads;
  threads.threads = 8;
  EXPECT_GT(of(threads).peak_bytes, plain.peak_bytes);
  // Triangles that share no vertices make a chart each, with more vertices than the triangles of a soup.
  EXPECT_GT(of({}, 300'000).peak_bytes, 1.1 * static_cast<double>(plain.peak_bytes));
  EXPECT_GT(of({}, 300'000).seconds, 1.5 * plain.seconds);
  // Few vertices say nothing: of a soup, or of a net with edges of many faces.
  EXPECT_LE(of({}, 30'000).peak_bytes, plain.peak_bytes);
  UnwrapOptions many_tiles;
  many_tiles.atlas.tiles = 100;
  EXPECT_GT(of(many_tiles).peak_bytes, plain.peak_bytes);
  UnwrapOptions best;
  best.atlas.effort = PackEffort::kBest;
  EXPECT_GT(of(best).peak_bytes, plain.peak_bytes);
}

// However small a mesh is, the packer has work for each of a few charts. Neither three charts nor many take more than
// three times the estimate, or less than a third of it.
TEST(Estimate, SmallMeshesArePackedToo) {
  UnwrapOptions options;
  options.seams.prefer = SeamPreference::kTexture;  // the search for seams takes longer than packing
  const PackTuning& tuning = options.atlas.tuning;
  const double packed = EstimateUnwrap(200, 102, 1600, options).seconds;
  options.pack = false;
  const double rest = EstimateUnwrap(200, 102, 1600, options).seconds;
  EXPECT_LT(rest, packed / 2);
  EXPECT_GT(rest + 1e-9 * 3 * tuning.least_per_few, packed / 3);
  EXPECT_LT(rest + 1e-9 * tuning.least_work, packed * 3);
}

TEST(Estimate, HugeNumbersDoNotOverflow) {
  constexpr auto kLargest = std::numeric_limits<std::int64_t>::max();
  const Estimate estimate = EstimateUnwrap(kLargest, kLargest, kLargest, {});
  EXPECT_EQ(estimate.peak_bytes, kLargest);
  EXPECT_TRUE(std::isfinite(estimate.seconds));
}

}  // namespace
}  // namespace planish
