// SIGTERM while callers of the C++ library wait for their jobs.
#include <chrono>
#include <iostream>
#include <mutex>
#include <set>
#include <thread>
#include <vector>

#include "gmock/gmock.h"
#include "gtest/gtest.h"
#include "planish/client.h"
#include "tests/testing/daemon.h"
#include "tests/testing/files.h"
#include "tests/testing/meshes.h"

namespace planish {
namespace {

using ::testing::SizeIs;

constexpr int kJobs = 50;
constexpr double kGraceSeconds = 0.5;
// server/README.md, "Shutdown".
constexpr double kBoundSeconds = kGraceSeconds + 3;
// That a machine which is busy with other things may add: seconds of work take it minutes at times.
constexpr double kBusySeconds = 20;

// What one caller saw.
struct Seen {
  std::set<std::string> names;
  std::int64_t last_sequence = 0;
  bool ascending = true;
};

TEST(Shutdown, NoCallerNoticesThatTheServerWasRestartedUnderFiftyJobs) {
  const TempDir directory;
  DurableServer server(directory.Path("s"), {"--workers=2", "--threads=1", "--grace=" + std::to_string(kGraceSeconds),
                                             "--reattach-grace=120", "--memory-mb=4096"});
  const Mesh bump = Bump(60);
  std::vector<float> positions;
  for (const Vec3& p : bump.positions) {
    for (int c = 0; c < 3; ++c) positions.push_back(static_cast<float>(p[c]));
  }
  std::vector<std::int32_t> triangles;
  for (const Face& face : bump.faces) triangles.insert(triangles.end(), face.begin(), face.end());

  ClientOptions patient;
  patient.reattach_timeout = Seconds(120);
  Client client(server.target(), patient);
  std::mutex mutex;
  std::vector<Seen> seen(kJobs);
  CallOptions fresh;
  fresh.scheduling.fresh = true;
  std::vector<Call> calls;
  for (int i = 0; i < kJobs; ++i) {
    Callbacks callbacks;
    callbacks.on_event = [&mutex, &mine = seen[static_cast<std::size_t>(i)]](const Event& event) {
      const std::lock_guard lock(mutex);
      if (event.job) mine.names.insert(event.job->name);
      mine.ascending = mine.ascending && event.sequence > mine.last_sequence;
      mine.last_sequence = event.sequence;
    };
    calls.push_back(client.StartUnwrap(MeshView{positions, triangles}, {}, callbacks, fresh));
  }
  for (const Call& call : calls) {
    while (call.job().empty()) std::this_thread::sleep_for(std::chrono::milliseconds(1));
  }
  int waiting = 0;
  for (const Call& call : calls) waiting += call.WaitFor(Seconds(0)) ? 0 : 1;
  const double asked = Now();
  EXPECT_EQ(server.Terminate(), 0);
  const double seconds = Now() - asked;
  EXPECT_LT(seconds, kBoundSeconds + kBusySeconds);
  int left = 0;
  for (const Call& call : calls) left += call.WaitFor(Seconds(0)) ? 0 : 1;
  EXPECT_GT(left, 0) << "or nothing was tried";
  RecordProperty("seconds_to_exit", std::to_string(seconds));
  std::cout << waiting << " callers waited at SIGTERM, " << left << " when the server was gone, after " << seconds
            << " s; the bound is " << kBoundSeconds << " s on a machine with time for it\n";

  server.Start();
  std::set<std::string> names;
  for (std::size_t i = 0; i < calls.size(); ++i) {
    const UnwrapResult result = calls[i].Wait();
    EXPECT_EQ(result.uv.size(), 2 * triangles.size());
    EXPECT_THAT(seen[i].names, SizeIs(1)) << "the same job before and after";
    EXPECT_TRUE(seen[i].ascending);
    names.insert(result.job);
  }
  EXPECT_THAT(names, SizeIs(kJobs));
  const std::vector<Job> jobs = client.ListJobs(0);
  EXPECT_THAT(jobs, SizeIs(kJobs)) << "none was lost, and none came twice";
  for (const Job& job : jobs) {
    EXPECT_EQ(job.state, JobState::kSucceeded) << job.name;
    EXPECT_LE(job.attempts, 2) << job.name;
  }
}

}  // namespace
}  // namespace planish
