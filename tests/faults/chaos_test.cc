#include "tests/faults/chaos.h"

#include "gmock/gmock.h"
#include "gtest/gtest.h"
#include "tests/testing/files.h"

namespace planish {
namespace {

// A small one; tests/bench/run.sh soak runs the large one.
TEST(Chaos, EveryAcceptedJobEnds) {
  const TempDir directory;
  DurableServer server(directory.Path("s"), {"--workers=2", "--threads=1", "--queue=20"});
  ChaosOptions options;
  options.jobs = 150;
  options.largest_grid = 60;
  options.kills = 20;
  options.kill_pause_seconds = 0.2;
  const ChaosReport report = RunChaos(options, server);
  EXPECT_THAT(report.wrong, ::testing::IsEmpty()) << server.Log();
  EXPECT_GE(report.server_kills + report.worker_kills, 3);
  RecordProperty("kills", report.server_kills + report.worker_kills);
  EXPECT_GT(report.ends.at("SUCCEEDED"), options.jobs / 2);
}

}  // namespace
}  // namespace planish
