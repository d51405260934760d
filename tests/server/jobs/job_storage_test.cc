// A store that fails, and a clock that jumps.
#include <sys/resource.h>

#include <csignal>

#include "gmock/gmock.h"
#include "google/protobuf/util/time_util.h"
#include "gtest/gtest.h"
#include "server/jobs/sqlite.h"
#include "server/link/duration.h"
#include "tests/server/jobs/job_manager_fixture.h"
#include "tests/testing/files.h"

namespace planish {
namespace {

using google::protobuf::util::TimeUtil;

// Another store that refuses to write while it is told to.
class FullStore : public JobStore {
 public:
  explicit FullStore(JobStore* store) : store_(store) {}

  const std::string& id() const override { return store_->id(); }
  absl::Status Write(const std::vector<JobWrite>& writes, Durability durability) override {
    if (full) return MakeError(absl::StatusCode::kResourceExhausted, "STORAGE_FULL", "no room");
    for (const JobWrite& write : writes) {
      if (before_write) before_write(*write.record);
    }
    return store_->Write(writes, durability);
  }
  absl::StatusOr<std::optional<JobRecord>> Find(const std::string& name) override { return store_->Find(name); }
  absl::StatusOr<std::optional<JobRecord>> FindByRequestId(const std::string& tenant, const std::string& id) override {
    return store_->FindByRequestId(tenant, id);
  }
  absl::StatusOr<std::optional<JobRecord>> FindResult(const std::string& key) override {
    return store_->FindResult(key);
  }
  absl::StatusOr<std::vector<JobRecord>> List(const JobQuery& query) override { return store_->List(query); }
  absl::StatusOr<std::vector<JobRecord>> Unfinished() override { return store_->Unfinished(); }
  absl::StatusOr<std::optional<JobRecord>> FirstEnded(const std::string& tenant, v1::JobState state) override {
    return store_->FirstEnded(tenant, state);
  }
  absl::StatusOr<JobTotals> Totals() override { return store_->Totals(); }
  absl::StatusOr<std::vector<v1::JobEvent>> Events(std::int64_t number) override { return store_->Events(number); }
  absl::Status Delete(std::int64_t number) override { return store_->Delete(number); }
  absl::StatusOr<bool> UsesBlob(const BlobId& id) override { return store_->UsesBlob(id); }

  bool full = false;
  std::function<void(const JobRecord&)> before_write;

 private:
  JobStore* const store_;
};

class JobStorageTest : public JobManagerTest {
 protected:
  JobStorageTest() : full_(store_.get()) { Reopen(); }

  void Reopen() {
    manager_->Suspend();
    manager_ = *JobManager::Open(options_, &full_, blobs_.get());
  }

