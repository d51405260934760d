// What operators see and change while jobs wait and run.
#include "gmock/gmock.h"
#include "tests/server/jobs/job_manager_fixture.h"

namespace planish {
namespace {

class JobOperatorTest : public JobManagerTest {
 protected:
  JobLimits Limits() { return manager_->Limits(); }
  // Why one more job is not taken.
  std::string Refusal() { return Reason(manager_->Create(caller_, Request()).status()); }
};

TEST_F(JobOperatorTest, QueueCapacityChanges) {
  JobLimits limits = Limits();
  EXPECT_EQ(limits.queue_capacity, 2);
  limits.queue_capacity = 3;
  manager_->SetLimits(limits);
  Create();
  Take();
  for (int i = 0; i < 3; ++i) Create();
  EXPECT_EQ(Refusal(), "QUEUE_FULL");
  limits.queue_capacity = 1;
  manager_->SetLimits(limits);
  EXPECT_EQ(manager_->Stats().queued, 3) << "what waits stays";
  EXPECT_EQ(Refusal(), "QUEUE_FULL");
}

TEST_F(JobOperatorTest, ResultsGoWhenTheyMayNoLongerBeKept) {
  const std::string name = Create();
  Succeed(Take());
  const std::string last = Create();
  Succeed(Take(), "other");
  JobLimits limits = Limits();
  limits.retained_time = absl::Hours(1);
  manager_->SetLimits(limits);
  now_ += absl::Minutes(59);
  manager_->Tick();
  EXPECT_EQ(State(name), v1::JOB_STATE_SUCCEEDED);
  now_ += absl::Minutes(1);
  manager_->Tick();
  EXPECT_EQ(State(name), v1::JOB_STATE_EXPIRED);
  limits.retained_record_bytes = 1;
  manager_->SetLimits(limits);
  manager_->Tick();
  EXPECT_FALSE(manager_->Get(caller_, name).ok());
  EXPECT_TRUE(manager_->Get(caller_, last).ok());
}

TEST_F(JobOperatorTest, StatsCountJobs) {
  Create();
  now_ += absl::Seconds(5);
  Create();
  Take();
  now_ += absl::Seconds(2);
  const ManagerStats stats = manager_->Stats();
  EXPECT_EQ(stats.running, 1);
  EXPECT_EQ(stats.queued, 1);
  EXPECT_EQ(stats.oldest_wait, absl::Seconds(2));
  EXPECT_FALSE(stats.draining);
  EXPECT_GT(stats.stored_bytes, 0);
  EXPECT_EQ(stats.store_bytes, store_bytes_);
  ASSERT_EQ(stats.tenants.size(), 1u);
  EXPECT_EQ(stats.tenants[0].queued, 1);
  EXPECT_EQ(stats.tenants[0].running, 1);
}

TEST_F(JobOperatorTest, DrainIsTakenBackUnlessTheServerEnds) {
  manager_->Drain(nullptr);
  EXPECT_TRUE(manager_->Stats().draining);
  EXPECT_EQ(Refusal(), "DRAINING");
  EXPECT_TRUE(manager_->Undrain().ok());
  Create();
  manager_->Drain([] {});
  const absl::Status status = manager_->Undrain();
  EXPECT_EQ(status.code(), absl::StatusCode::kFailedPrecondition);
  EXPECT_EQ(Reason(status), "SHUTTING_DOWN");
  EXPECT_EQ(Refusal(), "DRAINING");
}

}  // namespace
}  // namespace planish
