// What a killed server leaves, and what the next one makes of it.
#include <filesystem>

#include "gmock/gmock.h"
#include "gtest/gtest.h"
#include "tests/server/blobs/blobs_in.h"
#include "tests/server/jobs/job_manager_fixture.h"
#include "tests/testing/files.h"

namespace planish {
namespace {

using ::testing::SizeIs;

class JobRestartTest : public JobManagerTest {
 protected:
  JobRestartTest() { options_.limits.reattach_grace = absl::Seconds(10); }
};

TEST_F(JobRestartTest, WhatRanIsQueuedAgainInItsOldPlace) {
  const std::string running = Create();
  Take();
  manager_->source()->ReportProgress(running, attempt_, Iteration(7));
  now_ += absl::Seconds(1);
  const std::string queued = Create();
  Resume();
  EXPECT_EQ(State(running), v1::JOB_STATE_QUEUED);
  EXPECT_EQ(State(queued), v1::JOB_STATE_QUEUED);
  EXPECT_EQ(Take(), running);
  EXPECT_EQ(manager_->Get(caller_, running)->attempts(), 2);
  Succeed(running, "uv");
  Take();
  Succeed(queued, "vu");
  EXPECT_EQ(State(running), v1::JOB_STATE_SUCCEEDED);
  EXPECT_EQ(State(queued), v1::JOB_STATE_SUCCEEDED);
  EXPECT_NE(Create(), running) << "numbers and names go on";
}

TEST_F(JobRestartTest, SequencesAscendAndNoChangeOfStateIsLost) {
  const std::string name = Create();
  Take();
  for (int i = 1; i <= 3; ++i) manager_->source()->ReportProgress(name, attempt_, Iteration(i));
  const std::int64_t seen = Events(name).back().sequence();
  EXPECT_EQ(seen, 5);
  Resume();
  const auto log = Watch(name);
  const auto again = log->ReadAfter(seen).event;
  ASSERT_TRUE(again.has_value());
  EXPECT_EQ(again->job().state(), v1::JOB_STATE_QUEUED);
  EXPECT_GT(again->sequence(), seen);
  EXPECT_EQ(again->skipped(), again->sequence() - seen - 1);
  Take();
  Succeed(name);
  Resume();
  std::vector<v1::JobState> states;
  for (const v1::JobEvent& event : Events(name)) {
    if (event.has_job()) states.push_back(event.job().state());
  }
  EXPECT_THAT(states, ::testing::ElementsAre(v1::JOB_STATE_QUEUED, v1::JOB_STATE_RUNNING, v1::JOB_STATE_QUEUED,
                                             v1::JOB_STATE_RUNNING, v1::JOB_STATE_SUCCEEDED));
  EXPECT_TRUE(Events(name).back().job().has_report());
  EXPECT_EQ(Watch(name)->uv()->ReadAll().value(), "uv");
}

TEST_F(JobRestartTest, ManyEventsNeverShareASequenceWithLaterOnes) {
  const std::string name = Create();
  Take();
  for (int i = 0; i < 5000; ++i) manager_->source()->ReportProgress(name, attempt_, Iteration(i));
  const std::int64_t seen = Events(name).back().sequence();
  Resume();
  EXPECT_GT(Events(name).back().sequence(), seen);
}

TEST_F(JobRestartTest, ServerThatEndsInOrderIsNotHeldAgainstTheJob) {
  const std::string name = Create();
  for (int i = 0; i < 5; ++i) {
    EXPECT_EQ(Take(), name);
    Resume();
  }
  Take();
  Lose(name);
  EXPECT_EQ(State(name), v1::JOB_STATE_QUEUED);
}

// Issue 26: a mesh that took the whole server down was run again after every restart, without end.
TEST_F(JobRestartTest, JobThatTakesTheServerDownFailsAfterThreeAttempts) {
  const std::string name = Create();
  for (int attempt = 1; attempt <= 3; ++attempt) {
    EXPECT_EQ(State(name), v1::JOB_STATE_QUEUED);
    EXPECT_EQ(Take(), name);
    EXPECT_EQ(manager_->Get(caller_, name)->attempts(), attempt);
    Crash();
  }
  EXPECT_EQ(State(name), v1::JOB_STATE_FAILED);
  EXPECT_EQ(ErrorReason(name), "SERVER_CRASHED");
  google::rpc::ErrorInfo info;
  manager_->Get(caller_, name)->error().details(0).UnpackTo(&info);
  EXPECT_EQ(info.metadata().at("attempts"), "3");
}

TEST_F(JobRestartTest, WorkersAndServersThatDieCountTogether) {
  const std::string name = Create();
  Take();
  Lose(name);
  Take();
  Crash();
  EXPECT_EQ(State(name), v1::JOB_STATE_QUEUED);
  Take();
  Lose(name);
  EXPECT_EQ(ErrorReason(name), "WORKER_CRASHED");
}

// Whoever ran beside it must not fail with it.
TEST_F(JobRestartTest, TheLastAttemptAfterTheServerDiedRunsAlone) {
  const std::string killer = Create();
  now_ += absl::Seconds(1);
  const std::string bystander = Create();
  JobAssignment assignment;
  for (int i = 0; i < 2; ++i) {
    EXPECT_EQ(Take(), killer);
    EXPECT_EQ(Take(), bystander);
    Crash();
  }
  EXPECT_EQ(Take(), killer);
  EXPECT_EQ(manager_->source()->TakeNext(absl::ZeroDuration(), &assignment), Turn::kNothing);
  Crash();
  EXPECT_EQ(ErrorReason(killer), "SERVER_CRASHED");
  EXPECT_EQ(Take(), bystander);
  const std::string later = Create();
  EXPECT_EQ(manager_->source()->TakeNext(absl::ZeroDuration(), &assignment), Turn::kNothing);
  Succeed(bystander);
  EXPECT_EQ(State(bystander), v1::JOB_STATE_SUCCEEDED);
  EXPECT_EQ(Take(), later);
}

// Issue 26: works_.at() threw, which aborted the server.
TEST_F(JobRestartTest, CancelAndStopAfterSuspendAreForTheNextServer) {
  const std::string running = Create();
  Take();
  const std::string queued = Create();
  manager_->Suspend();
  for (const std::string& name : {running, queued}) {
    for (const absl::Status& status :
         {manager_->Cancel(caller_, name).status(), manager_->Stop(caller_, name).status()}) {
      EXPECT_EQ(status.code(), absl::StatusCode::kUnavailable) << status;
      EXPECT_EQ(Reason(status), "DRAINING");
    }
  }
  manager_->FailAll(absl::InternalError("too late"));
  manager_->CancelAll();
  manager_ = *JobManager::Open(options_, store_.get(), blobs_.get());
  EXPECT_EQ(State(running), v1::JOB_STATE_QUEUED);
  EXPECT_FALSE(manager_->Get(caller_, running)->stop_requested());
  EXPECT_TRUE(manager_->Stop(caller_, running).ok());
  EXPECT_TRUE(manager_->Cancel(caller_, queued).ok());
}

TEST_F(JobRestartTest, CancellationOutlivesTheServer) {
  const std::string name = Create();
  Take();
  manager_->Cancel(caller_, name).IgnoreError();
  Resume();
  EXPECT_EQ(State(name), v1::JOB_STATE_CANCELLED);
}

TEST_F(JobRestartTest, StopOutlivesTheServer) {
  const std::string name = Create();
  Take();
  manager_->Stop(caller_, name).IgnoreError();
  Resume();
  EXPECT_EQ(State(name), v1::JOB_STATE_QUEUED);
  Take();
  const auto link = std::make_shared<NotingLink>();
  manager_->source()->SetLink(name, attempt_, link);
  ASSERT_THAT(link->sent, SizeIs(1));
  EXPECT_TRUE(link->sent[0].has_stop());
}

TEST_F(JobRestartTest, AttachedJobWaitsForItsCaller) {
  auto accepted = manager_->Create(caller_, Request("r1", true));
  const std::string name = accepted->job.name();
  manager_->Suspend();
  accepted->attachment = JobAttachment();
  Resume();
  now_ += absl::Seconds(5);
  manager_->Tick();
  EXPECT_EQ(State(name), v1::JOB_STATE_QUEUED);
  {
    const auto retry = manager_->Create(caller_, Request("r1", true));
    EXPECT_EQ(retry->job.name(), name);
    now_ += absl::Seconds(60);
    manager_->Tick();
    EXPECT_EQ(State(name), v1::JOB_STATE_QUEUED);
  }
  now_ += absl::Seconds(10);
  manager_->Tick();
  EXPECT_EQ(State(name), v1::JOB_STATE_CANCELLED);
}

TEST_F(JobRestartTest, AttachedJobWhoseCallerStaysAwayIsCancelled) {
  auto accepted = manager_->Create(caller_, Request("", true));
  manager_->Suspend();
  accepted->attachment = JobAttachment();
  Resume();
  now_ += absl::Seconds(10);
  manager_->Tick();
  EXPECT_EQ(State(accepted->job.name()), v1::JOB_STATE_CANCELLED);
}

TEST_F(JobRestartTest, SharedWorkIsSharedAgain) {
  JobRequest request = Request();
  const std::string first = manager_->Create(caller_, request)->job.name();
  const std::string second = manager_->Create(caller_, request)->job.name();
  Take();
  Resume();
  EXPECT_EQ(Take(), first);
  Succeed(first);
  EXPECT_EQ(State(second), v1::JOB_STATE_SUCCEEDED);
}

TEST_F(JobRestartTest, SuspendTellsWatchersToComeBack) {
  const std::string name = Create();
  Take();
  const auto link = std::make_shared<NotingLink>();
  manager_->source()->SetLink(name, attempt_, link);
  const auto log = Watch(name);
  manager_->Suspend();
  EXPECT_TRUE(link->closed);
  const JobEventLog::Read read = log->ReadAfter(log->last_sequence());
  EXPECT_TRUE(read.ended);
  EXPECT_EQ(read.status.code(), absl::StatusCode::kUnavailable);
  EXPECT_EQ(Reason(read.status), "DRAINING");
  Lose(name);
  EXPECT_FALSE(TakeNext().has_value());
  Resume();
  EXPECT_EQ(State(name), v1::JOB_STATE_QUEUED);
}

TEST_F(JobRestartTest, FilesOutliveTheProcess) {
  const TempDir directory;
  std::filesystem::create_directory(directory.Path("blobs"));
  const auto reopen = [&] {
    manager_.reset();
    store_.reset();
    store_ = OpenStore(*OpenSqliteDatabase(directory.Path("jobs.sqlite")));
    blobs_ = std::make_unique<BlobCatalog>(BlobPlaces{BlobsIn(directory.Path("blobs"))}, 1 << 20);
    ASSERT_TRUE(blobs_->Open().ok());
    manager_ = *JobManager::Open(options_, store_.get(), blobs_.get());
  };
  reopen();
  const std::string token_list = CreateEnded("the result");
  const std::string running = Create();
  Take();
  Create();
  const std::string token = List(1)->next_page_token;
  reopen();
  EXPECT_EQ(Watch(token_list)->uv()->ReadAll().value(), "the result");
  EXPECT_THAT(List(10, token)->jobs, SizeIs(2)) << "pages go on";
  const std::optional<JobAssignment> assignment = TakeNext();
  EXPECT_EQ(assignment->name, running);
  EXPECT_EQ(assignment->blobs[0]->bytes(), "mesh2");

  std::filesystem::remove_all(directory.Path("blobs"));
  std::filesystem::create_directory(directory.Path("blobs"));
  reopen();
  EXPECT_EQ(ErrorReason(running), "MESH_LOST");
  EXPECT_EQ(Reason(manager_->Watch(caller_, token_list, false, true).status()), "RESULT_EXPIRED");
}

TEST_F(JobRestartTest, NothingIsLeftOfJobsThatAreForgotten) {
  const std::string name = CreateEnded("uv");
  EXPECT_GT(blobs_->bytes(), 0);
  ASSERT_TRUE(manager_->Delete(caller_, name).ok());
  manager_->Tick();
  EXPECT_EQ(blobs_->bytes(), 0);
  EXPECT_TRUE(store_->Events(1)->empty());
}

TEST_F(JobRestartTest, ResultsAreKeptForATime) {
  options_.limits.retained_time = absl::Hours(1);
  Restart();
  const std::string name = CreateEnded("uv");
  EXPECT_EQ(manager_->Get(caller_, name)->expire_time().seconds() - manager_->Get(caller_, name)->end_time().seconds(),
            3600);
  now_ += absl::Minutes(59);
  manager_->Tick();
  EXPECT_EQ(State(name), v1::JOB_STATE_SUCCEEDED);
  now_ += absl::Minutes(1);
  manager_->Tick();
  EXPECT_EQ(State(name), v1::JOB_STATE_EXPIRED);
}

TEST_F(JobRestartTest, AFullStoreGivesUpOldResultsFirstThenRefuses) {
  store_bytes_ = 100;
  Restart();
  const std::string old = CreateEnded(std::string(60, 'x'));
  const std::string name = Create();
  Take();
  Succeed(name, std::string(70, 'y'));
  EXPECT_EQ(State(name), v1::JOB_STATE_SUCCEEDED);
  EXPECT_EQ(State(old), v1::JOB_STATE_EXPIRED);
  JobRequest large = Request();
  large.bytes = std::string(101, 'm');
  const absl::Status refused = manager_->Create(caller_, std::move(large)).status();
  EXPECT_EQ(refused.code(), absl::StatusCode::kResourceExhausted);
  EXPECT_EQ(Reason(refused), "STORAGE_FULL");
  EXPECT_EQ(ToRpcStatus(refused).details_size(), 2) << "with a retry delay";
}

TEST_F(JobRestartTest, ArraysAreArraysAfterARestartToo) {
  options_.estimate = [](std::string_view draco, std::int64_t, const v1::MeshSize& size,
                         const v1::UnwrapOptions&) -> absl::StatusOr<JobNeeds> {
    EXPECT_EQ(draco, "") << "arrays are no Draco file";
    return JobNeeds{size, 100 * size.triangles() + size.vertices(), 1};
  };
  Restart();
  v1::JobSpec spec;
  spec.mutable_arrays()->set_positions(std::string(36, 'p'));
  spec.mutable_arrays()->set_triangles(std::string(24, 't'));
  (*spec.mutable_labels())["file"] = "a.obj";
  const std::string name = manager_->Create(caller_, *TakeJobRequest(&spec))->job.name();
  EXPECT_EQ(manager_->Get(caller_, name)->memory_bytes(), 203);
  for (const bool crashes : {false, true}) {
    if (crashes) Take();
    crashes ? Crash() : Resume();
    EXPECT_EQ(manager_->Get(caller_, name)->memory_bytes(), 203);
  }
  EXPECT_THAT(List(0, "", "labels.file = a.obj")->jobs, SizeIs(1));
  EXPECT_EQ(TakeNext()->request.array_vertices(), 3);
}

TEST_F(JobRestartTest, ACancelThatWasAskedForShowsAfterACrash) {
  const std::string name = Create();
  Take();
  ASSERT_TRUE(manager_->Cancel(caller_, name).ok());
  Crash();
  EXPECT_EQ(State(name), v1::JOB_STATE_CANCELLED);
  EXPECT_TRUE(manager_->Get(caller_, name)->cancel_requested());
}

TEST_F(JobRestartTest, ResultThatCannotBeKeptFailsTheJob) {
  store_bytes_ = 100;
  Restart();
  const std::string name = Create();
  Take();
  Succeed(name, std::string(101, 'y'));
  EXPECT_EQ(ErrorReason(name), "STORAGE_FULL");
}

}  // namespace
}  // namespace planish
