#include "gmock/gmock.h"
#include "gtest/gtest.h"
#include "tests/server/jobs/job_manager_fixture.h"

namespace planish {
namespace {

using ::testing::ElementsAre;
using ::testing::IsEmpty;
using ::testing::SizeIs;

TEST_F(JobManagerTest, ALifeInEvents) {
  JobRequest request = Request();
  request.labels = {{"file", "spot.obj"}};
  request.options.set_tolerance(1e-6);
  const auto accepted = manager_->Create(caller_, std::move(request));
  ASSERT_TRUE(accepted.ok());
  const std::string name = accepted->job.name();
  EXPECT_EQ(accepted->job.state(), v1::JOB_STATE_QUEUED);
  EXPECT_EQ(accepted->job.mesh_bytes(), 5);

  now_ += absl::Seconds(2);
  const auto assignment = TakeNext();
  ASSERT_TRUE(assignment.has_value());
  EXPECT_EQ(assignment->name, name);
  EXPECT_EQ(assignment->request.job(), name);
  ASSERT_THAT(assignment->blobs, SizeIs(1));
  EXPECT_EQ(assignment->blobs[0]->bytes(), "mesh1");
  attempt_ = assignment->attempt;
  EXPECT_EQ(assignment->request.options().tolerance(), 1e-6);
  manager_->source()->ReportProgress(name, attempt_, Iteration(1));
  EXPECT_EQ(manager_->Get(caller_, name)->progress().newton_iteration(), 1);
  now_ += absl::Seconds(5);
  Succeed(name, "uvuvuv");

  const v1::Job job = *manager_->Get(caller_, name);
  EXPECT_EQ(job.state(), v1::JOB_STATE_SUCCEEDED);
  EXPECT_EQ(job.labels().at("file"), "spot.obj");
  EXPECT_EQ(job.report().times().queue().seconds(), 2);
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
  EXPECT_EQ(Watch(name)->uv()->ReadAll().value(), "uvuvuv");
  EXPECT_THAT(transitions_, ElementsAre("QUEUED", "RUNNING", "SUCCEEDED"));
}

TEST_F(JobManagerTest, RefusesBadRequests) {
  options_.max_mesh_bytes = 8;
  options_.validate_options = [](const v1::UnwrapOptions& options) {
    return options.tolerance() == 7 ? MakeError(absl::StatusCode::kInvalidArgument, "OPTIONS_INVALID", "tolerance")
                                    : absl::OkStatus();
  };
  Restart();
  const auto reason_of = [this](JobRequest request) {
    return Reason(manager_->Create(caller_, std::move(request)).status());
  };
  JobRequest request = Request();
  request.bytes.clear();
  EXPECT_EQ(reason_of(request), "MESH_MISSING");
  request.bytes = "123456789";
  EXPECT_EQ(reason_of(request), "MESH_TOO_LARGE");
  request = Request();
  request.request_id = std::string(129, 'x');
  EXPECT_EQ(ErrorInfoOf(manager_->Create(caller_, request).status()).metadata.at("field"), "request_id");
  request = Request();
  const auto field_of = [this](const std::map<std::string, std::string>& labels) {
    JobRequest labelled = Request();
    labelled.labels = labels;
    const ErrorInfo info = ErrorInfoOf(manager_->Create(caller_, std::move(labelled)).status());
    EXPECT_EQ(info.reason, "REQUEST_INVALID");
    return info.metadata.at("field");
  };
  for (const std::string key : {"", "Key", "1st", "two words", "dotted.key"}) {
    EXPECT_EQ(field_of({{key, "value"}}), "labels") << key;
  }
  EXPECT_EQ(field_of({{std::string(64, 'k'), "value"}}), "labels");
  EXPECT_EQ(field_of({{"key", std::string(257, 'x')}}), "labels");
  std::map<std::string, std::string> many;
  for (int i = 0; i < 33; ++i) many["key" + std::to_string(i)] = "value";
  EXPECT_EQ(field_of(many), "labels");
  request = Request();
  request.options.set_tolerance(7);
  EXPECT_EQ(reason_of(request), "OPTIONS_INVALID");
  EXPECT_THAT(List(0)->jobs, IsEmpty());
}

TEST_F(JobManagerTest, SeamsTravelBesideTheMeshAndCountAsPartOfIt) {
  options_.max_mesh_bytes = 16;
  Restart();
  JobRequest request = Request();
  request.bytes = "mesh";
  request.seam_corners = {5, 0};
  request.uncut_corners = {2};
  const auto accepted = manager_->Create(caller_, request);
  ASSERT_TRUE(accepted.ok()) << accepted.status();
  EXPECT_EQ(accepted->job.mesh_bytes(), 16);
  const auto assignment = TakeNext();
  EXPECT_EQ(assignment->request.seam_corners(), 2);
  EXPECT_EQ(assignment->request.uncut_corners(), 1);
  ASSERT_THAT(assignment->blobs, SizeIs(2));
  EXPECT_EQ(assignment->blobs[1]->bytes(), std::string("\5\0\0\0\0\0\0\0\2\0\0\0", 12));

  request.seam_corners = {5, 0, 7};
  EXPECT_EQ(Reason(manager_->Create(caller_, request).status()), "MESH_TOO_LARGE");

  request.seam_corners = {5, -3};
  const ErrorInfo info = ErrorInfoOf(manager_->Create(caller_, request).status());
  EXPECT_EQ(info.reason, "OPTIONS_INVALID");
  EXPECT_EQ(info.metadata.at("field"), "seam_corners");
  EXPECT_EQ(info.metadata.at("corner"), "-3");
  request.seam_corners.clear();
  request.uncut_corners = {-4};
  EXPECT_EQ(ErrorInfoOf(manager_->Create(caller_, request).status()).metadata.at("field"), "uncut_corners");
}

TEST_F(JobManagerTest, FullQueueSaysWhenToRetry) {
  Create();
  ASSERT_TRUE(TakeNext().has_value());
  Create();
  Create();
  const absl::Status status = manager_->Create(caller_, Request()).status();
  EXPECT_EQ(status.code(), absl::StatusCode::kResourceExhausted);
  EXPECT_EQ(Reason(status), "QUEUE_FULL");
  google::rpc::RetryInfo retry;
  ASSERT_TRUE(ToRpcStatus(status).details(1).UnpackTo(&retry));
  EXPECT_EQ(retry.retry_delay().seconds(), 3);
}

TEST_F(JobManagerTest, IdleWorkersCountAsRoom) {
  options_.limits.queue_capacity = 0;
  options_.workers = 2;
  Restart();
  Create();
  Create();
  EXPECT_EQ(Reason(manager_->Create(caller_, Request()).status()), "QUEUE_FULL");
  Succeed(Take());
  Create();
}

TEST_F(JobManagerTest, QueuePositionCountsDown) {
  const std::string first = Create();
  const std::string second = Create();
  EXPECT_EQ(manager_->Get(caller_, second)->queue_position(), 1);
  EXPECT_EQ(Take(), first);
  EXPECT_EQ(manager_->Get(caller_, second)->queue_position(), 0);
}

TEST_F(JobManagerTest, SameRequestIdIsTheSameJob) {
  const std::string name = Create("r1");
  EXPECT_EQ(Create("r1"), name);
  EXPECT_NE(Create("r2"), name);
  Take();
  Succeed(name);
  EXPECT_EQ(Create("r1"), name) << "also after its end, and when the queue is full";
  ASSERT_TRUE(manager_->Delete(caller_, name).ok());
  EXPECT_NE(Create("r1"), name);
}

TEST_F(JobManagerTest, CancelWhileQueued) {
  const std::string name = Create();
  const std::string other = Create();
  EXPECT_EQ(manager_->Cancel(caller_, name)->state(), v1::JOB_STATE_CANCELLED);
  EXPECT_EQ(manager_->Cancel(caller_, name)->state(), v1::JOB_STATE_CANCELLED);
  EXPECT_THAT(Events(name), SizeIs(2));
  EXPECT_EQ(Take(), other);
}

TEST_F(JobManagerTest, CancelWhileRunningTellsTheWorkerOnce) {
  const std::string name = Create();
  Take();
  const auto link = std::make_shared<NotingLink>();
  manager_->source()->SetLink(name, attempt_, link);
  EXPECT_EQ(manager_->Cancel(caller_, name)->state(), v1::JOB_STATE_STOPPING);
  EXPECT_EQ(manager_->Cancel(caller_, name)->state(), v1::JOB_STATE_STOPPING);
  ASSERT_THAT(link->sent, SizeIs(1));
  EXPECT_TRUE(link->sent[0].has_cancel());
  Report(name, Cancelled());
  EXPECT_EQ(State(name), v1::JOB_STATE_CANCELLED);
  EXPECT_EQ(manager_->Cancel(caller_, name)->state(), v1::JOB_STATE_CANCELLED);
}

TEST_F(JobManagerTest, CancelBeforeTheWorkerIsKnownReachesIt) {
  const std::string name = Create();
  Take();
  manager_->Cancel(caller_, name).IgnoreError();
  const auto link = std::make_shared<NotingLink>();
  manager_->source()->SetLink(name, attempt_, link);
  ASSERT_THAT(link->sent, SizeIs(1));
  EXPECT_TRUE(link->sent[0].has_cancel());
}

TEST_F(JobManagerTest, ResultAfterCancelIsDiscarded) {
  const std::string name = Create();
  Take();
  manager_->Cancel(caller_, name).IgnoreError();
  Succeed(name);
  const v1::Job job = *manager_->Get(caller_, name);
  EXPECT_EQ(job.state(), v1::JOB_STATE_CANCELLED);
  EXPECT_FALSE(job.has_report());
  EXPECT_FALSE(job.has_uv());
  EXPECT_EQ(Watch(name)->uv(), nullptr);
}

TEST_F(JobManagerTest, WorkersFailure) {
  const std::string name = Create();
  Take();
  const absl::Status closed = MakeError(absl::StatusCode::kInvalidArgument, "MESH_CLOSED", "no boundary");
  Report(name, Failure(closed));
  const v1::Job job = *manager_->Get(caller_, name);
  EXPECT_EQ(job.state(), v1::JOB_STATE_FAILED);
  EXPECT_EQ(job.error().message(), "no boundary");
  Succeed(name);
  Lose(name);
  manager_->source()->ReportProgress(name, attempt_, v1::Progress());
  EXPECT_EQ(State(name), v1::JOB_STATE_FAILED) << "what a worker says after the end changes nothing";
  EXPECT_THAT(Events(name), SizeIs(3));
}

TEST_F(JobManagerTest, WorkersThatBreakTheProtocolFailTheJob) {
  const auto run = [this](const worker::v1::WorkResult& result) {
    const std::string name = Create();
    Take();
    Report(name, result, "uv");
    return *manager_->Get(caller_, name);
  };
  worker::v1::WorkResult result = Success("uv");
  result.mutable_uv()->set_total_bytes(3);
  EXPECT_EQ(run(result).state(), v1::JOB_STATE_FAILED);
  const v1::Job unasked = run(Cancelled());
  EXPECT_EQ(unasked.state(), v1::JOB_STATE_FAILED);
  EXPECT_EQ(unasked.error().code(), static_cast<int>(absl::StatusCode::kInternal));
}

TEST_F(JobManagerTest, DeleteNeedsAnEndedJob) {
  const std::string name = Create();
  EXPECT_EQ(Reason(manager_->Delete(caller_, name)), "JOB_NOT_FINISHED");
  manager_->Cancel(caller_, name).IgnoreError();
  EXPECT_TRUE(manager_->Delete(caller_, name).ok());
  EXPECT_EQ(Reason(manager_->Delete(caller_, name)), "JOB_NOT_FOUND");
  EXPECT_EQ(Reason(manager_->Get(caller_, name).status()), "JOB_NOT_FOUND");
  EXPECT_EQ(Reason(manager_->Watch(caller_, name, false, false).status()), "JOB_NOT_FOUND");
  EXPECT_EQ(Reason(manager_->Cancel(caller_, name).status()), "JOB_NOT_FOUND");
}

TEST_F(JobManagerTest, WatchersKeepWhatWasDeleted) {
  const std::string name = CreateEnded("result");
  const auto events = Watch(name);
  ASSERT_TRUE(manager_->Delete(caller_, name).ok());
  EXPECT_EQ(events->uv()->ReadAll().value(), "result");
}

TEST_F(JobManagerTest, ListsNewestFirstInPages) {
  options_.limits.queue_capacity = 10;
  Restart();
  std::vector<std::string> names;
  for (int i = 0; i < 5; ++i) names.push_back(Create());
  const auto first = List(2);
  ASSERT_TRUE(first.ok());
  ASSERT_THAT(first->jobs, SizeIs(2));
  EXPECT_EQ(first->jobs[0].name(), names[4]);
  EXPECT_EQ(first->jobs[1].name(), names[3]);
  Create();
  const auto second = List(10, first->next_page_token);
  ASSERT_TRUE(second.ok());
  ASSERT_THAT(second->jobs, SizeIs(3)) << "jobs that came meanwhile do not shift the page";
  EXPECT_EQ(second->jobs[0].name(), names[2]);
  EXPECT_TRUE(second->next_page_token.empty());
}

TEST_F(JobManagerTest, ListsOneState) {
  const std::string ended = CreateEnded();
  Create();
  const auto page = List(0, "", "state = SUCCEEDED");
  ASSERT_TRUE(page.ok());
  ASSERT_THAT(page->jobs, SizeIs(1));
  EXPECT_EQ(page->jobs[0].name(), ended);
  EXPECT_FALSE(page->jobs[0].has_report());
}

TEST_F(JobManagerTest, ListsByLabelsAndTimes) {
  options_.limits.queue_capacity = 10;
  Restart();
  const auto create = [this](const std::map<std::string, std::string>& labels) {
    JobRequest request = Request();
    request.labels = labels;
    now_ += absl::Seconds(1);
    return manager_->Create(caller_, std::move(request))->job.name();
  };
  const absl::Time start = now_;
  const std::string a = create({{"file", "night/a.obj"}, {"build", "12"}});
  const std::string b = create({{"file", "night/b.obj"}, {"build", "13"}});
  const std::string c = create({{"file", R"(a "quoted\name")"}});
  const auto names = [this](const std::string& filter) {
    std::vector<std::string> found;
    const auto page = List(0, "", filter);
    EXPECT_TRUE(page.ok()) << page.status();
    for (const v1::Job& job : page->jobs) found.push_back(job.name());
    return found;
  };
  const auto at = [start](int seconds) {
    return absl::FormatTime(absl::RFC3339_full, start + absl::Seconds(seconds), absl::UTCTimeZone());
  };
  EXPECT_THAT(names(""), ElementsAre(c, b, a));
  EXPECT_THAT(names(R"(labels.file = "night/*")"), ElementsAre(b, a));
  EXPECT_THAT(names(R"(labels.file = "night/a.obj")"), ElementsAre(a));
  EXPECT_THAT(names(R"(labels.file != "night/*")"), ElementsAre(c));
  EXPECT_THAT(names(R"(labels.file = "a \"quoted\\name\"")"), ElementsAre(c));
  EXPECT_THAT(names("labels.build = 12"), ElementsAre(a));
  EXPECT_THAT(names("labels.build != 12"), ElementsAre(c, b)) << "without the label it is not 12 either";
  EXPECT_THAT(names("labels:build AND labels.file = \"night/b*\""), ElementsAre(b));
  EXPECT_THAT(names("create_time >= " + at(2)), ElementsAre(c, b));
  EXPECT_THAT(names("create_time > " + at(2)), ElementsAre(c));
  EXPECT_THAT(names("create_time < " + at(2) + " AND state = QUEUED"), ElementsAre(a));
  EXPECT_THAT(names("create_time <= " + at(2) + " AND state != QUEUED"), IsEmpty());
  ASSERT_TRUE(manager_->Cancel(caller_, a).ok());
  ASSERT_TRUE(manager_->Delete(caller_, a).ok());
  EXPECT_THAT(names("labels.build = 12"), IsEmpty()) << "labels go with their job";
}

TEST_F(JobManagerTest, RefusesFiltersThatItCannotRead) {
  for (const std::string filter : {"state",
                                   "state =",
                                   "state = DONE",
                                   "state > QUEUED",
                                   "state = QUEUED state = RUNNING",
                                   "state = QUEUED AND",
                                   "state = QUEUED OR state = RUNNING",
                                   "labels.Key = a",
                                   "labels. = a",
                                   "labels.key > a",
                                   "labels:No",
                                   "label = a",
                                   "labels.key = \"a",
                                   "labels.key = a b",
                                   "create_time = 2026-01-31T08:00:00Z",
                                   "create_time > now",
                                   "tenant != a",
                                   "tenant = a AND tenant = a",
                                   "AND",
                                   "= a"}) {
    const absl::Status status = List(0, "", filter).status();
    EXPECT_EQ(Reason(status), "REQUEST_INVALID") << filter;
    EXPECT_EQ(ErrorInfoOf(status).metadata["field"], "filter") << filter;
  }
  EXPECT_EQ(Reason(List(0, "", "labels.a = " + std::string(1100, 'x')).status()), "REQUEST_INVALID");
}

TEST_F(JobManagerTest, FullListsHaveReportsAndEndEarly) {
  options_.limits.queue_capacity = 10;
  Restart();
  for (int i = 0; i < 4; ++i) {
    const std::string name = Create();
    Take();
    worker::v1::WorkResult result = Success("uv");
    result.mutable_report()->add_charts()->set_stop_message(std::string(1'000'000, 'x'));
    Report(name, result, "uv");
  }
  v1::ListJobsRequest request;
  request.set_view(v1::JOB_VIEW_FULL);
  int jobs = 0, pages = 0;
  do {
    const auto page = manager_->List(caller_, request);
    ASSERT_TRUE(page.ok());
    for (const v1::Job& job : page->jobs) EXPECT_EQ(job.report().charts_size(), 1);
    EXPECT_LE(page->jobs.size(), 3u);
    jobs += static_cast<int>(page->jobs.size());
    ++pages;
    request.set_page_token(page->next_page_token);
  } while (!request.page_token().empty());
  EXPECT_EQ(jobs, 4);
  EXPECT_EQ(pages, 2);
}

TEST_F(JobManagerTest, ARequestedCancelShowsBeforeTheWorkerAnswers) {
  const std::string name = Create();
  Take();
  EXPECT_FALSE(manager_->Get(caller_, name)->cancel_requested());
  const v1::Job job = *manager_->Cancel(caller_, name);
  EXPECT_EQ(job.state(), v1::JOB_STATE_STOPPING);
  EXPECT_TRUE(job.cancel_requested());
  EXPECT_FALSE(job.stop_requested());
  EXPECT_TRUE(Events(name).back().job().cancel_requested());
  Report(name, Cancelled());
  EXPECT_EQ(State(name), v1::JOB_STATE_CANCELLED);
}

TEST_F(JobManagerTest, ResultsAreOfJobsThatSucceeded) {
  const auto reason = [this](const std::string& name) { return Reason(manager_->OpenResult(caller_, name).status()); };
  EXPECT_EQ(reason("jobs/none"), "JOB_NOT_FOUND");
  const std::string ended = CreateEnded("result");
  const auto result = manager_->OpenResult(caller_, ended);
  ASSERT_TRUE(result.ok()) << result.status();
  EXPECT_EQ(result->description.total_bytes(), 6);
  EXPECT_EQ(result->uv->ReadAll().value(), "result");
  const std::string queued = Create();
  EXPECT_EQ(reason(queued), "JOB_NOT_FINISHED");
  ASSERT_TRUE(manager_->Cancel(caller_, queued).ok());
  EXPECT_EQ(reason(queued), "NO_RESULT");
}

TEST_F(JobManagerTest, ArraysTravelAsOneBlobAndAreOtherWorkThanDracoOfTheSameBytes) {
  v1::JobSpec spec;
  spec.mutable_arrays()->set_positions(std::string(36, 'p'));
  spec.mutable_arrays()->set_triangles(std::string(12, 't'));
  JobRequest request = *TakeJobRequest(&spec);
  EXPECT_EQ(request.array_vertices, 3);
  ASSERT_TRUE(manager_->Create(caller_, request).ok());
  const auto assignment = TakeNext();
  EXPECT_EQ(assignment->request.array_vertices(), 3);
  EXPECT_EQ(assignment->blobs.at(0)->bytes(), std::string(36, 'p') + std::string(12, 't'));

  for (const std::optional<std::int64_t> vertices : {std::optional<std::int64_t>(), std::optional<std::int64_t>(2)}) {
    request.array_vertices = vertices;
    EXPECT_EQ(manager_->Create(caller_, request)->job.result_of(), "") << "the same bytes are another mesh";
    const auto other = TakeNext();
    EXPECT_EQ(other->request.has_array_vertices(), vertices.has_value());
  }
}

TEST_F(JobManagerTest, ArraysComeInThrees) {
  const auto refusal = [](std::size_t position_bytes, std::size_t triangle_bytes) {
    v1::JobSpec spec;
    spec.mutable_arrays()->set_positions(std::string(position_bytes, '\0'));
    spec.mutable_arrays()->set_triangles(std::string(triangle_bytes, '\0'));
    const ErrorInfo info = ErrorInfoOf(TakeJobRequest(&spec).status());
    return info.reason + " " + info.metadata.at("field");
  };
  EXPECT_EQ(refusal(35, 12), "MESH_POSITION_INVALID arrays.positions");
  EXPECT_EQ(refusal(36, 13), "MESH_INDEX_OUT_OF_RANGE arrays.triangles");
  EXPECT_EQ(refusal(36, 0), "MESH_EMPTY arrays.triangles");
}

TEST_F(JobManagerTest, RefusesForeignPageTokens) {
  Create();
  Create();
  const std::string token = List(1)->next_page_token;
  EXPECT_FALSE(List(1, "garbage").ok());
  EXPECT_FALSE(List(1, token, "state = QUEUED").ok());
  EXPECT_FALSE(List(-1).ok());
  Restart();
  EXPECT_EQ(Reason(List(1, token).status()), "REQUEST_INVALID");
}

TEST_F(JobManagerTest, KeepsANightsBatch) {
  std::vector<std::string> names;
  for (int i = 0; i < 300; ++i) names.push_back(CreateEnded());
  for (const std::string& name : names) ASSERT_EQ(State(name), v1::JOB_STATE_SUCCEEDED) << name;
}

TEST_F(JobManagerTest, KeepsEndedJobsForSomeTime) {
  options_.limits.retained_record_time = absl::Hours(10);
  Restart();
  const std::string first = CreateEnded();
  now_ += absl::Hours(4);
  const std::string second = CreateEnded();
  now_ += absl::Hours(6);
  manager_->Tick();
  EXPECT_FALSE(manager_->Get(caller_, first).ok());
  EXPECT_EQ(State(second), v1::JOB_STATE_SUCCEEDED);
  now_ += absl::Hours(4);
  manager_->Tick();
  EXPECT_FALSE(manager_->Get(caller_, second).ok());
}

TEST_F(JobManagerTest, KeepsTheNewestEndedJobs) {
  options_.limits.retained_record_bytes = 4000;  // two of them
  Restart();
  const std::string first = CreateEnded();
  const std::string second = CreateEnded();
  const std::string third = CreateEnded();
  EXPECT_FALSE(manager_->Get(caller_, first).ok());
  EXPECT_TRUE(manager_->Get(caller_, second).ok());
  EXPECT_TRUE(manager_->Get(caller_, third).ok());
}

TEST_F(JobManagerTest, KeepsSoManyBytesOfUv) {
  options_.limits.retained_bytes = 10;
  Restart();
  const std::string first = CreateEnded("123456");
  const std::string second = CreateEnded("1234");
  EXPECT_EQ(State(first), v1::JOB_STATE_SUCCEEDED);
  const std::string large = CreateEnded("12345678901234");
  EXPECT_EQ(State(first), v1::JOB_STATE_EXPIRED);
  EXPECT_EQ(State(second), v1::JOB_STATE_EXPIRED);
  EXPECT_EQ(State(large), v1::JOB_STATE_SUCCEEDED) << "the last one stays, so that its caller can fetch it";
  CreateEnded("1");
  EXPECT_EQ(State(large), v1::JOB_STATE_EXPIRED);
  EXPECT_EQ(Reason(manager_->Watch(caller_, large, false, true).status()), "RESULT_EXPIRED");
  EXPECT_EQ(Events(large).back().job().state(), v1::JOB_STATE_EXPIRED);
  manager_->Tick();
  EXPECT_EQ(blobs_->bytes(), 1) << "only the last UV are left";
}

TEST_F(JobManagerTest, AbandonedJobIsCancelledAndFreesItsRequestId) {
  auto accepted = manager_->Create(caller_, Request("r1", true));
  ASSERT_TRUE(accepted.ok());
  const std::string name = accepted->job.name();
  accepted->attachment.Release();
  EXPECT_EQ(State(name), v1::JOB_STATE_CANCELLED);
  EXPECT_NE(Create("r1"), name);
}

TEST_F(JobManagerTest, JobLivesWhileOneCallerIsAttached) {
  auto first = manager_->Create(caller_, Request("r1", true));
  const std::string name = first->job.name();
  {
    const auto retry = manager_->Create(caller_, Request("r1", true));
    EXPECT_EQ(retry->job.name(), name);
    first->attachment.Release();
    EXPECT_EQ(State(name), v1::JOB_STATE_QUEUED);
  }
  EXPECT_EQ(State(name), v1::JOB_STATE_CANCELLED);
}

TEST_F(JobManagerTest, DetachedJobsLiveOn) {
  std::string name;
  {
    const auto attached = manager_->Create(caller_, Request("r1", true));
    name = attached->job.name();
    EXPECT_EQ(Create("r1"), name);
  }
  EXPECT_EQ(State(name), v1::JOB_STATE_QUEUED);
}

TEST_F(JobManagerTest, DrainRefusesNewJobsAndFinishesOldOnes) {
  const std::string running = Create();
  Take();
  const std::string queued = Create("r1");
  int idle = 0;
  manager_->Drain([&idle] { ++idle; });
  const absl::Status refused = manager_->Create(caller_, Request()).status();
  EXPECT_EQ(refused.code(), absl::StatusCode::kUnavailable);
  EXPECT_EQ(Reason(refused), "DRAINING");
  EXPECT_EQ(ToRpcStatus(refused).details_size(), 2);
  EXPECT_EQ(Create("r1"), queued) << "a retry finds its job";
  Succeed(running);
  EXPECT_EQ(idle, 0);
  EXPECT_EQ(Take(), queued);
  Succeed(queued);
  EXPECT_EQ(idle, 1);
  manager_->StopWorkers();
  EXPECT_FALSE(TakeNext().has_value());
}

TEST_F(JobManagerTest, DrainOfAnIdleServerIsOver) {
  int idle = 0;
  manager_->Drain([&idle] { ++idle; });
  EXPECT_EQ(idle, 1);
}

TEST_F(JobManagerTest, EndOfGraceCancelsEverything) {
  const std::string ended = CreateEnded();
  const std::string running = Create();
  Take();
  const auto link = std::make_shared<NotingLink>();
  manager_->source()->SetLink(running, attempt_, link);
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
  Lose(running);
  EXPECT_EQ(State(running), v1::JOB_STATE_CANCELLED);
  EXPECT_EQ(idle, 1);
}

TEST_F(JobManagerTest, ReadersMayCallBackWhenTheyAreWoken) {
  const std::string name = Create();
  const auto log = Watch(name);
  std::vector<v1::JobState> seen;
  const auto subscription = log->Subscribe([&] { seen.push_back(State(name)); });
  Take();
  manager_->Cancel(caller_, name).IgnoreError();
  Report(name, Cancelled());
  EXPECT_THAT(seen, ElementsAre(v1::JOB_STATE_RUNNING, v1::JOB_STATE_STOPPING, v1::JOB_STATE_CANCELLED));
}

}  // namespace
}  // namespace planish
