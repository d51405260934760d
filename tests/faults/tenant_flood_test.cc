#include "tests/faults/tenant_flood.h"

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
  options.flood = 300;
  options.both = 240;
  options.shares = {{"flood", 2.0}, {"single", 1.0}};
  const TenantFloodReport report = RunTenantFlood(options);
  const double ratio = report.flood_worker_seconds / report.other_worker_seconds;
  EXPECT_GT(ratio, 1.6) << report.flood_ended << " and " << report.other_ended << " jobs";
  EXPECT_LT(ratio, 2.5) << report.flood_ended << " and " << report.other_ended << " jobs";
}

}  // namespace
}  // namespace planish
