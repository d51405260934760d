#include "tests/faults/tenant_flood.h"

#include <algorithm>
#include <string>
#include <vector>

#include "absl/strings/str_cat.h"
#include "gmock/gmock.h"
#include "gtest/gtest.h"

namespace planish {
namespace {

using ::testing::Each;
using ::testing::SizeIs;

TEST(TenantFlood, DelaysAnothersSingleJobByNoMoreThanTheJobsThatRun) {
  const TenantFloodReport report = RunTenantFlood({});
  ASSERT_THAT(report.overtaken_by, SizeIs(20));
  EXPECT_THAT(report.overtaken_by, Each(0)) << "whatever the machine is busy with: no job of the flood began meanwhile";
}

TEST(TenantFlood, SharesOfTheWorkersAreKept) {
  TenantFloodOptions options;
  options.flood = 600;
  options.both = 240;
  options.shares = {{"flood", 2.0}, {"single", 1.0}};
  // A machine that is busy for a moment makes single jobs many times as long, so one run in some may be off: the
  // median.
  std::vector<double> ratios;
  std::string runs;
  for (int i = 0; i < 3; ++i) {
    const TenantFloodReport report = RunTenantFlood(options);
    ratios.push_back(report.flood_worker_seconds / report.other_worker_seconds);
    runs += absl::StrCat(report.flood_ended, " and ", report.other_ended, " jobs, ", ratios.back(), "; ");
  }
  std::sort(ratios.begin(), ratios.end());
  EXPECT_GT(ratios[1], 1.6) << runs;
  EXPECT_LT(ratios[1], 2.5) << runs;
}

}  // namespace
}  // namespace planish
