// Several servers on one PostgreSQL: what one accepts another runs, and a third shows.
#include <chrono>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "core/base/sha256.h"
#include "gmock/gmock.h"
#include "gtest/gtest.h"
#include "server/jobs/job_manager.h"
#include "server/link/rpc_status.h"
#include "server/store/lifecycle.h"
#include "server/store/postgres_schema.h"
#include "server/store/sql_blobs.h"
#include "tests/server/jobs/job_manager_fixture.h"
#include "tests/server/store/failing_database.h"
#include "tests/server/store/postgres_server.h"
#include "tests/testing/process.h"

namespace planish {
namespace {

class JobFarmTest : public ::testing::Test {
 protected:
  // A server; its workers are the test's.
  struct Server {
    std::unique_ptr<JobStore> store;
    std::unique_ptr<JobManager> manager;
  };

  static void TearDownTestSuite() { postgres_.reset(); }

  JobFarmTest() {
    if (postgres_ == nullptr) postgres_ = std::make_unique<PostgresServer>();
    url_ = postgres_->NewDatabase();
    options_.report_interval = absl::ZeroDuration();
  }

  Server Start(bool must_hear = true) {
    Server server;
    std::unique_ptr<SqlDatabase> database = *OpenPostgresDatabase({url_, 4, "", must_hear});
    database_ = database.get();
    server.store = std::make_unique<JobStore>(std::move(database));
    server.manager = *JobManager::Open(options_, server.store.get(), &blobs_);
    return server;
  }

  std::string Create(Server* server, const std::string& mesh, bool attached = false) {
    JobRequest request;
    request.bytes = mesh;
    request.attached = attached;
    absl::StatusOr<AcceptedJob> accepted = server->manager->Create(caller_, std::move(request));
    EXPECT_TRUE(accepted.ok()) << accepted.status();
    if (!accepted.ok()) return "";
    attachment_ = std::move(accepted->attachment);
    return accepted->job.name();
  }

  JobAssignment Take(Server* server) {
    JobAssignment assignment;
    EXPECT_EQ(server->manager->source()->TakeNext(absl::Seconds(30), &assignment), Turn::kWork);
    return assignment;
  }

  void Succeed(Server* server, const JobAssignment& work) {
    server->manager->source()->ReportResult(work.name, work.attempt, planish::Success("uv"), *Blob::Copy("uv"));
  }

  // Upkeep of the server until the condition holds.
  static bool TickUntil(Server* server, const std::function<bool()>& condition) {
    const auto limit = std::chrono::steady_clock::now() + std::chrono::seconds(30);
    while (!condition()) {
      if (std::chrono::steady_clock::now() > limit) return false;
      server->manager->Tick();
    }
    return true;
  }

  v1::JobState State(Server* server, const std::string& name) { return server->manager->Get(caller_, name)->state(); }

