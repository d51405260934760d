#include "server/jobs/job_manager.h"

#include <utility>

#include "core/base/error.h"
#include "gmock/gmock.h"
#include "google/rpc/error_details.pb.h"
#include "gtest/gtest.h"
#include "server/link/rpc_status.h"
#include "tests/server/testing/fake_workers.h"

namespace planish {
namespace {

using ::testing::ElementsAre;
using ::testing::IsEmpty;
using ::testing::SizeIs;

// A worker's end that only notes what it is sent.
class NotingLink : public WorkerLink {
 public:
  void Send(worker::v1::ToWorker message) override { sent.push_back(std::move(message)); }
  std::optional<worker::v1::FromWorker> Receive() override { return std::nullopt; }
  void Close() override { closed = true; }

  std::vector<worker::v1::ToWorker> sent;
  bool closed = false;
};

std::string Reason(const absl::Status& status) {
  return ErrorInfoOf(status).reason;
}

worker::v1::WorkResult Success(const std::string& uv) {
  return SuccessMessage(uv).result();
}

// The test plays the workers: no threads.
class JobManagerTest : public ::testing::Test {
 protected:
  JobManagerTest() {
    options_.clock = [this] { return now_; };
    options_.new_id = [this] { return "id" + std::to_string(++ids_); };
    options_.on_transition = [this](const v1::Job& job) { transitions_.push_back(StateName(job.state())); };
    options_.queue_capacity = 2;
    options_.retry_delay = absl::Seconds(3);
    Restart();
  }

  void Restart() { manager_ = std::make_unique<JobManager>(options_, NewMemoryJobStore()); }

  static JobRequest Request(const std::string& request_id = "", bool attached = false) {
    JobRequest request;
    request.draco = "mesh";
    request.request_id = request_id;
    request.attached = attached;
    return request;
  }

  std::string Create(const std::string& request_id = "") {
    const auto accepted = manager_->Create(Request(request_id));
    EXPECT_TRUE(accepted.ok()) << accepted.status();
    return accepted.ok() ? accepted->job.name() : "";
  }

  // Creates a job and brings it to its end.
  std::string CreateEnded(const std::string& uv = "uv") {
    const std::string name = Create();
    EXPECT_EQ(manager_->TakeNext()->name, name);
    manager_->ReportResult(name, Success(uv));
    return name;
  }

  v1::JobState State(const std::string& name) { return manager_->Get(name)->state(); }

  std::vector<v1::JobEvent> Events(const std::string& name) {
    const auto log = *manager_->Watch(name);
    std::vector<v1::JobEvent> events;
    while (auto event = log->ReadAfter(events.empty() ? 0 : events.back().sequence()).event) events.push_back(*event);
    return events;
  }

