// Jobs of the same mesh and options share work and results.
#include <functional>

#include "gmock/gmock.h"
#include "gtest/gtest.h"
#include "server/link/mesh_elements.h"
#include "tests/server/jobs/job_manager_fixture.h"

namespace planish {
namespace {

using ::testing::SizeIs;

class JobSharingTest : public JobManagerTest {
 protected:
  JobRequest Same() {
    JobRequest request = Request();
    request.bytes = "the same mesh";
    return request;
  }

  std::string CreateSame(const std::function<void(JobRequest*)>& change = [](JobRequest*) {}) {
    JobRequest request = Same();
    change(&request);
    const auto accepted = manager_->Create(caller_, std::move(request));
    EXPECT_TRUE(accepted.ok()) << accepted.status();
    return accepted->job.name();
  }
};

TEST_F(JobSharingTest, OneResultForAll) {
  const std::string first = CreateSame();
  const std::string second = CreateSame([](JobRequest* request) { request->options.set_threads(2); });
  EXPECT_EQ(Take(), first);
  EXPECT_EQ(State(second), v1::JOB_STATE_RUNNING);
  const std::string third = CreateSame();
  EXPECT_EQ(State(third), v1::JOB_STATE_RUNNING);
  manager_->source()->ReportProgress(first, attempt_, Iteration(1));
  Succeed(first, "result");
  for (const std::string& name : {first, second, third}) {
    EXPECT_EQ(State(name), v1::JOB_STATE_SUCCEEDED);
    EXPECT_EQ(Watch(name)->uv()->ReadAll().value(), "result");
    EXPECT_EQ(manager_->Get(caller_, name)->result_of(), name == first ? "" : first);
    EXPECT_THAT(Events(name), SizeIs(4));
  }
  const std::string late = CreateSame();
  EXPECT_EQ(State(late), v1::JOB_STATE_SUCCEEDED);
  EXPECT_EQ(manager_->Get(caller_, late)->result_of(), first);
  EXPECT_TRUE(manager_->Get(caller_, late)->has_report());
  EXPECT_THAT(Events(late), SizeIs(2));
  EXPECT_EQ(Watch(late)->uv()->ReadAll().value(), "result");
}

TEST_F(JobSharingTest, OtherOptionsSeamsOrFailpointsAreOtherWork) {
  options_.limits.queue_capacity = 20;
  Restart();
  CreateSame();
  const auto joins = [this](const std::function<void(JobRequest*)>& change) {
    return !manager_->Get(caller_, CreateSame(change))->result_of().empty();
  };
  EXPECT_TRUE(joins([](JobRequest*) {}));
  EXPECT_FALSE(joins([](JobRequest* request) { request->options.set_tolerance(1e-6); }));
  EXPECT_FALSE(joins([](JobRequest* request) { request->elements.set_seam_corners(std::string("\1\0\0\0", 4)); }));
  EXPECT_FALSE(joins([](JobRequest* request) { request->elements.set_uncut_corners(std::string("\1\0\0\0", 4)); }));
  EXPECT_FALSE(joins([](JobRequest* request) { request->elements.set_face_polygon(std::string(4, '\0')); }));
  EXPECT_FALSE(joins([](JobRequest* request) { request->elements.set_face_atlas(std::string("\1\0\0\0", 4)); }));
  EXPECT_FALSE(joins([](JobRequest* request) { request->elements.set_face_weights(PackNumbers<float>(std::vector{1.0F})); }));
  EXPECT_FALSE(joins([](JobRequest* request) { request->options.set_atlas_layout(v1::ATLAS_LAYOUT_STACKED); }));
  EXPECT_FALSE(joins([](JobRequest* request) { request->failpoint = "solve=abort"; }));
  EXPECT_FALSE(joins([](JobRequest* request) { request->scheduling.set_fresh(true); }));
}

TEST_F(JobSharingTest, SharingNeedsNoPlaceInTheQueue) {
  options_.limits.queue_capacity = 0;
  Restart();
  CreateSame();
  EXPECT_EQ(Reason(manager_->Create(caller_, Request()).status()), "QUEUE_FULL");
  CreateSame();
}

TEST_F(JobSharingTest, CancellingOneLeavesTheOthers) {
  const std::string first = CreateSame();
  const std::string second = CreateSame();
  EXPECT_EQ(Take(), first);
  const auto link = std::make_shared<NotingLink>();
  manager_->source()->SetLink(first, attempt_, link);
  EXPECT_EQ(manager_->Cancel(caller_, first)->state(), v1::JOB_STATE_CANCELLED);
  EXPECT_THAT(link->sent, SizeIs(0));
  Succeed(first);
  EXPECT_EQ(State(second), v1::JOB_STATE_SUCCEEDED);
  EXPECT_EQ(State(first), v1::JOB_STATE_CANCELLED);
}

TEST_F(JobSharingTest, CancellingTheFirstThatWaitsLeavesTheOthersInTheQueue) {
  const std::string first = CreateSame();
  const std::string second = CreateSame();
  manager_->Cancel(caller_, first).IgnoreError();
  EXPECT_EQ(Take(), first) << "work keeps its name";
  EXPECT_EQ(State(second), v1::JOB_STATE_RUNNING);
  manager_->Cancel(caller_, second).IgnoreError();
  EXPECT_EQ(State(second), v1::JOB_STATE_STOPPING);
  EXPECT_EQ(State(CreateSame()), v1::JOB_STATE_QUEUED) << "nobody joins work that is being cancelled";
}

TEST_F(JobSharingTest, WorkStopsWhenAllWantItTo) {
  const std::string first = CreateSame();
  const std::string second = CreateSame();
  Take();
  const auto link = std::make_shared<NotingLink>();
  manager_->source()->SetLink(first, attempt_, link);
  EXPECT_EQ(manager_->Stop(caller_, first)->state(), v1::JOB_STATE_STOPPING);
  EXPECT_THAT(link->sent, SizeIs(0));
  manager_->Cancel(caller_, second).IgnoreError();
  ASSERT_THAT(link->sent, SizeIs(1));
  EXPECT_TRUE(link->sent[0].has_stop());
  Succeed(first, "half done");
  EXPECT_EQ(State(CreateSame()), v1::JOB_STATE_QUEUED) << "what was stopped is no result for others";
}

TEST_F(JobSharingTest, CrashCostsAllOfThemOneAttempt) {
  const std::string first = CreateSame();
  const std::string second = CreateSame();
  Take();
  Lose(first);
  EXPECT_EQ(State(second), v1::JOB_STATE_QUEUED);
  const std::string third = CreateSame();
  for (int i = 0; i < 2; ++i) {
    Take();
    Lose(first);
  }
  EXPECT_EQ(ErrorReason(first), "WORKER_CRASHED");
  EXPECT_EQ(ErrorReason(second), "WORKER_CRASHED");
  EXPECT_EQ(State(third), v1::JOB_STATE_QUEUED) << "it lost two workers only";
  Take();
  Succeed(first);
  EXPECT_EQ(State(third), v1::JOB_STATE_SUCCEEDED);
}

TEST_F(JobSharingTest, AHigherPriorityPullsTheWorkForward) {
  const std::string first = CreateSame();
  now_ += absl::Seconds(1);
  const std::string other = Create();
  CreateSame([](JobRequest* request) { request->scheduling.set_priority(v1::PRIORITY_HIGH); });
  EXPECT_EQ(manager_->Get(caller_, other)->queue_position(), 1);
  const std::string low = CreateSame([](JobRequest* request) { request->scheduling.set_priority(v1::PRIORITY_LOW); });
  EXPECT_EQ(manager_->Get(caller_, low)->queue_position(), 0);
  EXPECT_EQ(Take(), first);
}

TEST_F(JobSharingTest, FreshComputesAnew) {
  const std::string first = CreateSame();
  Take();
  Succeed(first);
  const std::string fresh = CreateSame([](JobRequest* request) { request->scheduling.set_fresh(true); });
  EXPECT_EQ(State(fresh), v1::JOB_STATE_QUEUED);
}

TEST_F(JobSharingTest, RequestIdStandsForOneMesh) {
  Create("r1");
  JobRequest other = Request();
  other.request_id = "r1";
  const absl::Status status = manager_->Create(caller_, std::move(other)).status();
  EXPECT_EQ(status.code(), absl::StatusCode::kAlreadyExists);
  EXPECT_EQ(Reason(status), "REQUEST_ID_REUSED");
}

}  // namespace
}  // namespace planish
