#include "tests/faults/mutations.h"

#include <sys/resource.h>

#include <algorithm>
#include <cstdlib>
#include <iostream>

#include "core/base/sanitizers.h"
#include "gmock/gmock.h"
#include "gtest/gtest.h"
#include "tests/testing/files.h"

namespace planish {
namespace {

// Of this process and of each that it starts: whatever a damaged mesh makes a server do, the machine goes on.
constexpr rlim_t kMostData = kSanitized ? RLIM_INFINITY : rlim_t{6} << 30;

int NumInputs() {
  const char* const text = std::getenv("PLANISH_FAULT_MUTATIONS");
  return text == nullptr ? MutationOptions().inputs : std::atoi(text);
}

void PrintCounts(const std::map<std::string, int>& counts) {
  for (const auto& [what, count] : counts) std::cout << "  " << count << "  " << what << "\n";
}

void Print(const MutationReport& report) {
  std::cout << report.sent << " inputs in " << report.seconds << " s, " << report.sent / report.seconds
            << " a second; server at the end: " << report.resident_bytes / (1 << 20) << " MiB, descriptors "
            << report.descriptors_before << " before, " << report.descriptors_after << " after\n"
            << report.accepted << " jobs:\n";
  PrintCounts(report.ends);
  std::cout << "other answers (gRPC code, reason):\n";
  PrintCounts(report.refused);
}

// 300 inputs, or PLANISH_FAULT_MUTATIONS; tests/bench/run.sh mutations runs 100,000.
TEST(Mutations, ServerLivesAndEveryAcceptedJobEnds) {
  rlimit limit = {};
  getrlimit(RLIMIT_DATA, &limit);
  limit.rlim_cur = std::min(limit.rlim_cur, kMostData);
  setrlimit(RLIMIT_DATA, &limit);
  MutationOptions options;
  options.inputs = NumInputs();
  const TempDir directory;
  // A damaged mesh, or options far from the usual, may keep a worker busy for long: 18 s at most.
  DurableServer server(directory.Path("s"), {"--workers=2", "--threads=1", "--memory-mb=2048", "--job-hours=0.005",
                                             "--log-level=error", "--retain-records-mb=100000"});
  const MutationReport report = RunMutations(options, server);
  Print(report);
  EXPECT_THAT(report.wrong, ::testing::IsEmpty()) << server.Log();
  EXPECT_EQ(report.sent, options.inputs);
  int ended = 0;
  for (const auto& [end, count] : report.ends) ended += count;
  EXPECT_EQ(ended, report.accepted);
  EXPECT_GT(report.accepted, options.inputs / 20) << "the damage is too heavy to test workers";
  EXPECT_GT(report.sent - report.accepted, options.inputs / 20) << "the damage is too light to test the server";
}

}  // namespace
}  // namespace planish
