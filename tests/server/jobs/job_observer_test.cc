// What those hear and see who watch a JobManager.
#include "gmock/gmock.h"
#include "gtest/gtest.h"
#include "tests/server/jobs/job_manager_fixture.h"

namespace planish {
namespace {

using ::testing::ElementsAre;

// Writes down what it hears.
class Notes : public JobObserver {
 public:
  void OnAccepted(const v1::Job& job, JobOrigin origin) override {
    const char* from = origin == JobOrigin::kOwnWork ? " own" : origin == JobOrigin::kSharedWork ? " shared" : " kept";
    heard.push_back("accepted " + job.name() + from);
  }
  void OnWorkEnded(const v1::Job& job, const worker::v1::WorkResult& result, absl::Duration duration) override {
    heard.push_back("ended " + job.name() + " " + std::to_string(result.status().code()) + " " +
                    absl::FormatDuration(duration));
  }
  void OnWorkLost(const v1::Job& job, const WorkerLoss& loss, int retried, absl::Duration duration) override {
    heard.push_back("lost " + job.name() + " " + loss.reason + " " + std::to_string(retried) + " " +
                    absl::FormatDuration(duration));
  }

  std::vector<std::string> heard;
};

class JobObserverTest : public JobManagerTest {
 protected:
  JobObserverTest() {
    options_.observer = &notes_;
    Restart();
    ids_ = 0;
  }
  ~JobObserverTest() override { manager_.reset(); }

  // Always with the same mesh.
  std::string CreateSame() {
    meshes_ = 0;
    return Create();
  }

  Notes notes_;
};

TEST_F(JobObserverTest, WorkIsToldOnceHoweverManyJobsShareIt) {
  const std::string first = CreateSame();
  const std::string second = CreateSame();
  EXPECT_EQ(Take(), first);
  now_ += absl::Seconds(5);
  Succeed(first);
  const std::string third = CreateSame();
  EXPECT_THAT(notes_.heard, ElementsAre("accepted " + first + " own", "accepted " + second + " shared",
                                        "ended " + first + " 0 5s", "accepted " + third + " kept"));
}

TEST_F(JobObserverTest, LossesSayHowManyJobsGoOn) {
  const std::string first = CreateSame();
  const std::string second = CreateSame();
  notes_.heard.clear();
  Take();
  now_ += absl::Seconds(2);
  Lose(first);
  for (int i = 0; i < 2; ++i) {
    Take();
    Lose(first);
  }
  EXPECT_EQ(State(second), v1::JOB_STATE_FAILED);
  EXPECT_THAT(notes_.heard,
              ElementsAre("lost " + first + " WORKER_CRASHED 2 2s", "lost " + first + " WORKER_CRASHED 2 0",
                          "lost " + first + " WORKER_CRASHED 0 0"));
}

}  // namespace
}  // namespace planish
