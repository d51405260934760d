// --seams=needed takes bounded work, tells of its progress, ends when it is asked to, and warns of much stretch.
#include <algorithm>
#include <cstdint>
#include <ctime>
#include <string>
#include <utility>
#include <vector>

#include "core/base/error.h"
#include "core/unwrap/unwrap.h"
#include "gmock/gmock.h"
#include "gtest/gtest.h"
#include "tests/core/shapes.h"
#include "tests/testing/families.h"

namespace planish {
namespace {

struct TimedUnwrap {
  double seconds;
  absl::StatusOr<UnwrapResult> result;
};

TimedUnwrap Timed(const Mesh& mesh, SeamPolicy policy) {
  UnwrapOptions options;
  options.seams.policy = policy;
  const std::clock_t begin = std::clock();
  absl::StatusOr<UnwrapResult> result = Unwrap(mesh, options, {});
  return {static_cast<double>(std::clock() - begin) / CLOCKS_PER_SEC, std::move(result)};
}

// What warnings about stretch lack.
std::string SilenceAboutStretch(const UnwrapResult& result) {
  std::int64_t count = 0;
  double most = 0;
  int worst = -1;
  for (std::size_t i = 0; i < result.charts.size(); ++i) {
    if (!(result.charts[i].stretch_l2 > 2)) continue;
    ++count;
    if (result.charts[i].stretch_l2 > most) most = result.charts[i].stretch_l2, worst = static_cast<int>(i);
  }
  for (const UnwrapWarning& warning : result.warnings) {
    if (warning.reason != "STRETCH_HIGH") continue;
    if (std::stoll(warning.metadata.at("chart_count")) < count) return "too few charts";
    if (std::stod(warning.metadata.at("stretch")) < most * 0.999) return "less stretch than there is";
    if (count > 0 && warning.message.find("chart " + std::to_string(worst) + " by ") == std::string::npos) {
      return "the worst chart is not named";
    }
    if (warning.message.find("--seams=auto") == std::string::npos) return "no remedy";
    return warning.faces.empty() ? "no face" : "";
  }
  return count > 0 || result.quality.stretch_l2 > 2 ? "no warning" : "";
}

// Closed pieces, of which each is slit somewhere, and many of whose slit maps have holes to fill, or collapse. Before
// solves had a limit these took 25, 23, 17, 15, 14 and 14 times as long as with SeamPolicy::kAuto.
TEST(GivenSeams, TakeBoundedWork) {
  double of_needed = 0, of_auto = 0;
  for (const char* const family :
       {"dual_contouring", "marching_cubes", "copies", "decimated", "uneven", "surface_nets"}) {
    const Mesh mesh = testing::MakeFamily(family, 1, 1500);
    const TimedUnwrap needed = Timed(mesh, SeamPolicy::kNeeded), by_stretch = Timed(mesh, SeamPolicy::kAuto);
    ASSERT_TRUE(needed.result.ok() && by_stretch.result.ok()) << family;
    of_needed += needed.seconds;
    of_auto += by_stretch.seconds;
    EXPECT_EQ(SilenceAboutStretch(*needed.result), "") << family;
    EXPECT_EQ(needed.result->quality.flipped + needed.result->quality.overlapping, 0) << family;
  }
  EXPECT_LT(of_needed, 8 * of_auto);
}

TEST(GivenSeams, OfAllFamiliesWarnOfStretch) {
  for (const std::string& family : testing::Families()) {
    const Mesh mesh = testing::MakeFamily(family, 2, 200);
    for (const SeamPolicy policy : {SeamPolicy::kNeeded, SeamPolicy::kKeep}) {
      const TimedUnwrap run = Timed(mesh, policy);
      if (run.result.ok()) {
        EXPECT_EQ(SilenceAboutStretch(*run.result), "") << family;
      }
    }
  }
}

TEST(GivenSeams, OfADiscWarnOfStretchToo) {
  const TimedUnwrap run = Timed(testing::PuncturedSphere(16, 0.02), SeamPolicy::kNone);
  ASSERT_TRUE(run.result.ok()) << run.result.status();
  ASSERT_GT(run.result->charts[0].stretch_l2, 2);
  EXPECT_EQ(SilenceAboutStretch(*run.result), "");
}

// Newton's steps for other maps than the first one of a chart come with the stage of layout.
TEST(GivenSeams, TellOfProgressAndEndWhenStoppedWhileOtherMapsAreTried) {
  const Mesh mesh = testing::MakeFamily("dual_contouring", 1, 500);
  UnwrapOptions options;
  options.seams.policy = SeamPolicy::kNeeded;
  Interrupter stop;
  bool may_stop = false;
  int steps = 0, steps_after_stop = 0;
  UnwrapControl control;
  control.stop = &stop;
  control.on_progress = [&](const UnwrapProgress& progress) {
    if (progress.stage != UnwrapStage::kLayout || progress.flatten.linear_residual > 0) return;
    ++steps;
    steps_after_stop += stop.IsInterrupted();
    if (may_stop && progress.flatten.newton_iteration > 2) stop.Interrupt();
  };
  ASSERT_TRUE(Unwrap(mesh, options, control).ok());
  EXPECT_GT(steps, 20);
  may_stop = true;
  const auto result = Unwrap(mesh, options, control);
  EXPECT_TRUE(stop.IsInterrupted());
  if (result.ok()) {
    EXPECT_THAT(result->warnings, ::testing::Contains(::testing::Field(&UnwrapWarning::reason, "STOPPED")));
  } else {
    EXPECT_EQ(ErrorInfoOf(result.status()).reason, "STOPPED_EARLY");
  }
  EXPECT_LT(steps_after_stop, 25) << "no other map is begun";
}

}  // namespace
}  // namespace planish
