#include "server/store/lifecycle.h"

#include <vector>

#include "gtest/gtest.h"

namespace planish {
namespace {

using v1::JobState;

const std::vector<JobAction> kActions = {JobAction::kStart,   JobAction::kStop,  JobAction::kCancel,
                                         JobAction::kSucceed, JobAction::kFail,  JobAction::kCancelled,
                                         JobAction::kRequeue, JobAction::kExpire};

// One letter a target state, in the order of kActions; '.' is illegal.
struct Row {
  JobState from;
  const char* targets;
};

const std::vector<Row> kTable = {
    {v1::JOB_STATE_UNSPECIFIED, "........"}, {v1::JOB_STATE_QUEUED, "R.CSF..."},    {v1::JOB_STATE_RUNNING, ".TTSF.Q."},
    {v1::JOB_STATE_STOPPING, "...SFCQ."},    {v1::JOB_STATE_SUCCEEDED, ".......E"}, {v1::JOB_STATE_FAILED, "........"},
    {v1::JOB_STATE_CANCELLED, "........"},   {v1::JOB_STATE_EXPIRED, "........"},
};

JobState Target(char letter) {
  switch (letter) {
    case 'Q':
      return v1::JOB_STATE_QUEUED;
    case 'E':
      return v1::JOB_STATE_EXPIRED;
    case 'R':
      return v1::JOB_STATE_RUNNING;
    case 'T':
      return v1::JOB_STATE_STOPPING;
    case 'S':
      return v1::JOB_STATE_SUCCEEDED;
    case 'F':
      return v1::JOB_STATE_FAILED;
    case 'C':
      return v1::JOB_STATE_CANCELLED;
    default:
      return v1::JOB_STATE_UNSPECIFIED;
  }
}

TEST(Lifecycle, EveryActionInEveryState) {
  const absl::Time now = absl::FromUnixSeconds(1000);
  for (const Row& row : kTable) {
    for (std::size_t i = 0; i < kActions.size(); ++i) {
      v1::Job job;
      job.set_name("jobs/1");
      job.set_state(row.from);
      const v1::Job before = job;
      const absl::Status status = Advance(kActions[i], now, &job);
      SCOPED_TRACE(StateName(row.from) + " action " + std::to_string(i));
      if (row.targets[i] == '.') {
        EXPECT_EQ(status.code(), absl::StatusCode::kFailedPrecondition);
        EXPECT_EQ(job.SerializeAsString(), before.SerializeAsString());
      } else {
        EXPECT_TRUE(status.ok()) << status;
        EXPECT_EQ(job.state(), Target(row.targets[i]));
        EXPECT_EQ(job.has_start_time(), job.state() == v1::JOB_STATE_RUNNING);
        EXPECT_EQ(job.has_end_time(), IsTerminal(job.state()) && kActions[i] != JobAction::kExpire);
      }
    }
  }
}

TEST(Lifecycle, TimesComeFromTheClock) {
  v1::Job job;
  job.set_state(v1::JOB_STATE_QUEUED);
  ASSERT_TRUE(Advance(JobAction::kStart, absl::FromUnixMillis(1500), &job).ok());
  ASSERT_TRUE(Advance(JobAction::kSucceed, absl::FromUnixMillis(2250), &job).ok());
  EXPECT_EQ(job.start_time().seconds(), 1);
  EXPECT_EQ(job.start_time().nanos(), 500'000'000);
  EXPECT_EQ(job.end_time().seconds(), 2);
  EXPECT_EQ(job.end_time().nanos(), 250'000'000);
}

TEST(Lifecycle, NamesOfStates) {
  EXPECT_EQ(StateName(v1::JOB_STATE_RUNNING), "RUNNING");
  EXPECT_EQ(StateName(static_cast<JobState>(77)), "77");
}

}  // namespace
}  // namespace planish