  absl::Time now_ = absl::FromUnixSeconds(1'000'000);
  int ids_ = 0;
  std::vector<std::string> transitions_;
  JobManagerOptions options_;
  std::unique_ptr<JobManager> manager_;
};

TEST_F(JobManagerTest, ALifeInEvents) {
  JobRequest request = Request();
  request.label = "spot.obj";
  request.options.set_tolerance(1e-6);
  const auto accepted = manager_->Create(std::move(request));
  ASSERT_TRUE(accepted.ok());
  const std::string name = accepted->job.name();
  EXPECT_EQ(accepted->job.state(), v1::JOB_STATE_QUEUED);
  EXPECT_EQ(accepted->job.mesh_bytes(), 4);

  now_ += absl::Seconds(2);
  const auto assignment = manager_->TakeNext();
  ASSERT_TRUE(assignment.has_value());
  EXPECT_EQ(assignment->name, name);
  EXPECT_EQ(assignment->request.job(), name);
  EXPECT_EQ(assignment->request.draco(), "mesh");
  EXPECT_EQ(assignment->request.options().tolerance(), 1e-6);
  manager_->ReportProgress(name, ProgressMessage(1).event().progress());
  EXPECT_EQ(manager_->Get(name)->progress().newton_iteration(), 1);
  now_ += absl::Seconds(5);
  manager_->ReportResult(name, Success("uvuvuv"));

  const v1::Job job = *manager_->Get(name);
  EXPECT_EQ(job.state(), v1::JOB_STATE_SUCCEEDED);
  EXPECT_EQ(job.label(), "spot.obj");
  EXPECT_EQ(job.report().seconds().queue(), 2);
  EXPECT_EQ(job.end_time().seconds() - job.start_time().seconds(), 5);
  EXPECT_FALSE(job.has_progress());
  const auto events = Events(name);
  ASSERT_THAT(events, SizeIs(4));
  EXPECT_EQ(events[0].job().state(), v1::JOB_STATE_QUEUED);
  EXPECT_EQ(events[1].job().state(), v1::JOB_STATE_RUNNING);
  EXPECT_EQ(events[2].progress().newton_iteration(), 1);
  EXPECT_EQ(events[3].job().state(), v1::JOB_STATE_SUCCEEDED);
  EXPECT_TRUE(events[3].job().has_report());
  for (std::size_t i = 0; i < events.size(); ++i) EXPECT_EQ(events[i].sequence(), static_cast<std::int64_t>(i) + 1);
  EXPECT_EQ(*(*manager_->Watch(name))->uv(), "uvuvuv");
  EXPECT_THAT(transitions_, ElementsAre("QUEUED", "RUNNING", "SUCCEEDED"));
}

TEST_F(JobManagerTest, RefusesBadRequests) {
  options_.max_mesh_bytes = 4;
  options_.validate_options = [](const v1::UnwrapOptions& options) {
    return options.tolerance() == 7 ? MakeError(absl::StatusCode::kInvalidArgument, "OPTIONS_INVALID", "tolerance")
                                    : absl::OkStatus();
  };
  Restart();
  const auto reason_of = [this](JobRequest request) { return Reason(manager_->Create(std::move(request)).status()); };
  JobRequest request = Request();
  request.draco.clear();
  EXPECT_EQ(reason_of(request), "MESH_MISSING");
  request.draco = "12345";
  EXPECT_EQ(reason_of(request), "MESH_TOO_LARGE");
  request = Request();
  request.request_id = std::string(129, 'x');
  EXPECT_EQ(ErrorInfoOf(manager_->Create(request).status()).metadata.at("field"), "request_id");
  request = Request();
  request.label = std::string(257, 'x');
  EXPECT_EQ(ErrorInfoOf(manager_->Create(request).status()).metadata.at("field"), "label");
  request = Request();
  request.options.set_tolerance(7);
  EXPECT_EQ(reason_of(request), "OPTIONS_INVALID");
  EXPECT_THAT(manager_->List(0, "", v1::JOB_STATE_UNSPECIFIED)->jobs, IsEmpty());
}

TEST_F(JobManagerTest, SeamsTravelBesideTheMeshAndCountAsPartOfIt) {
  options_.max_mesh_bytes = 16;
  Restart();
  JobRequest request = Request();
  request.seam_corners = {5, 0};
  request.uncut_corners = {2};
  const auto accepted = manager_->Create(request);
  ASSERT_TRUE(accepted.ok()) << accepted.status();
  EXPECT_EQ(accepted->job.mesh_bytes(), 16);
  const auto assignment = manager_->TakeNext();
  EXPECT_THAT(assignment->request.seam_corners(), ElementsAre(5, 0));
  EXPECT_THAT(assignment->request.uncut_corners(), ElementsAre(2));

  request.seam_corners = {5, 0, 7};
  EXPECT_EQ(Reason(manager_->Create(request).status()), "MESH_TOO_LARGE");

  request.seam_corners = {5, -3};
  const ErrorInfo info = ErrorInfoOf(manager_->Create(request).status());
  EXPECT_EQ(info.reason, "OPTIONS_INVALID");
  EXPECT_EQ(info.metadata.at("field"), "seam_corners");
  EXPECT_EQ(info.metadata.at("corner"), "-3");
  request.seam_corners.clear();
  request.uncut_corners = {-4};
  EXPECT_EQ(ErrorInfoOf(manager_->Create(request).status()).metadata.at("field"), "uncut_corners");
}

TEST_F(JobManagerTest, FullQueueSaysWhenToRetry) {
  Create();
  ASSERT_TRUE(manager_->TakeNext().has_value());
  Create();
  Create();
  const absl::Status status = manager_->Create(Request()).status();
  EXPECT_EQ(status.code(), absl::StatusCode::kResourceExhausted);
  EXPECT_EQ(Reason(status), "QUEUE_FULL");
  google::rpc::RetryInfo retry;
  ASSERT_TRUE(ToRpcStatus(status).details(1).UnpackTo(&retry));
  EXPECT_EQ(retry.retry_delay().seconds(), 3);
}

TEST_F(JobManagerTest, IdleWorkersCountAsRoom) {
  options_.queue_capacity = 0;
  options_.workers = 2;
  Restart();
  Create();
  Create();
  EXPECT_EQ(Reason(manager_->Create(Request()).status()), "QUEUE_FULL");
  manager_->ReportResult(manager_->TakeNext()->name, Success("uv"));
  Create();
}

TEST_F(JobManagerTest, QueuePositionCountsDown) {
  const std::string first = Create();
  const std::string second = Create();
  EXPECT_EQ(manager_->Get(second)->queue_position(), 1);
  EXPECT_EQ(manager_->TakeNext()->name, first);
  EXPECT_EQ(manager_->Get(second)->queue_position(), 0);
}

TEST_F(JobManagerTest, SameRequestIdIsTheSameJob) {
  const std::string name = Create("r1");
  EXPECT_EQ(Create("r1"), name);
  EXPECT_NE(Create("r2"), name);
  manager_->TakeNext();
  manager_->ReportResult(name, Success("uv"));
  EXPECT_EQ(Create("r1"), name) << "also after its end, and when the queue is full";
  ASSERT_TRUE(manager_->Delete(name).ok());
  EXPECT_NE(Create("r1"), name);
}

TEST_F(JobManagerTest, CancelWhileQueued) {
  const std::string name = Create();
  const std::string other = Create();
  EXPECT_EQ(manager_->Cancel(name)->state(), v1::JOB_STATE_CANCELLED);
  EXPECT_EQ(manager_->Cancel(name)->state(), v1::JOB_STATE_CANCELLED);
  EXPECT_THAT(Events(name), SizeIs(2));
  EXPECT_EQ(manager_->TakeNext()->name, other);
}

TEST_F(JobManagerTest, CancelWhileRunningTellsTheWorkerOnce) {
  const std::string name = Create();
  manager_->TakeNext();
  const auto link = std::make_shared<NotingLink>();
  manager_->SetLink(name, link);
  EXPECT_EQ(manager_->Cancel(name)->state(), v1::JOB_STATE_STOPPING);
  EXPECT_EQ(manager_->Cancel(name)->state(), v1::JOB_STATE_STOPPING);
  ASSERT_THAT(link->sent, SizeIs(1));
  EXPECT_TRUE(link->sent[0].has_cancel());
  manager_->ReportResult(name, CancelledMessage().result());
  EXPECT_EQ(State(name), v1::JOB_STATE_CANCELLED);
  EXPECT_EQ(manager_->Cancel(name)->state(), v1::JOB_STATE_CANCELLED);
}

TEST_F(JobManagerTest, CancelBeforeTheWorkerIsKnownReachesIt) {
  const std::string name = Create();
  manager_->TakeNext();
  manager_->Cancel(name).IgnoreError();
  const auto link = std::make_shared<NotingLink>();
  manager_->SetLink(name, link);
  ASSERT_THAT(link->sent, SizeIs(1));
  EXPECT_TRUE(link->sent[0].has_cancel());
}

TEST_F(JobManagerTest, ResultAfterCancelIsDiscarded) {
  const std::string name = Create();
  manager_->TakeNext();
  manager_->Cancel(name).IgnoreError();
  manager_->ReportResult(name, Success("uv"));
  const v1::Job job = *manager_->Get(name);
  EXPECT_EQ(job.state(), v1::JOB_STATE_CANCELLED);
  EXPECT_FALSE(job.has_report());
  EXPECT_FALSE(job.has_uv());
  EXPECT_EQ((*manager_->Watch(name))->uv(), nullptr);
}

TEST_F(JobManagerTest, WorkersFailure) {
  const std::string name = Create();
  manager_->TakeNext();
  const absl::Status closed = MakeError(absl::StatusCode::kInvalidArgument, "MESH_CLOSED", "no boundary");
  manager_->ReportResult(name, FailureMessage(closed).result());
  const v1::Job job = *manager_->Get(name);
  EXPECT_EQ(job.state(), v1::JOB_STATE_FAILED);
  EXPECT_EQ(job.error().message(), "no boundary");
  manager_->ReportResult(name, Success("uv"));
  manager_->ReportLost(name, "late");
  manager_->ReportProgress(name, v1::Progress());
  EXPECT_EQ(State(name), v1::JOB_STATE_FAILED) << "what a worker says after the end changes nothing";
  EXPECT_THAT(Events(name), SizeIs(3));
}

TEST_F(JobManagerTest, WorkersThatBreakTheProtocolFailTheJob) {
  const auto run = [this](const worker::v1::WorkResult& result) {
    const std::string name = Create();
    manager_->TakeNext();
    manager_->ReportResult(name, result);
    return *manager_->Get(name);
  };
  worker::v1::WorkResult result = Success("uv");
  result.mutable_uv()->set_total_bytes(3);
  EXPECT_EQ(run(result).state(), v1::JOB_STATE_FAILED);
  const v1::Job unasked = run(CancelledMessage().result());
  EXPECT_EQ(unasked.state(), v1::JOB_STATE_FAILED);
  EXPECT_EQ(unasked.error().code(), static_cast<int>(absl::StatusCode::kInternal));
}

TEST_F(JobManagerTest, DeleteNeedsAnEndedJob) {
  const std::string name = Create();
  EXPECT_EQ(Reason(manager_->Delete(name)), "JOB_NOT_FINISHED");
  manager_->Cancel(name).IgnoreError();
  EXPECT_TRUE(manager_->Delete(name).ok());
  EXPECT_EQ(Reason(manager_->Delete(name)), "JOB_NOT_FOUND");
  EXPECT_EQ(Reason(manager_->Get(name).status()), "JOB_NOT_FOUND");
  EXPECT_EQ(Reason(manager_->Watch(name).status()), "JOB_NOT_FOUND");
  EXPECT_EQ(Reason(manager_->Cancel(name).status()), "JOB_NOT_FOUND");
}

TEST_F(JobManagerTest, WatchersKeepWhatWasDeleted) {
  const std::string name = CreateEnded("result");
  const auto events = *manager_->Watch(name);
  ASSERT_TRUE(manager_->Delete(name).ok());
  EXPECT_EQ(*events->uv(), "result");
}

TEST_F(JobManagerTest, ListsNewestFirstInPages) {
  options_.queue_capacity = 10;
  Restart();
  std::vector<std::string> names;
  for (int i = 0; i < 5; ++i) names.push_back(Create());
  const auto first = manager_->List(2, "", v1::JOB_STATE_UNSPECIFIED);
  ASSERT_TRUE(first.ok());
  ASSERT_THAT(first->jobs, SizeIs(2));
  EXPECT_EQ(first->jobs[0].name(), names[4]);
  EXPECT_EQ(first->jobs[1].name(), names[3]);
  Create();
  const auto second = manager_->List(10, first->next_page_token, v1::JOB_STATE_UNSPECIFIED);
  ASSERT_TRUE(second.ok());
  ASSERT_THAT(second->jobs, SizeIs(3)) << "jobs that came meanwhile do not shift the page";
  EXPECT_EQ(second->jobs[0].name(), names[2]);
  EXPECT_TRUE(second->next_page_token.empty());
}

TEST_F(JobManagerTest, ListsOneState) {
  const std::string ended = CreateEnded();
  Create();
  const auto page = manager_->List(0, "", v1::JOB_STATE_SUCCEEDED);
  ASSERT_TRUE(page.ok());
  ASSERT_THAT(page->jobs, SizeIs(1));
  EXPECT_EQ(page->jobs[0].name(), ended);
  EXPECT_FALSE(page->jobs[0].has_report());
}

TEST_F(JobManagerTest, RefusesForeignPageTokens) {
  Create();
  Create();
  const std::string token = manager_->List(1, "", v1::JOB_STATE_UNSPECIFIED)->next_page_token;
  EXPECT_FALSE(manager_->List(1, "garbage", v1::JOB_STATE_UNSPECIFIED).ok());
  EXPECT_FALSE(manager_->List(1, token, v1::JOB_STATE_QUEUED).ok());
  EXPECT_FALSE(manager_->List(-1, "", v1::JOB_STATE_UNSPECIFIED).ok());
  Restart();
  EXPECT_EQ(Reason(manager_->List(1, token, v1::JOB_STATE_UNSPECIFIED).status()), "REQUEST_INVALID");
}

TEST_F(JobManagerTest, KeepsTheNewestEndedJobs) {
  options_.retained_jobs = 2;
  Restart();
  const std::string first = CreateEnded();
  const std::string second = CreateEnded();
  const std::string third = CreateEnded();
  EXPECT_FALSE(manager_->Get(first).ok());
  EXPECT_TRUE(manager_->Get(second).ok());
  EXPECT_TRUE(manager_->Get(third).ok());
}

TEST_F(JobManagerTest, KeepsSoManyBytesOfUv) {
  options_.retained_bytes = 10;
  Restart();
  const std::string first = CreateEnded("123456");
  const std::string second = CreateEnded("1234");
  EXPECT_TRUE(manager_->Get(first).ok());
  const std::string large = CreateEnded("12345678901234");
  EXPECT_FALSE(manager_->Get(first).ok());
  EXPECT_FALSE(manager_->Get(second).ok());
  EXPECT_TRUE(manager_->Get(large).ok()) << "the last one stays, so that its caller can fetch it";
  CreateEnded("1");
  EXPECT_FALSE(manager_->Get(large).ok());
}

TEST_F(JobManagerTest, AbandonedJobIsCancelledAndFreesItsRequestId) {
  auto accepted = manager_->Create(Request("r1", true));
  ASSERT_TRUE(accepted.ok());
  const std::string name = accepted->job.name();
  accepted->attachment.Release();
  EXPECT_EQ(State(name), v1::JOB_STATE_CANCELLED);
  EXPECT_NE(Create("r1"), name);
}

TEST_F(JobManagerTest, JobLivesWhileOneCallerIsAttached) {
  auto first = manager_->Create(Request("r1", true));
  const std::string name = first->job.name();
  {
    const auto retry = manager_->Create(Request("r1", true));
    EXPECT_EQ(retry->job.name(), name);
    first->attachment.Release();
    EXPECT_EQ(State(name), v1::JOB_STATE_QUEUED);
  }
  EXPECT_EQ(State(name), v1::JOB_STATE_CANCELLED);
}

TEST_F(JobManagerTest, DetachedJobsLiveOn) {
  std::string name;
  {
    const auto attached = manager_->Create(Request("r1", true));
    name = attached->job.name();
    EXPECT_EQ(Create("r1"), name);
  }
  EXPECT_EQ(State(name), v1::JOB_STATE_QUEUED);
}

TEST_F(JobManagerTest, DrainRefusesNewJobsAndFinishesOldOnes) {
  const std::string running = Create();
  manager_->TakeNext();
  const std::string queued = Create("r1");
  int idle = 0;
  manager_->Drain([&idle] { ++idle; });
  const absl::Status refused = manager_->Create(Request()).status();
  EXPECT_EQ(refused.code(), absl::StatusCode::kUnavailable);
  EXPECT_EQ(Reason(refused), "DRAINING");
  EXPECT_EQ(ToRpcStatus(refused).details_size(), 2);
  EXPECT_EQ(Create("r1"), queued) << "a retry finds its job";
  manager_->ReportResult(running, Success("uv"));
  EXPECT_EQ(idle, 0);
  EXPECT_EQ(manager_->TakeNext()->name, queued);
  manager_->ReportResult(queued, Success("uv"));
  EXPECT_EQ(idle, 1);
  manager_->Stop();
  EXPECT_FALSE(manager_->TakeNext().has_value());
}

TEST_F(JobManagerTest, DrainOfAnIdleServerIsOver) {
  int idle = 0;
  manager_->Drain([&idle] { ++idle; });
  EXPECT_EQ(idle, 1);
}

TEST_F(JobManagerTest, EndOfGraceCancelsEverything) {
  const std::string ended = CreateEnded();
  const std::string running = Create();
  manager_->TakeNext();
  const auto link = std::make_shared<NotingLink>();
  manager_->SetLink(running, link);
  const std::string queued = Create();
  int idle = 0;
  manager_->Drain([&idle] { ++idle; });
  manager_->CancelAll();
  EXPECT_EQ(State(ended), v1::JOB_STATE_SUCCEEDED);
  EXPECT_EQ(State(queued), v1::JOB_STATE_CANCELLED);
  EXPECT_EQ(State(running), v1::JOB_STATE_STOPPING);
  EXPECT_EQ(idle, 0);
  manager_->CloseLinks();
  EXPECT_TRUE(link->closed);
  manager_->ReportLost(running, "given up");
  EXPECT_EQ(State(running), v1::JOB_STATE_FAILED);
  EXPECT_EQ(idle, 1);
}

TEST_F(JobManagerTest, ReadersMayCallBackWhenTheyAreWoken) {
  const std::string name = Create();
  const auto log = *manager_->Watch(name);
  std::vector<v1::JobState> seen;
  const auto subscription = log->Subscribe([&] { seen.push_back(State(name)); });
  manager_->TakeNext();
  manager_->Cancel(name).IgnoreError();
  manager_->ReportResult(name, CancelledMessage().result());
  EXPECT_THAT(seen, ElementsAre(v1::JOB_STATE_RUNNING, v1::JOB_STATE_STOPPING, v1::JOB_STATE_CANCELLED));
}

}  // namespace
}  // namespace planish
