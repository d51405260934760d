// A store that fails, and a clock that jumps.
#include <sys/resource.h>

#include <csignal>

#include "gmock/gmock.h"
#include "google/protobuf/util/time_util.h"
#include "gtest/gtest.h"
#include "server/link/duration.h"
#include "server/store/sqlite.h"
#include "tests/server/jobs/job_manager_fixture.h"
#include "tests/server/store/failing_database.h"
#include "tests/testing/files.h"

namespace planish {
namespace {

using google::protobuf::util::TimeUtil;

class JobStorageTest : public JobManagerTest {
 protected:
  JobStorageTest() {
    manager_.reset();
    store_ = OpenStore(std::make_unique<FailingDatabase>(*OpenSqliteDatabase(":memory:"), &fault_));
    Resume();
  }

  Fault fault_;
};

TEST_F(JobStorageTest, WhatCannotBeWrittenIsNotAccepted) {
  fault_.full = true;
  const absl::Status refused = manager_->Create(caller_, Request("r1")).status();
  EXPECT_EQ(refused.code(), absl::StatusCode::kResourceExhausted);
  EXPECT_EQ(Reason(refused), "STORAGE_FULL");
  EXPECT_EQ(ToRpcStatus(refused).details_size(), 2) << "with a retry delay";
  manager_->Tick();
  EXPECT_EQ(blobs_->bytes(), 0) << "nor is its mesh kept";
  fault_.full = false;
  EXPECT_EQ(State(Create("r1")), v1::JOB_STATE_QUEUED);
}

TEST_F(JobStorageTest, ABatchIsWrittenAtOnce) {
  options_.limits.queue_capacity = 100;
  Resume();
  std::vector<JobRequest> requests;
  for (int i = 0; i < 40; ++i) requests.push_back(Request());
  requests[7].bytes = "";
  requests[8].request_id = requests[9].request_id = "r";  // two meshes
  fault_.commits = 0;
  const std::vector<absl::StatusOr<AcceptedJob>> accepted = manager_->CreateAll(caller_, std::move(requests));
  EXPECT_EQ(fault_.commits, 1);
  ASSERT_EQ(accepted.size(), 40u);
  for (std::size_t i = 0; i < accepted.size(); ++i) {
    if (i == 7) {
      EXPECT_EQ(Reason(accepted[i].status()), "MESH_MISSING");
    } else if (i == 9) {
      EXPECT_EQ(Reason(accepted[i].status()), "REQUEST_ID_REUSED");
    } else {
      ASSERT_TRUE(accepted[i].ok()) << accepted[i].status();
      EXPECT_EQ(State(accepted[i]->job.name()), v1::JOB_STATE_QUEUED);
    }
  }
  EXPECT_EQ(Take(), accepted[0]->job.name()) << "in their order";
  Succeed(accepted[0]->job.name());
  EXPECT_EQ(Watch(accepted[0]->job.name())->uv()->ReadAll().value(), "uv");
  fault_.full = true;
  std::vector<JobRequest> more;
  for (int i = 0; i < 3; ++i) more.push_back(Request());
  for (const auto& refused : manager_->CreateAll(caller_, std::move(more))) {
    EXPECT_EQ(Reason(refused.status()), "STORAGE_FULL");
  }
  fault_.full = false;
}

// Issue 26: SUCCEEDED could reach a watcher before it was durable.
TEST_F(JobStorageTest, NobodyHearsOfAnEndBeforeItIsWritten) {
  const std::string name = Create();
  Take();
  const auto log = Watch(name);
  fault_.before = [&](const std::string&) {
    const std::int64_t last = log->last_sequence();
    EXPECT_EQ(log->ReadAfter(last - 1).event->job().state(), v1::JOB_STATE_RUNNING);
    EXPECT_EQ(transitions_.back(), "RUNNING");
  };
  fault_.count = 0;
  Succeed(name, "uv");
  fault_.before = nullptr;
  EXPECT_GE(fault_.count, 3);
  EXPECT_EQ(State(name), v1::JOB_STATE_SUCCEEDED);
  EXPECT_EQ(transitions_.back(), "SUCCEEDED");
}

TEST_F(JobStorageTest, AnEndThatCannotBeWrittenIsWrittenLater) {
  const std::string name = Create();
  Take();
  const auto log = Watch(name);
  fault_.full = true;
  Succeed(name, "uv");
  manager_->Tick();
  EXPECT_EQ(State(name), v1::JOB_STATE_RUNNING) << "nobody hears of what a loss of power could take back";
  EXPECT_FALSE(manager_->Get(caller_, name)->has_report());
  EXPECT_EQ(log->uv(), nullptr);
  EXPECT_EQ(Reason(manager_->Cancel(caller_, name).status()), "STORAGE_FULL") << "too late, and nobody knows yet";
  fault_.full = false;
  manager_->Tick();
  EXPECT_EQ(State(name), v1::JOB_STATE_SUCCEEDED);
  EXPECT_TRUE(manager_->Get(caller_, name)->has_report());
  EXPECT_EQ(log->uv()->ReadAll().value(), "uv");
  Resume();
  EXPECT_EQ(State(name), v1::JOB_STATE_SUCCEEDED) << "and it does not run again";
  EXPECT_EQ(Watch(name)->uv()->ReadAll().value(), "uv");
}

TEST_F(JobStorageTest, NoAttemptBeginsThatCannotBeWritten) {
  const std::string name = Create();
  fault_.full = true;
  JobAssignment assignment;
  EXPECT_EQ(manager_->source()->TakeNext(absl::ZeroDuration(), &assignment), Turn::kNothing);
  EXPECT_EQ(State(name), v1::JOB_STATE_QUEUED);
  EXPECT_EQ(manager_->Get(caller_, name)->attempts(), 0);
  fault_.full = false;
  EXPECT_EQ(manager_->source()->TakeNext(absl::ZeroDuration(), &assignment), Turn::kNothing) << "not at once";
  now_ += options_.retry_delay;
  manager_->Tick();
  EXPECT_EQ(Take(), name);
  EXPECT_EQ(manager_->Get(caller_, name)->attempts(), 1);
}

TEST_F(JobStorageTest, WhatCannotBeWrittenIsNotDone) {
  const std::string name = Create();
  Take();
  const auto link = std::make_shared<NotingLink>();
  manager_->source()->SetLink(name, attempt_, link);
  fault_.full = true;
  for (const absl::Status& status :
       {manager_->Stop(caller_, name).status(), manager_->Cancel(caller_, name).status()}) {
    EXPECT_EQ(Reason(status), "STORAGE_FULL") << "the caller is told, and tries again";
    EXPECT_EQ(ToRpcStatus(status).details_size(), 2) << "after a delay";
  }
  EXPECT_EQ(State(name), v1::JOB_STATE_RUNNING);
  EXPECT_TRUE(link->sent.empty());
  fault_.full = false;
  EXPECT_TRUE(manager_->Cancel(caller_, name).ok());
  EXPECT_EQ(link->sent.size(), 1);
  fault_.full = true;
  Report(name, Cancelled());
  EXPECT_EQ(State(name), v1::JOB_STATE_STOPPING) << "the end has to wait";
  fault_.full = false;
  manager_->Tick();
  EXPECT_EQ(State(name), v1::JOB_STATE_CANCELLED);
  Resume();
  EXPECT_EQ(State(name), v1::JOB_STATE_CANCELLED);
}

TEST_F(JobStorageTest, LimitsOfTimeAreKeptOnceThereIsRoom) {
  JobRequest request = Request();
  *request.scheduling.mutable_timeout() = TimeUtil::SecondsToDuration(10);
  const std::string name = manager_->Create(caller_, std::move(request))->job.name();
  now_ += absl::Seconds(10);
  fault_.full = true;
  manager_->Tick();
  EXPECT_EQ(State(name), v1::JOB_STATE_QUEUED);
  fault_.full = false;
  now_ += options_.retry_delay;
  manager_->Tick();
  EXPECT_EQ(ErrorReason(name), "DEADLINE_EXCEEDED");
}

// A worker is lost while nothing can be written: the job is queued again when that is possible.
TEST_F(JobStorageTest, ALossThatCannotBeWrittenIsWrittenLater) {
  const std::string name = Create();
  Take();
  fault_.full = true;
  Lose(name);
  manager_->Tick();
  EXPECT_EQ(State(name), v1::JOB_STATE_RUNNING);
  fault_.full = false;
  manager_->Tick();
  EXPECT_EQ(State(name), v1::JOB_STATE_QUEUED);
  EXPECT_EQ(Take(), name);
  EXPECT_EQ(attempt_, 2);
}

// The same error as of a disk that is full, from the same system call.
TEST(SqliteJobStore, ADiskThatIsFullIsSaidAndHurtsNothing) {
  const TempDir directory;
  const std::unique_ptr<JobStore> store = *OpenJobStore(directory.Path("jobs.sqlite"));
  NewJob job;
  job.record.mutable_job()->set_name("jobs/1");
  job.record.mutable_job()->set_state(v1::JOB_STATE_QUEUED);
  ASSERT_TRUE(store->Accept({}, job).ok());
  rlimit before;
  getrlimit(RLIMIT_FSIZE, &before);
  const auto handler = std::signal(SIGXFSZ, SIG_IGN);
  const rlimit small = {100'000, before.rlim_max};
  setrlimit(RLIMIT_FSIZE, &small);
  job.record.mutable_job()->set_name("jobs/2");
  job.record.mutable_job()->set_traceparent(std::string(300'000, 'x'));
  const absl::Status status = store->Accept({}, job).status();
  setrlimit(RLIMIT_FSIZE, &before);
  std::signal(SIGXFSZ, handler);
  EXPECT_EQ(Reason(status), "STORAGE_FULL") << status;
  EXPECT_FALSE((*store->Find("jobs/2")).has_value());
  EXPECT_TRUE((*store->Find("jobs/1")).has_value());
  EXPECT_TRUE(store->Accept({}, job).ok()) << "once there is room again";
}

TEST(SqliteJobStore, RefusesAStoreFromTheFuture) {
  const TempDir directory;
  { ASSERT_TRUE(OpenJobStore(directory.Path("jobs.sqlite")).ok()); }
  ASSERT_TRUE(Database::Open(directory.Path("jobs.sqlite"))->Execute("PRAGMA user_version = 99").ok());
  const absl::Status status = OpenJobStore(directory.Path("jobs.sqlite")).status();
  EXPECT_EQ(status.code(), absl::StatusCode::kFailedPrecondition);
  EXPECT_EQ(Reason(status), "STORE_VERSION");
}

TEST_F(JobManagerTest, AClockThatIsSetForwardEndsNoJobWhoseCallerIsThere) {
  options_.steady_clock = [] { return absl::UnixEpoch() + absl::Hours(1); };
  options_.limits.reattach_grace = absl::Seconds(10);
  Restart();
  auto attached = manager_->Create(caller_, Request("r1", true));
  const std::string name = attached->job.name();
  manager_->Tick();
  now_ += absl::Hours(24 * 365);
  manager_->Tick();
  EXPECT_EQ(State(name), v1::JOB_STATE_QUEUED);
}

TEST_F(JobManagerTest, AClockThatJumpsEndsNoJobThatHasNoLimit) {
  options_.limits.reattach_grace = absl::Seconds(10);
  Restart();
  auto attached = manager_->Create(caller_, Request("r1", true));
  const std::string name = attached->job.name();
  const std::string queued = Create();
  for (const absl::Duration jump : {absl::Hours(24 * 365), -2 * absl::Hours(24 * 365), absl::Hours(24 * 365)}) {
    now_ += jump;
    manager_->Tick();
    EXPECT_EQ(State(name), v1::JOB_STATE_QUEUED);
    EXPECT_EQ(State(queued), v1::JOB_STATE_QUEUED);
  }
  EXPECT_EQ(Take(), name);
  now_ -= absl::Hours(5);
  Succeed(name);
  EXPECT_EQ(State(name), v1::JOB_STATE_SUCCEEDED);
  EXPECT_GE(ToSeconds(manager_->Get(caller_, name)->report().times().queue()), 0);
}

TEST_F(JobManagerTest, AClockThatGoesBackPutsLimitsOffNotAway) {
  JobRequest request = Request();
  *request.scheduling.mutable_timeout() = TimeUtil::SecondsToDuration(10);
  const std::string name = manager_->Create(caller_, std::move(request))->job.name();
  now_ -= absl::Hours(1);
  manager_->Tick();
  EXPECT_EQ(State(name), v1::JOB_STATE_QUEUED);
  now_ += absl::Hours(1) + absl::Seconds(10);
  manager_->Tick();
  EXPECT_EQ(ErrorReason(name), "DEADLINE_EXCEEDED");
}

}  // namespace
}  // namespace planish