  FullStore full_;
};

TEST_F(JobStorageTest, WhatCannotBeWrittenIsNotAccepted) {
  full_.full = true;
  const absl::Status refused = manager_->Create(caller_, Request("r1")).status();
  EXPECT_EQ(refused.code(), absl::StatusCode::kResourceExhausted);
  EXPECT_EQ(Reason(refused), "STORAGE_FULL");
  EXPECT_EQ(ToRpcStatus(refused).details_size(), 2) << "with a retry delay";
  manager_->Tick();
  EXPECT_EQ(blobs_->bytes(), 0) << "nor is its mesh kept";
  full_.full = false;
  EXPECT_EQ(State(Create("r1")), v1::JOB_STATE_QUEUED);
}

// Issue 26: SUCCEEDED could reach a watcher before it was durable.
TEST_F(JobStorageTest, NobodyHearsOfAnEndBeforeItIsWritten) {
  const std::string name = Create();
  Take();
  const auto log = Watch(name);
  full_.before_write = [&](const JobRecord& record) {
    if (record.job().state() != v1::JOB_STATE_SUCCEEDED) return;
    const std::int64_t last = log->last_sequence();
    EXPECT_EQ(log->ReadAfter(last - 1).event->job().state(), v1::JOB_STATE_RUNNING);
    EXPECT_EQ(transitions_.back(), "RUNNING");
  };
  Succeed(name, "uv");
  EXPECT_EQ(State(name), v1::JOB_STATE_SUCCEEDED);
  EXPECT_EQ(transitions_.back(), "SUCCEEDED");
}

TEST_F(JobStorageTest, AnEndThatCannotBeWrittenIsWrittenLater) {
  const std::string name = Create();
  Take();
  const auto log = Watch(name);
  full_.full = true;
  Succeed(name, "uv");
  manager_->Tick();
  EXPECT_EQ(State(name), v1::JOB_STATE_RUNNING) << "nobody hears of what a loss of power could take back";
  EXPECT_FALSE(manager_->Get(caller_, name)->has_report());
  EXPECT_EQ(log->uv(), nullptr);
  EXPECT_EQ(Reason(manager_->Cancel(caller_, name).status()), "STORAGE_FULL") << "too late, and nobody knows yet";
  full_.full = false;
  manager_->Tick();
  EXPECT_EQ(State(name), v1::JOB_STATE_SUCCEEDED);
  EXPECT_TRUE(manager_->Get(caller_, name)->has_report());
  EXPECT_EQ(log->uv()->ReadAll().value(), "uv");
  Reopen();
  EXPECT_EQ(State(name), v1::JOB_STATE_SUCCEEDED) << "and it does not run again";
  EXPECT_EQ(Watch(name)->uv()->ReadAll().value(), "uv");
}

TEST_F(JobStorageTest, NoAttemptBeginsThatCannotBeWritten) {
  const std::string name = Create();
  full_.full = true;
  JobAssignment assignment;
  EXPECT_EQ(manager_->TakeNext(absl::ZeroDuration(), &assignment), Turn::kNothing);
  EXPECT_EQ(State(name), v1::JOB_STATE_QUEUED);
  EXPECT_EQ(manager_->Get(caller_, name)->attempts(), 0);
  full_.full = false;
  EXPECT_EQ(manager_->TakeNext(absl::ZeroDuration(), &assignment), Turn::kNothing) << "not at once";
  now_ += options_.retry_delay;
  manager_->Tick();
  EXPECT_EQ(Take(), name);
  EXPECT_EQ(manager_->Get(caller_, name)->attempts(), 1);
}

TEST_F(JobStorageTest, ChangesOfStateThatCannotBeWrittenAreMadeAllTheSame) {
  const std::string name = Create();
  Take();
  EXPECT_EQ(State(name), v1::JOB_STATE_RUNNING);
  full_.full = true;
  EXPECT_EQ(Reason(manager_->Cancel(caller_, name).status()), "STORAGE_FULL") << "the caller is told";
  EXPECT_EQ(State(name), v1::JOB_STATE_STOPPING);
  Report(name, Cancelled());
  EXPECT_EQ(State(name), v1::JOB_STATE_STOPPING) << "the end has to wait";
  full_.full = false;
  manager_->Tick();
  EXPECT_EQ(State(name), v1::JOB_STATE_CANCELLED);
  Reopen();
  EXPECT_EQ(State(name), v1::JOB_STATE_CANCELLED);
}

// The same error as of a disk that is full, from the same system call.
TEST(SqliteJobStore, ADiskThatIsFullIsSaidAndHurtsNothing) {
  const TempDir directory;
  const std::unique_ptr<JobStore> store = *OpenJobStore(directory.Path("jobs.sqlite"));
  JobRecord record;
  record.set_number(1);
  record.mutable_job()->set_name("jobs/1");
  ASSERT_TRUE(store->Put(record, nullptr).ok());
  rlimit before;
  getrlimit(RLIMIT_FSIZE, &before);
  const auto handler = std::signal(SIGXFSZ, SIG_IGN);
  const rlimit small = {100'000, before.rlim_max};
  setrlimit(RLIMIT_FSIZE, &small);
  record.mutable_job()->set_traceparent(std::string(300'000, 'x'));
  const absl::Status status = store->Put(record, nullptr);
  setrlimit(RLIMIT_FSIZE, &before);
  std::signal(SIGXFSZ, handler);
  EXPECT_EQ(Reason(status), "STORAGE_FULL") << status;
  EXPECT_EQ((*store->Find("jobs/1"))->job().traceparent(), "");
  EXPECT_TRUE(store->Put(record, nullptr).ok()) << "once there is room again";
}

TEST(SqliteJobStore, RefusesAStoreFromTheFuture) {
  const TempDir directory;
  { ASSERT_TRUE(OpenJobStore(directory.Path("jobs.sqlite")).ok()); }
  ASSERT_TRUE(Database::Open(directory.Path("jobs.sqlite"))->Execute("PRAGMA user_version = 99").ok());
  const absl::Status status = OpenJobStore(directory.Path("jobs.sqlite")).status();
  EXPECT_EQ(status.code(), absl::StatusCode::kFailedPrecondition);
  EXPECT_EQ(Reason(status), "STORE_VERSION");
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