  static inline std::unique_ptr<PostgresServer> postgres_;
  const Caller caller_ = {kDefaultTenant, "", Rights::All(), ""};
  std::string url_;
  SqlDatabase* database_ = nullptr;  // of the server that started last
  JobManagerOptions options_;
  BlobCatalog blobs_{{}, 1 << 20};
  JobAttachment attachment_;
};

TEST_F(JobFarmTest, WhatOneServerAcceptsAnotherRunsAndAThirdShows) {
  Server front = Start(), worker = Start(), other = Start();
  const std::string name = Create(&front, "mesh");
  const auto log = other.manager->Watch(caller_, name, false, true)->events;
  const JobAssignment work = Take(&worker);
  EXPECT_EQ(work.name, name);
  EXPECT_EQ(work.blobs.at(0)->bytes(), "mesh");
  for (int i = 1; i <= 3; ++i) worker.manager->source()->ReportProgress(name, work.attempt, Iteration(i));
  EXPECT_TRUE(TickUntil(&other, [&] { return log->last_sequence() == 5; })) << log->last_sequence();
  EXPECT_EQ(front.manager->Get(caller_, name)->progress().newton_iteration(), 3);
  Succeed(&worker, work);
  EXPECT_TRUE(TickUntil(&other, [&] { return log->ended(); }));
  std::int64_t last = 0;
  while (const auto event = log->ReadAfter(last).event) {
    EXPECT_EQ(event->sequence(), last + 1) << "no gap";
    last = event->sequence();
  }
  EXPECT_EQ(last, 6);
  EXPECT_EQ(log->uv()->ReadAll().value(), "uv");
  EXPECT_EQ(State(&front, name), v1::JOB_STATE_SUCCEEDED);
}

TEST_F(JobFarmTest, ACancelReachesTheWorkerWhereverItIsAskedFor) {
  Server front = Start(), worker = Start();
  const std::string name = Create(&front, "mesh");
  const JobAssignment work = Take(&worker);
  const auto link = std::make_shared<NotingLink>();
  worker.manager->source()->SetLink(name, work.attempt, link);
  EXPECT_EQ(front.manager->Stop(caller_, name)->state(), v1::JOB_STATE_STOPPING);
  EXPECT_TRUE(TickUntil(&worker, [&] { return link->sent.size() == 1; }));
  EXPECT_TRUE(front.manager->Cancel(caller_, name).ok());
  EXPECT_TRUE(TickUntil(&worker, [&] { return link->sent.size() == 2; }));
  EXPECT_TRUE(link->sent[0].has_stop());
  EXPECT_TRUE(link->sent[1].has_cancel());
  worker.manager->source()->ReportResult(name, work.attempt, Cancelled(), nullptr);
  EXPECT_EQ(State(&front, name), v1::JOB_STATE_CANCELLED);
}

TEST_F(JobFarmTest, AServerThatDiesLosesNoJobAndOneThatStopsGivesItsJobsBack) {
  options_.lease = absl::Milliseconds(300);
  Server front = Start(), dying = Start(), leaving = Start(), worker = Start();
  const std::string first = Create(&front, "mesh 1");
  const std::string second = Create(&front, "mesh 2");
  const JobAssignment lost = Take(&dying);
  EXPECT_EQ(lost.name, first);
  EXPECT_EQ(Take(&leaving).name, second);
  dying.manager.reset();
  leaving.manager->Suspend();
  const JobAssignment again = Take(&worker);
  EXPECT_EQ(again.name, second);
  EXPECT_EQ(again.attempt, 2);
  Succeed(&worker, again);
  EXPECT_TRUE(TickUntil(&worker, [&] { return State(&front, first) == v1::JOB_STATE_QUEUED; }));
  EXPECT_EQ((*front.store->Find(second))->crashes(), 0) << "what was given back is not held against it";
  EXPECT_EQ((*front.store->Find(first))->crashes(), 1);
  const JobAssignment retried = Take(&worker);
  EXPECT_EQ(retried.attempt, 2);
  Succeed(&worker, retried);
  EXPECT_EQ(State(&front, first), v1::JOB_STATE_SUCCEEDED);
}

TEST_F(JobFarmTest, WatchersSeeNoGapWhenAServerDies) {
  options_.lease = absl::Milliseconds(300);
  Server front = Start(), dying = Start(), worker = Start();
  const std::string name = Create(&front, "mesh");
  const auto log = front.manager->Watch(caller_, name, false, true)->events;
  const JobAssignment lost = Take(&dying);
  for (int i = 1; i <= 3; ++i) dying.manager->source()->ReportProgress(name, lost.attempt, Iteration(i));
  dying.manager.reset();
  EXPECT_TRUE(TickUntil(&worker, [&] { return State(&front, name) == v1::JOB_STATE_QUEUED; }));
  const JobAssignment work = Take(&worker);
  worker.manager->source()->ReportProgress(name, work.attempt, Iteration(1));
  Succeed(&worker, work);
  EXPECT_TRUE(TickUntil(&front, [&] { return log->ended(); }));
  std::int64_t last = 0;
  while (const auto event = log->ReadAfter(last).event) {
    EXPECT_EQ(event->sequence(), last + 1);
    last = event->sequence();
  }
  EXPECT_EQ(last, 9) << "accepted, started, three of progress, queued, started, one of progress, ended";
}

// A database that crashed may have lost the newest progress, which watchers have been told.
TEST_F(JobFarmTest, TheEndIsToldThoughTheDatabaseForgotWhatWatchersSaw) {
  Server front = Start(), worker = Start();
  const std::string name = Create(&front, "mesh");
  const auto log = front.manager->Watch(caller_, name, false, true)->events;
  const JobAssignment work = Take(&worker);
  for (int i = 1; i <= 5; ++i) worker.manager->source()->ReportProgress(name, work.attempt, Iteration(i));
  EXPECT_TRUE(TickUntil(&front, [&] { return log->last_sequence() == 7; })) << log->last_sequence();
  JobRecord record = **front.store->Find(name);
  record.set_last_sequence(3);
  {
    const std::unique_ptr<SqlDatabase> database = *OpenPostgresDatabase({url_, 1});
    const SqlDatabase::Lease sql = *database->Connect(SqlDatabase::Use::kWrite);
    const std::string bytes = record.SerializeAsString();
    ASSERT_TRUE(sql->Run("UPDATE jobs SET record = ? WHERE name = ?", {SqlBytes{bytes}, std::string_view(name)}).ok());
    ASSERT_TRUE(sql->Run("DELETE FROM events WHERE job = ? AND sequence > 3", {record.number()}).ok());
  }
  Succeed(&worker, work);
  EXPECT_TRUE(TickUntil(&front, [&] { return log->ended(); }));
  const auto end = log->ReadAfter(7).event;
  ASSERT_TRUE(end.has_value());
  EXPECT_EQ(end->sequence(), 8);
  EXPECT_EQ(end->skipped(), 0);
  EXPECT_EQ(end->job().state(), v1::JOB_STATE_SUCCEEDED);
  EXPECT_EQ(log->uv()->ReadAll().value(), "uv");
}

TEST_F(JobFarmTest, AmongManyAWorkerThatHearsNothingAsks) {
  Server front = Start();
  options_.capacity = [] { return JobCapacity{.workers = 1600, .servers = 100}; };
  Server worker = Start(/*must_hear=*/false);
  // As many processes as make one that need not hear stop listening.
  database_->SetProcesses(100, 1);
  ASSERT_TRUE(WaitUntil([&] { return !worker.store->hears_others(); }));
  const std::string name = Create(&front, "mesh");
  std::optional<JobAssignment> work;
  EXPECT_TRUE(TickUntil(&worker, [&] {
    JobAssignment assignment;
    if (worker.manager->source()->TakeNext(absl::ZeroDuration(), &assignment) == Turn::kWork) work = assignment;
    return work.has_value();
  }));
  const auto link = std::make_shared<NotingLink>();
  worker.manager->source()->SetLink(name, work->attempt, link);
  EXPECT_TRUE(front.manager->Cancel(caller_, name).ok());
  EXPECT_TRUE(TickUntil(&worker, [&] { return link->sent.size() == 1; }));
  worker.manager->source()->ReportResult(name, work->attempt, Cancelled(), nullptr);
  EXPECT_TRUE(TickUntil(&front, [&] { return State(&front, name) == v1::JOB_STATE_CANCELLED; }));
}

TEST_F(JobFarmTest, EachOfManyServersClaimsOnceInAnInterval) {
  absl::Time now = absl::Now();
  options_.steady_clock = [&now] { return now; };
  options_.capacity = [] { return JobCapacity{.workers = 1600, .servers = 100}; };
  Server server = Start();
  for (const char* mesh : {"1", "2", "3"}) Create(&server, mesh);
  const auto take = [&] {
    JobAssignment assignment;
    return server.manager->source()->TakeNext(absl::Milliseconds(1), &assignment) == Turn::kWork;
  };
  EXPECT_TRUE(take());
  EXPECT_FALSE(take()) << "100 servers make 250 claims a second";
  // To its place in the next interval, wherever the first claim was.
  bool taken = false;
  for (int i = 0; i < 20 && !taken; ++i) {
    now += absl::Milliseconds(20);
    taken = take();
  }
  EXPECT_TRUE(taken);
  const absl::Time second = now;
  now += absl::Milliseconds(360);
  EXPECT_FALSE(take()) << "again at that place only";
  now = second + absl::Milliseconds(400);
  EXPECT_TRUE(take());
}

TEST_F(JobFarmTest, AServerWhoseTurnDidNotComeClaimsAgain) {
  Server server = Start();
  const std::string name = Create(&server, "mesh");
  const std::unique_ptr<SqlDatabase> database = *OpenPostgresDatabase({url_, kTurns});
  const std::vector<SqlDatabase::Lease> others = TakeAllTurns(database.get());
  JobAssignment assignment;
  EXPECT_EQ(server.manager->source()->TakeNext(absl::Milliseconds(100), &assignment), Turn::kNothing);
  for (const SqlDatabase::Lease& other : others) EXPECT_TRUE(other->Commit().ok());
  EXPECT_EQ(Take(&server).name, name) << "no news came";
}

TEST_F(JobFarmTest, AClaimThatTheDatabaseForgotIsMadeAgainAndTheWorkerGoesOn) {
  absl::Time now = absl::Now();
  options_.steady_clock = [&now] { return now; };
  Server server = Start();
  const std::string name = Create(&server, "mesh");
  const std::unique_ptr<SqlDatabase> database = *OpenPostgresDatabase({url_, 1});
  const SqlDatabase::Lease sql = *database->Connect(SqlDatabase::Use::kWrite);
  const auto run = [&](const std::string& statement) { ASSERT_TRUE(sql->Run(statement, {}).ok()) << statement; };
  for (const std::string table : {"jobs", "works", "tenants"}) {
    run("CREATE TABLE old_" + table + " AS SELECT * FROM " + table);
  }
  const JobAssignment work = Take(&server);
  const auto link = std::make_shared<NotingLink>();
  server.manager->source()->SetLink(name, work.attempt, link);
  // A crash takes back what was committed without a sync.
  run("UPDATE jobs SET state = old.state, record = old.record FROM old_jobs AS old WHERE jobs.number = old.number");
  run("DELETE FROM events WHERE sequence > 1");
  for (const std::string table : {"works", "tenants"}) {
    run("DELETE FROM " + table);
    run("INSERT INTO " + table + " SELECT * FROM old_" + table);
  }
  EXPECT_EQ(State(&server, name), v1::JOB_STATE_QUEUED);
  EXPECT_TRUE(TickUntil(&server, [&] {
    now += absl::Seconds(1);  // it looks for work every few seconds
    JobAssignment again;
    EXPECT_EQ(server.manager->source()->TakeNext(absl::ZeroDuration(), &again), Turn::kNothing) << again.attempt;
    return State(&server, name) == v1::JOB_STATE_RUNNING;
  }));
  Succeed(&server, work);
  EXPECT_EQ(State(&server, name), v1::JOB_STATE_SUCCEEDED);
  EXPECT_EQ(server.manager->Get(caller_, name)->attempts(), 1);
}

TEST_F(JobFarmTest, UvWaitForTheirStore) {
  Fault fault;
  FailingDatabase database(*OpenPostgresDatabase({url_, 4}), &fault);
  BlobCatalog blobs({.store = *SqlBlobStore::Make(&database)}, 1 << 20);
  Server server;
  server.store = std::make_unique<JobStore>(*OpenPostgresDatabase({url_, 4}));
  server.manager = *JobManager::Open(options_, server.store.get(), &blobs);
  const std::string name = Create(&server, "mesh");
  const JobAssignment work = Take(&server);
  fault.away = true;
  Succeed(&server, work);
  server.manager->Tick();
  EXPECT_EQ(State(&server, name), v1::JOB_STATE_RUNNING) << "the worker has done its part";
  fault.away = false;
  server.manager->Tick();
  EXPECT_EQ(State(&server, name), v1::JOB_STATE_SUCCEEDED);
  EXPECT_EQ(server.manager->Watch(caller_, name, false, true)->events->uv()->ReadAll().value(), "uv");
}

TEST_F(JobFarmTest, WatchersHearThatTheirJobIsGone) {
  Server front = Start(), other = Start();
  const std::string name = Create(&front, "mesh");
  const auto log = front.manager->Watch(caller_, name, false, true)->events;
  EXPECT_TRUE(other.manager->Cancel(caller_, name).ok());
  EXPECT_TRUE(other.store->Delete(name).ok());
  EXPECT_TRUE(TickUntil(&front, [&] { return log->ended(); }));
  EXPECT_EQ(log->ReadAfter(log->last_sequence()).status.code(), absl::StatusCode::kNotFound);
}

TEST_F(JobFarmTest, CallersAreThoseOfTheFarm) {
  options_.limits.reattach_grace = absl::ZeroDuration();
  Server front = Start(), other = Start();
  const std::string name = Create(&front, "mesh", /*attached=*/true);
  other.manager->Tick();
  EXPECT_EQ(State(&other, name), v1::JOB_STATE_QUEUED) << "its caller is at another server";
  attachment_.Release();
  EXPECT_EQ(State(&other, name), v1::JOB_STATE_CANCELLED);
}

TEST_F(JobFarmTest, AServerThatDrainsTakesNoMore) {
  Server front = Start(), worker = Start();
  Create(&front, "mesh");
  int idle = 0;
  worker.manager->Drain([&idle] { ++idle; });
  EXPECT_EQ(idle, 1) << "what waits is for others";
  JobAssignment none;
  EXPECT_EQ(worker.manager->source()->TakeNext(absl::ZeroDuration(), &none), Turn::kOver);
}

}  // namespace
}  // namespace planish
