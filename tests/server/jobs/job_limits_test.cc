// What ends a job early, what keeps it from starting, and what it costs when workers die.
#include <chrono>
#include <functional>
#include <limits>
#include <thread>

#include "gmock/gmock.h"
#include "google/protobuf/util/time_util.h"
#include "gtest/gtest.h"
#include "tests/server/jobs/job_manager_fixture.h"

namespace planish {
namespace {

using google::protobuf::util::TimeUtil;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::SizeIs;

class JobLimitsTest : public JobManagerTest {
 protected:
  std::string CreateWith(const std::function<void(JobRequest*)>& change) {
    JobRequest request = Request();
    change(&request);
    const auto accepted = manager_->Create(caller_, std::move(request));
    EXPECT_TRUE(accepted.ok()) << accepted.status();
    return accepted->job.name();
  }

  void Pass(absl::Duration duration) {
    now_ += duration;
    manager_->Tick();
  }

  // From now on a mesh's first byte says, in hundreds, how much memory it needs, and its second one for how many
  // seconds.
  void EstimateByContent() {
    options_.estimate = [](std::string_view draco, std::int64_t, const v1::MeshSize&,
                           const v1::UnwrapOptions&) -> absl::StatusOr<JobNeeds> {
      JobNeeds needs;
      needs.memory_bytes = 100 * (draco[0] - '0');
      needs.run_seconds = draco[1] - '0';
      needs.size.set_triangles(draco[0] - '0');
      return needs;
    };
  }
};

TEST_F(JobLimitsTest, CrashedWorkIsTriedTwiceMoreThenFails) {
  const std::string name = Create();
  Take();
  manager_->source()->ReportProgress(name, attempt_, Iteration(3));
  Lose(name);
  EXPECT_EQ(State(name), v1::JOB_STATE_QUEUED);
  EXPECT_FALSE(manager_->Get(caller_, name)->has_progress());
  const int first = attempt_;
  EXPECT_EQ(Take(), name);
  EXPECT_NE(attempt_, first);
  EXPECT_EQ(manager_->Get(caller_, name)->attempts(), 2);
  manager_->source()->ReportResult(name, first, Success("late"), *Blob::Copy("late"));
  EXPECT_EQ(State(name), v1::JOB_STATE_RUNNING) << "the first worker is no longer listened to";
  Lose(name);
  EXPECT_EQ(State(name), v1::JOB_STATE_QUEUED);
  EXPECT_EQ(Take(), name);
  Lose(name);
  EXPECT_EQ(State(name), v1::JOB_STATE_FAILED);
  EXPECT_EQ(ErrorReason(name), "WORKER_CRASHED");
  EXPECT_THAT(manager_->Get(caller_, name)->error().message(), HasSubstr("3 attempts"));
  google::rpc::ErrorInfo info;
  manager_->Get(caller_, name)->error().details(0).UnpackTo(&info);
  EXPECT_EQ(info.metadata().at("attempts"), "3");
  EXPECT_EQ(info.metadata().at("signal"), "SIGSEGV");
}

// The next attempt would need as much.
TEST_F(JobLimitsTest, WorkThatDiesOfMemoryIsNotTriedAgain) {
  const std::string name = Create();
  Take();
  manager_->source()->ReportLost(name, attempt_, {"OUT_OF_MEMORY", "the worker was killed", {{"signal", "SIGKILL"}}});
  EXPECT_EQ(State(name), v1::JOB_STATE_FAILED);
  EXPECT_EQ(ErrorReason(name), "OUT_OF_MEMORY");
  EXPECT_EQ(manager_->Get(caller_, name)->attempts(), 1);
  EXPECT_EQ(manager_->Get(caller_, name)->error().code(), static_cast<int>(absl::StatusCode::kResourceExhausted));
}

TEST_F(JobLimitsTest, CrashedWorkComesBeforeWhatCameLater) {
  const std::string first = Create();
  Take();
  now_ += absl::Seconds(1);
  Create();
  Lose(first);
  EXPECT_EQ(Take(), first);
}

TEST_F(JobLimitsTest, WorkerThatDiesOfACancellationCancels) {
  const std::string name = Create();
  Take();
  manager_->Cancel(caller_, name).IgnoreError();
  EXPECT_EQ(manager_->source()->ObeyBy(name, attempt_), now_ + options_.obey_limit);
  Lose(name);
  EXPECT_EQ(State(name), v1::JOB_STATE_CANCELLED);
  EXPECT_EQ(manager_->source()->ObeyBy(name, attempt_), absl::InfinitePast());
}

TEST_F(JobLimitsTest, LimitsOfJobsThatEndedMeanNothing) {
  std::vector<std::string> names;
  for (int i = 0; i < 2; ++i) {
    names.push_back(CreateWith([](JobRequest* request) {
      *request->scheduling.mutable_timeout() = TimeUtil::SecondsToDuration(86'400);
      *request->scheduling.mutable_compute_budget() = TimeUtil::SecondsToDuration(3'600);
    }));
  }
  EXPECT_EQ(Take(), names[0]);
  Succeed(names[0]);
  manager_->Cancel(caller_, names[1]).IgnoreError();
  Pass(absl::Hours(48));
  EXPECT_TRUE(store_->EndOverdue({}, 10)->empty());
  EXPECT_EQ(State(names[0]), v1::JOB_STATE_SUCCEEDED);
  EXPECT_EQ(State(names[1]), v1::JOB_STATE_CANCELLED);
}

TEST_F(JobLimitsTest, TimeoutEndsAJobThatWaits) {
  const std::string name =
      CreateWith([](JobRequest* request) { *request->scheduling.mutable_timeout() = TimeUtil::SecondsToDuration(10); });
  Pass(absl::Seconds(9));
  EXPECT_EQ(State(name), v1::JOB_STATE_QUEUED);
  Pass(absl::Seconds(1));
  EXPECT_EQ(State(name), v1::JOB_STATE_FAILED);
  EXPECT_EQ(ErrorReason(name), "DEADLINE_EXCEEDED");
}

TEST_F(JobLimitsTest, TimeoutCancelsAJobThatRuns) {
  const std::string name =
      CreateWith([](JobRequest* request) { *request->scheduling.mutable_timeout() = TimeUtil::SecondsToDuration(10); });
  Take();
  const auto link = std::make_shared<NotingLink>();
  manager_->source()->SetLink(name, attempt_, link);
  Pass(absl::Seconds(10));
  EXPECT_EQ(State(name), v1::JOB_STATE_STOPPING);
  ASSERT_THAT(link->sent, SizeIs(1));
  EXPECT_TRUE(link->sent[0].has_cancel());
  Report(name, Cancelled());
  EXPECT_EQ(ErrorReason(name), "DEADLINE_EXCEEDED");
}

TEST_F(JobLimitsTest, StopKeepsWhatTheWorkerDelivers) {
  const std::string name = Create();
  Take();
  const auto link = std::make_shared<NotingLink>();
  manager_->source()->SetLink(name, attempt_, link);
  EXPECT_EQ(manager_->Stop(caller_, name)->state(), v1::JOB_STATE_STOPPING);
  EXPECT_TRUE(manager_->Stop(caller_, name)->stop_requested());
  ASSERT_THAT(link->sent, SizeIs(1));
  EXPECT_TRUE(link->sent[0].has_stop());
  Succeed(name);
  EXPECT_EQ(State(name), v1::JOB_STATE_SUCCEEDED);
  EXPECT_EQ(manager_->Stop(caller_, name)->state(), v1::JOB_STATE_SUCCEEDED);
}

TEST_F(JobLimitsTest, StopOfAQueuedJobWaitsForItsTurn) {
  const std::string name = Create();
  EXPECT_EQ(manager_->Stop(caller_, name)->state(), v1::JOB_STATE_QUEUED);
  Take();
  const auto link = std::make_shared<NotingLink>();
  manager_->source()->SetLink(name, attempt_, link);
  ASSERT_THAT(link->sent, SizeIs(1));
  EXPECT_TRUE(link->sent[0].has_stop());
}

TEST_F(JobLimitsTest, CancelAfterStop) {
  const std::string name = Create();
  Take();
  const auto link = std::make_shared<NotingLink>();
  manager_->source()->SetLink(name, attempt_, link);
  manager_->Stop(caller_, name).IgnoreError();
  EXPECT_EQ(manager_->Cancel(caller_, name)->state(), v1::JOB_STATE_STOPPING);
  EXPECT_TRUE(link->sent.back().has_cancel());
  Succeed(name);
  EXPECT_EQ(State(name), v1::JOB_STATE_CANCELLED);
}

TEST_F(JobLimitsTest, BudgetStopsFromTheStartOfTheRun) {
  const std::string name = CreateWith(
      [](JobRequest* request) { *request->scheduling.mutable_compute_budget() = TimeUtil::SecondsToDuration(5); });
  Pass(absl::Seconds(60));
  EXPECT_FALSE(manager_->Get(caller_, name)->stop_requested());
  Take();
  Pass(absl::Seconds(5));
  EXPECT_EQ(State(name), v1::JOB_STATE_STOPPING);
  EXPECT_TRUE(manager_->Get(caller_, name)->stop_requested());
}

TEST_F(JobLimitsTest, RefusesNonsense) {
  const auto field_of = [this](const std::function<void(v1::Scheduling*)>& change) {
    JobRequest request = Request();
    change(&request.scheduling);
    return ErrorInfoOf(manager_->Create(caller_, std::move(request)).status()).metadata["field"];
  };
  EXPECT_EQ(field_of([](v1::Scheduling* s) { s->mutable_timeout()->set_seconds(0); }), "scheduling.timeout");
  EXPECT_EQ(field_of([](v1::Scheduling* s) { s->mutable_compute_budget()->set_seconds(-1); }),
            "scheduling.compute_budget");
  EXPECT_EQ(field_of([](v1::Scheduling* s) { s->set_priority(static_cast<v1::Priority>(9)); }), "scheduling.priority");
}

// Found by tests/fuzz: times beyond 292 years overflowed, so that a job of 585 years was out of time at once.
TEST_F(JobLimitsTest, RefusesTimesThatCannotBeCounted) {
  const auto reason_of = [this](std::int64_t seconds, std::int32_t nanos) {
    JobRequest request = Request();
    request.scheduling.mutable_timeout()->set_seconds(seconds);
    request.scheduling.mutable_timeout()->set_nanos(nanos);
    return ErrorInfoOf(manager_->Create(caller_, std::move(request)).status()).reason;
  };
  EXPECT_EQ(reason_of(18'446'744'074, 0), "REQUEST_INVALID");
  EXPECT_EQ(reason_of(std::numeric_limits<std::int64_t>::max(), 0), "REQUEST_INVALID");
  EXPECT_EQ(reason_of(1, -1), "REQUEST_INVALID");
  EXPECT_EQ(reason_of(0, 1'000'000'000), "REQUEST_INVALID");
  EXPECT_EQ(reason_of(90 * 365 * 86'400LL, 0), "");
}

TEST_F(JobLimitsTest, HigherPriorityGoesFirst) {
  options_.limits.queue_capacity = 5;
  Restart();
  const std::string low = CreateWith([](JobRequest* r) { r->scheduling.set_priority(v1::PRIORITY_LOW); });
  const std::string normal = Create();
  const std::string high = CreateWith([](JobRequest* r) { r->scheduling.set_priority(v1::PRIORITY_HIGH); });
  EXPECT_EQ(manager_->Get(caller_, low)->queue_position(), 2);
  EXPECT_THAT((std::vector<std::string>{Take(), Take(), Take()}), ElementsAre(high, normal, low));
}

TEST_F(JobLimitsTest, CallerThatComesBackWithinTheGraceKeepsItsJob) {
  options_.limits.reattach_grace = absl::Seconds(10);
  Restart();
  auto accepted = manager_->Create(caller_, Request("r1", true));
  const std::string name = accepted->job.name();
  accepted->attachment.Release();
  Pass(absl::Seconds(9));
  EXPECT_EQ(State(name), v1::JOB_STATE_QUEUED);
  auto watched = manager_->Watch(caller_, name, true, false);
  Pass(absl::Seconds(20));
  EXPECT_EQ(State(name), v1::JOB_STATE_QUEUED);
  watched->attachment.Release();
  Pass(absl::Seconds(10));
  EXPECT_EQ(State(name), v1::JOB_STATE_CANCELLED);
}

TEST_F(JobLimitsTest, CallerWhoseTimeIsUpGetsNoGrace) {
  options_.limits.reattach_grace = absl::Seconds(10);
  Restart();
  auto accepted = manager_->Create(caller_, Request("r1", true));
  accepted->attachment.Release(Parting::kForGood);
  EXPECT_EQ(State(accepted->job.name()), v1::JOB_STATE_CANCELLED);
}

TEST_F(JobLimitsTest, CallerThatWasToldTheEndWritesNothing) {
  auto accepted = manager_->Create(caller_, Request("r1", true));
  accepted->attachment.Release(Parting::kJobEnded);
  EXPECT_EQ(State(accepted->job.name()), v1::JOB_STATE_QUEUED) << "as the store was told when it was accepted";
}

TEST_F(JobLimitsTest, WatchersAloneDoNotKeepAJob) {
  auto accepted = manager_->Create(caller_, Request("r1", true));
  const auto watched = manager_->Watch(caller_, accepted->job.name(), false, false);
  accepted->attachment.Release();
  EXPECT_EQ(State(accepted->job.name()), v1::JOB_STATE_CANCELLED);
}

TEST_F(JobLimitsTest, JobsWaitForMemory) {
  EstimateByContent();
  options_.memory_bytes = 500;
  options_.workers = 2;
  Restart();
  const auto create = [this](const std::string& mesh) {
    return CreateWith([&](JobRequest* request) { request->bytes = mesh; });
  };
  const std::string first = create("31a");
  const std::string second = create("31b");
  EXPECT_EQ(manager_->Get(caller_, second)->memory_bytes(), 300);
  EXPECT_EQ(Take(), first);
  std::string taken;
  std::thread worker([&] { taken = Take(); });
  std::this_thread::sleep_for(std::chrono::milliseconds(20));
  EXPECT_EQ(State(second), v1::JOB_STATE_QUEUED) << "a worker is free, memory is not";
  Succeed(first);
  worker.join();
  EXPECT_EQ(taken, second);
}

TEST_F(JobLimitsTest, AWorkerMayTakeWhatIsReservedAndNoMore) {
  EstimateByContent();
  Restart();
  CreateWith([](JobRequest* request) { request->bytes = "31a"; });
  const std::optional<JobAssignment> assignment = TakeNext();
  EXPECT_EQ(manager_->Stats().reserved_memory_bytes, 300);
  EXPECT_EQ(assignment->request.memory_bytes(), 300);
}

// The counts of a mesh do not tell how many charts it makes.
TEST_F(JobLimitsTest, WorkThatNeedsMoreThanWasReservedGetsMore) {
  EstimateByContent();
  options_.memory_bytes = 1000;
  Restart();
  const auto create = [this](const std::string& mesh) {
    return CreateWith([&](JobRequest* request) { request->bytes = mesh; });
  };
  // Of whatever is next: what was reserved for it.
  const auto run_out = [this](const std::string& name) {
    const std::optional<JobAssignment> assignment = TakeNext();
    EXPECT_EQ(assignment->name, name);
    attempt_ = assignment->attempt;
    Report(name, Failure(MakeError(absl::StatusCode::kResourceExhausted, "OUT_OF_MEMORY", "too little")));
    return assignment->request.memory_bytes();
  };
  const std::string large = create("31a");
  EXPECT_EQ(run_out(large), 300);
  EXPECT_EQ(State(large), v1::JOB_STATE_QUEUED);
  Resume();
  EXPECT_EQ(run_out(large), 600);
  EXPECT_EQ(run_out(large), 1000) << "no job may have more";
  EXPECT_EQ(State(large), v1::JOB_STATE_FAILED);
  EXPECT_EQ(ErrorReason(large), "OUT_OF_MEMORY");

  const std::string small = create("11b");
  create("11c");  // which comes after it, however often
  EXPECT_EQ(run_out(small), 100);
  EXPECT_EQ(run_out(small), 200);
  EXPECT_EQ(run_out(small), 400);
  EXPECT_EQ(State(small), v1::JOB_STATE_FAILED) << "four times the estimate is the end";
}

TEST_F(JobLimitsTest, WhatCanNeverRunIsRefused) {
  EstimateByContent();
  options_.memory_bytes = 500;
  options_.max_triangles = 5;
  Restart();
  const auto refusal = [this](const std::string& mesh) {
    JobRequest request = Request();
    request.bytes = mesh;
    return manager_->Create(caller_, std::move(request)).status();
  };
  const ErrorInfo memory = ErrorInfoOf(refusal("61a"));
  EXPECT_EQ(memory.reason, "MESH_TOO_LARGE");
  EXPECT_EQ(memory.metadata.at("triangles"), "6");
  EXPECT_EQ(memory.metadata.at("limit"), "5");
  options_.max_triangles = 100;
  Restart();
  EXPECT_EQ(ErrorInfoOf(refusal("61a")).reason, "MEMORY_LIMIT");
  EXPECT_EQ(ErrorInfoOf(refusal("61a")).metadata.at("limit"), "500");
}

TEST_F(JobLimitsTest, RetryDelayIsWhenAPlaceGetsFree) {
  EstimateByContent();
  options_.limits.queue_capacity = 1;
  Restart();
  const auto create = [this](const std::string& mesh) {
    JobRequest request = Request();
    request.bytes = mesh;
    return manager_->Create(caller_, std::move(request)).status();
  };
  ASSERT_TRUE(create("18a").ok());
  Take();
  ASSERT_TRUE(create("18b").ok());
  now_ += absl::Seconds(3);
  google::rpc::RetryInfo retry;
  ASSERT_TRUE(ToRpcStatus(create("18c")).details(1).UnpackTo(&retry));
  EXPECT_EQ(retry.retry_delay().seconds(), 5) << "the first job takes 8 s, 3 of them are over";

  JobRequest request;
  request.bytes = "24x";
  const v1::JobEstimate estimate = *manager_->Estimate(caller_, request, 0, v1::MeshSize());
  EXPECT_EQ(estimate.memory_bytes(), 200);
  EXPECT_EQ(estimate.run_time().seconds(), 4);
  EXPECT_EQ(estimate.queue_time().seconds(), 13);
  google::rpc::ErrorInfo info;
  ASSERT_TRUE(estimate.refusal().details(0).UnpackTo(&info));
  EXPECT_EQ(info.reason(), "QUEUE_FULL");
}

TEST_F(JobLimitsTest, EstimateNeedsAMesh) {
  EXPECT_EQ(Reason(manager_->Estimate(caller_, JobRequest(), 0, v1::MeshSize()).status()), "MESH_MISSING");
}

}  // namespace
}  // namespace planish
