// The second half of the conformance suite: restarts, connections that die, crowds.
#include <algorithm>
#include <atomic>
#include <chrono>
#include <functional>
#include <memory>
#include <mutex>
#include <set>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include "absl/strings/str_cat.h"
#include "absl/time/clock.h"
#include "gmock/gmock.h"
#include "gtest/gtest.h"
#include "server/store/job_store.h"
#include "server/store/postgres_schema.h"
#include "tests/server/store/job_store_fixture.h"
#include "tests/testing/files.h"
#include "tests/testing/process.h"

namespace planish {
namespace {

using ::testing::IsEmpty;
using ::testing::SizeIs;

// ---- restarts, lost connections, crowds

TEST_P(JobStoreTest, EverythingOutlivesARestart) {
  if (GetParam() == Engine::kSqliteInMemory) return;
  Add("1", "k");
  Add("2", "k");
  const Lease lease = Claim();
  ASSERT_TRUE(store_->Report(context_, lease, {v1::Progress()}).ok());
  const std::string id = store_->id();
  const std::string before = Find("jobs/2").SerializeAsString();
  other_.reset();
  store_.reset();
  store_ = Open();
  EXPECT_EQ(store_->id(), id);
  EXPECT_EQ(Find("jobs/2").SerializeAsString(), before);
  EXPECT_EQ(History("jobs/2"), "1 QUEUED, 2 RUNNING, 3 progress");
  EXPECT_THAT(*store_->Finish(context_, lease, Success()), SizeIs(2)) << "a lease is no matter of the process";
}

// Where the connection dies within a verb, the verb was done as a whole or not at all, and can be asked again.
TEST_P(JobStoreTest, AConnectionMayDieInsideEveryVerb) {
  struct Case {
    std::string name;
    std::function<void()> prepare;
    std::function<absl::Status()> verb;
    v1::JobState before, after;
  };
  Lease lease;
  std::string work;
  const auto add = [&] { Add(work); };
  int first = 900;
  const auto add_first = [&] {  // before all that wait
    NewJob job = Job(work);
    job.record.mutable_job()->mutable_create_time()->set_seconds(--first);
    Accept(job);
  };
  const auto add_attached = [&] {
    NewJob job = Job(work);
    job.record.set_attached(true);
    Accept(job);
  };
  const auto add_overdue = [&] {
    ASSERT_TRUE(store_->EndOverdue(context_, 10'000).ok());  // those of other cases
    add_attached();
    ASSERT_TRUE(store_->KeepCallers({"jobs/" + work}, absl::ZeroDuration()).ok());
  };
  const auto run = [&] {
    Add(work);
    lease = Claim("a", "jobs/" + work);
  };
  const auto end = [&] {
    run();
    ASSERT_TRUE(store_->Finish(context_, lease, Success()).ok());
  };
  const auto name = [&] { return "jobs/" + work; };
  constexpr auto kNone = v1::JOB_STATE_UNSPECIFIED;
  const std::vector<Case> cases = {
      {"Accept", [] {}, [&] { return store_->Accept(context_, Job(work)).status(); }, kNone, v1::JOB_STATE_QUEUED},
      {"Claim", add,
       [&] {
         return store_->Claim(context_, {"a", absl::Seconds(10), 1, 0, name()}).status();
       },
       v1::JOB_STATE_QUEUED, v1::JOB_STATE_RUNNING},
      {"Renew", run, [&] { return store_->Renew({lease}, absl::Seconds(10)).status(); }, v1::JOB_STATE_RUNNING,
       v1::JOB_STATE_RUNNING},
      {"Report", run, [&] { return store_->Report(context_, lease, {v1::Progress()}).status(); }, v1::JOB_STATE_RUNNING,
       v1::JOB_STATE_RUNNING},
      {"Finish", run, [&] { return store_->Finish(context_, lease, Success()).status(); }, v1::JOB_STATE_RUNNING,
       v1::JOB_STATE_SUCCEEDED},
      {"Release", run, [&] { return store_->Release(context_, "a").status(); }, v1::JOB_STATE_RUNNING,
       v1::JOB_STATE_QUEUED},
      {"Reap", run, [&] { return store_->Reap(context_, "b", 10).status(); }, v1::JOB_STATE_RUNNING,
       v1::JOB_STATE_QUEUED},
      {"EndEarly", run, [&] { return store_->EndEarly(context_, name(), EarlyEnd::kCancel, true).status(); },
       v1::JOB_STATE_RUNNING, v1::JOB_STATE_STOPPING},
      {"RequestStop", run, [&] { return store_->RequestStop(context_, name()).status(); }, v1::JOB_STATE_RUNNING,
       v1::JOB_STATE_STOPPING},
      {"Fail", run, [&] { return store_->Fail(context_, name(), ToRpcStatus(InternalError("x")), true).status(); },
       v1::JOB_STATE_RUNNING, v1::JOB_STATE_FAILED},
      {"Detach", add, [&] { return store_->Detach(name()).status(); }, v1::JOB_STATE_QUEUED, v1::JOB_STATE_QUEUED},
      {"ClaimNext", add_first,
       [&] {
         return store_->Claim(context_, {"a", absl::Seconds(10), 1, 0, ""}).status();
       },
       v1::JOB_STATE_QUEUED, v1::JOB_STATE_RUNNING},
      {"KeepCallers", add_attached, [&] { return store_->KeepCallers({name()}, absl::ZeroDuration()); },
       v1::JOB_STATE_QUEUED, v1::JOB_STATE_QUEUED},
      {"EndOverdue", add_overdue, [&] { return store_->EndOverdue(context_, 10).status(); }, v1::JOB_STATE_QUEUED,
       v1::JOB_STATE_CANCELLED},
      {"Expire", end, [&] { return store_->Expire(context_, name()).status(); }, v1::JOB_STATE_SUCCEEDED,
       v1::JOB_STATE_EXPIRED},
      {"Delete", end, [&] { return store_->Delete(name()); }, v1::JOB_STATE_SUCCEEDED, kNone},
      {"DeleteOldest", end, [&] { return store_->DeleteOldest("", 10'000).status(); }, v1::JOB_STATE_SUCCEEDED, kNone},
  };
  const auto snapshot = [&] {
    const absl::StatusOr<std::optional<JobRecord>> record = store_->Find(name());
    if (!record->has_value()) return std::make_pair(kNone, std::string());
    return std::make_pair((*record)->job().state(), (*record)->SerializeAsString() + History(name()));
  };
  for (const Case& tried : cases) {
    for (const bool answers : {true, false}) {
      for (int at = 1;; ++at) {
        work = tried.name + std::to_string(at) + (answers ? "" : "lost");
        SCOPED_TRACE(work);
        tried.prepare();
        const auto before = snapshot();
        EXPECT_EQ(before.first, tried.before);
        fault_ = {};
        fault_.at = at;
        fault_.answers = answers;
        const absl::Status status = tried.verb();
        const bool reached = fault_.count >= at;
        fault_ = {};
        if (!reached) {
          EXPECT_TRUE(status.ok()) << status;
          EXPECT_EQ(snapshot().first, tried.after);
          ASSERT_GE(at, 3) << "a transaction is begun and committed";
          break;
        }
        EXPECT_EQ(ErrorReason(status), "STORE_UNAVAILABLE") << status;
        const auto now = snapshot();
        if (now != before) {
          EXPECT_FALSE(answers) << "only a commit whose answer was lost was done";
          EXPECT_EQ(now.first, tried.after);
        }
        const absl::Status again = tried.verb();
        if (!again.ok()) {
          EXPECT_NE(now, before) << "it was done";
          EXPECT_THAT(ErrorReason(again), ::testing::AnyOf("LEASE_LOST", "JOB_NOT_FOUND"));
        }
        EXPECT_EQ(snapshot().first, tried.after);
        // Whoever does not know that the claim was done.
        store_->Release(context_, "a").IgnoreError();
      }
    }
  }
}

// Two that run work, one that asks for more, one that cancels and one that keeps order: every job ends, none twice.
TEST_P(JobStoreTest, ACrowdFinishesEveryJobOnce) {
  constexpr int kJobs = 60;
  std::atomic<bool> over = false;
  std::atomic<int> lost = 0;
  JobStore* const second = &Other();
  const auto run = [&](JobStore* store, const std::string& owner) {
    int turns = 0;
    while (!over) {
      const auto claimed = store->Claim(context_, {owner, absl::Seconds(10), 2, 0, ""});
      if (!claimed.ok()) continue;
      for (const ClaimedWork& work : *claimed) {
        if (++turns % 7 == 0 && lost++ < 5) continue;  // it forgets that it has this
        store->Report(context_, work.lease, {v1::Progress()}).status().IgnoreError();
        store->Finish(context_, work.lease, Success()).status().IgnoreError();
      }
    }
  };
  std::thread runner([&] { run(store_.get(), "a"); });
  std::thread other_runner([&] { run(second, "b"); });
  std::thread asker([&] {
    for (int i = 0; i < kJobs; ++i) {
      const std::string name = std::to_string(i);
      while (!second->Accept(context_, Job(name, "key" + std::to_string(i / 3))).ok()) {
      }
      if (i % 5 == 4)
        second->EndEarly(context_, "jobs/" + std::to_string(i - 2), EarlyEnd::kCancel, false).IgnoreError();
    }
  });
  asker.join();
  for (int i = 0; i < 2000 && !store_->Unfinished()->empty(); ++i) {
    // What was forgotten is nobody's any more; so is what is under way.
    second->Reap(context_, "nobody", 10).status().IgnoreError();
    std::this_thread::sleep_for(std::chrono::milliseconds(20));
  }
  over = true;
  runner.join();
  other_runner.join();
  EXPECT_THAT(*store_->Unfinished(), IsEmpty());
  for (int i = 0; i < kJobs; ++i) {
    const JobRecord record = Find("jobs/" + std::to_string(i));
    int ends = 0;
    std::int64_t last = 0;
    const std::vector<v1::JobEvent> events = *store_->Events(record.number());
    for (const v1::JobEvent& event : events) {
      EXPECT_GT(event.sequence(), last) << record.job().name();
      last = event.sequence();
      if (event.has_job() && IsTerminal(event.job().state())) ++ends;
    }
    EXPECT_EQ(ends, 1) << record.job().name() << ": " << History(record.job().name());
  }
}

// Calls of one process that come at the same time go by one transaction; each has the answer that it had by itself.
TEST_P(JobStoreTest, WhatComesAtTheSameTimeIsAsIfItCameOneByOne) {
  constexpr int kJobs = 40, kWorks = 10;
  const auto at_once = [](int calls, const std::function<void(int)>& call) {
    std::vector<std::thread> threads;
    for (int i = 0; i < calls; ++i) threads.emplace_back(call, i);
    for (std::thread& thread : threads) thread.join();
  };
  JobStore* const stores[] = {store_.get(), &Other()};
  std::atomic<int> created = 0, shares = 0;
  at_once(kJobs, [&](int i) {
    NewJob job = Job(std::to_string(i), "key" + std::to_string(i % kWorks));
    if (i % kWorks == 0) job.blobs.push_back({{"ann", "blob"}, StoredBlob::InMemory(*Blob::Copy("bytes"))});
    const auto accepted = stores[i % 2]->Accept(context_, job);
    EXPECT_TRUE(accepted.ok()) << accepted.status();
    created += accepted->created ? 1 : 0;
    shares += accepted->shares ? 1 : 0;
    EXPECT_EQ(accepted->change.record.job().name(), "jobs/" + std::to_string(i));
  });
  EXPECT_EQ(created, kJobs);
  EXPECT_EQ(shares, kJobs - kWorks);
  EXPECT_EQ(store_->Accounts()->tenants["ann"].waiting, kWorks);
  std::set<std::int64_t> numbers;
  const std::vector<JobRecord> unfinished = *store_->Unfinished();
  for (const JobRecord& record : unfinished) numbers.insert(record.number());
  EXPECT_THAT(numbers, SizeIs(kJobs));

  std::vector<Lease> leases;
  const std::vector<ClaimedWork> claimed = *store_->Claim(context_, {"a", absl::Seconds(10), kWorks, 0, ""});
  for (const ClaimedWork& work : claimed) {
    EXPECT_THAT(work.jobs, SizeIs(kJobs / kWorks));
    leases.push_back(work.lease);
  }
  ASSERT_THAT(leases, SizeIs(kWorks));
  std::atomic<int> ended = 0, lost = 0;
  at_once(3 * kWorks, [&](int i) {
    Lease lease = leases[static_cast<std::size_t>(i % kWorks)];
    if (i >= 2 * kWorks) lease.owner = "somebody else";
    const auto changes = store_->Finish(context_, lease, Success());
    if (changes.ok()) {
      ended += static_cast<int>(changes->size());
    } else {
      EXPECT_EQ(ErrorReason(changes.status()), "LEASE_LOST");
      ++lost;
    }
  });
  EXPECT_EQ(ended, kJobs) << "the second Finish() of each finds nothing";
  EXPECT_EQ(lost, 2 * kWorks);
  for (int i = 0; i < kJobs; ++i) EXPECT_EQ(State("jobs/" + std::to_string(i)), v1::JOB_STATE_SUCCEEDED);
  const TenantAccount account = store_->Accounts()->tenants["ann"];
  EXPECT_EQ(account.waiting, 0);
  EXPECT_EQ(account.running, 0);
  EXPECT_EQ(store_->Totals()->tenants["ann"].ended, kJobs);
}

// Of one that cannot be written the others know nothing.
TEST_P(JobStoreTest, WhatFailsIsNotTheMatterOfWhatCameAtTheSameTime) {
  std::atomic<int> failures = 0;
  std::vector<std::thread> threads;
  for (int i = 0; i < 16; ++i) {
    threads.emplace_back([&, i] {
      NewJob job = Job(std::to_string(i));
      if (i == 7) job.record.set_request_id(std::string("no\0text", 7));  // for PostgreSQL
      const auto accepted = store_->Accept(context_, job);
      failures += accepted.ok() ? 0 : 1;
      EXPECT_TRUE(accepted.ok() || i == 7) << i << ": " << accepted.status();
    });
  }
  for (std::thread& thread : threads) thread.join();
  EXPECT_EQ(failures, GetParam() == Engine::kPostgres ? 1 : 0) << "SQLite takes any bytes";
  EXPECT_EQ(store_->Unfinished()->size(), 16u - static_cast<unsigned>(failures));
}

TEST_P(JobStoreTest, OfTwoWithOneRequestIdOneIsTheJob) {
  JobStore* const stores[] = {store_.get(), &Other()};
  for (int round = 0; round < 20; ++round) {
    const std::string id = "r" + std::to_string(round);
    std::atomic<int> created = 0;
    std::mutex mutex;
    std::set<std::string> names;
    std::vector<std::thread> threads;
    for (int i = 0; i < 4; ++i) {
      threads.emplace_back([&, i] {
        NewJob job = Job(id + "-" + std::to_string(i));
        job.record.set_request_id(id);
        const auto accepted = stores[i % 2]->Accept(context_, job);
        ASSERT_TRUE(accepted.ok()) << accepted.status();
        created += accepted->created ? 1 : 0;
        const std::lock_guard lock(mutex);
        names.insert(accepted->change.record.job().name());
      });
    }
    for (std::thread& thread : threads) thread.join();
    EXPECT_EQ(created, 1);
    EXPECT_THAT(names, SizeIs(1));
  }
  std::set<std::string> written;
  fault_.before = [&](const std::string& sql) { written.insert(sql.substr(0, 11)); };
  NewJob again = Job("again");
  again.record.set_request_id("r1");
  EXPECT_FALSE(Accept(again).created);
  EXPECT_FALSE(written.contains("INSERT INTO")) << "PostgreSQL would write an error to its log";
  fault_.before = nullptr;
}

// ---- PostgreSQL alone

class PostgresTest : public ::testing::Test {};

TEST_F(PostgresTest, IsFoundAgainAfterItCrashed) {
  PostgresServer server;
  const std::string url = server.NewDatabase();
  const std::unique_ptr<JobStore> store = std::make_unique<JobStore>(*OpenPostgresDatabase({url, 2}));
  NewJob job;
  job.record.mutable_job()->set_name("jobs/1");
  job.record.mutable_job()->set_tenant("ann");
  job.record.mutable_job()->set_state(v1::JOB_STATE_QUEUED);
  ASSERT_TRUE(store->Accept({}, job).ok());
  server.Crash();
  EXPECT_EQ(ErrorReason(store->Find("jobs/1").status()), "STORE_UNAVAILABLE");
  EXPECT_EQ(ErrorReason(store->Find("jobs/1").status()), "STORE_UNAVAILABLE") << "still";
  EXPECT_EQ(ErrorReason(OpenPostgresDatabase({url, 2}).status()), "STORE_UNAVAILABLE");
  server.Start();
  EXPECT_TRUE((*store->Find("jobs/1")).has_value()) << "what was acknowledged is durable";

  // By the database's own clock.
  ASSERT_THAT(*store->Claim({}, {"a", absl::Hours(1), 1, 0, ""}), SizeIs(1));
  EXPECT_THAT(*store->Reap({}, "", 10), IsEmpty());
  EXPECT_THAT(*store->Renew({{"jobs/1", 1, "a"}}, absl::ZeroDuration()), ::testing::ElementsAre(Wish::kGoOn));
  EXPECT_THAT(*store->Reap({}, "", 10), SizeIs(1));
}

NewJob JobNumber(std::int64_t number) {
  NewJob job;
  job.record.mutable_job()->set_name(absl::StrCat("jobs/", number));
  job.record.mutable_job()->set_tenant("ann");
  job.record.mutable_job()->set_state(v1::JOB_STATE_QUEUED);
  return job;
}

// A job of `store`, from its acceptance to its end.
void RunAJob(JobStore* store, std::int64_t number) {
  const NewJob job = JobNumber(number);
  const std::string& name = job.record.job().name();
  ASSERT_TRUE(store->Accept({}, job).ok());
  const auto leases = store->Claim({}, {"a", absl::Hours(1), 1, 0, ""});
  ASSERT_TRUE(leases.ok()) << leases.status();
  ASSERT_THAT(*leases, SizeIs(1));
  const Lease& lease = leases->front().lease;
  EXPECT_THAT(*store->Renew({lease}, absl::Hours(1)), ::testing::ElementsAre(Wish::kGoOn));
  ASSERT_TRUE(store->Report({}, lease, {v1::Progress()}).ok());
  AttemptOutcome outcome;
  outcome.status.set_code(static_cast<int>(absl::StatusCode::kInvalidArgument));
  const auto ended = store->Finish({}, lease, outcome);
  ASSERT_TRUE(ended.ok()) << ended.status();
  EXPECT_EQ((**store->Find(name)).job().state(), v1::JOB_STATE_FAILED);
}

TEST_F(PostgresTest, IsReachedByTlsWithAPassword) {
  if (RunShell("command -v openssl").exit_code != 0) GTEST_SKIP() << "openssl is not installed";
  const TempDir certificates, others;
  for (const TempDir* dir : {&certificates, &others}) {
    ASSERT_EQ(RunShell(PLANISH_SOURCE_TREE "/deploy/certificates.sh " + dir->Path() + " localhost").exit_code, 0);
  }
  PostgresServer server;
  const std::string url = server.Secure(certificates.Path(), "secret") + "/postgres?sslmode=verify-full&sslrootcert=";
  const std::string trusted = url + certificates.Path("ca.pem");
  const auto database = OpenPostgresDatabase({trusted, 2, "secret"});
  ASSERT_TRUE(database.ok()) << database.status();
  const auto rows =
      (*(*database)->Connect(SqlDatabase::Use::kRead))
          ->Run("SELECT CAST(CAST(ssl AS INT) AS BIGINT) FROM pg_stat_ssl WHERE pid = pg_backend_pid()", {});
  EXPECT_EQ(rows->Int(0, 0), 1);
  RunAJob(std::make_unique<JobStore>(*OpenPostgresDatabase({trusted, 2, "secret"})).get(), 1);

  const auto reason = [](const PostgresOptions& options) {
    const absl::Status status = OpenPostgresDatabase(options).status();
    EXPECT_EQ(ErrorReason(status), "STORE_UNAVAILABLE");
    return std::string(status.message());
  };
  EXPECT_THAT(reason({trusted, 2, "wrong"}), ::testing::HasSubstr("password authentication failed"));
  EXPECT_THAT(reason({url + others.Path("ca.pem"), 2, "secret"}), ::testing::HasSubstr("certificate verify failed"));
}

// What the next version may do to the schema while this one runs (sql_schema.h).
TEST_F(PostgresTest, ServersOfTheNextVersionMigrateWhileThoseOfThisOneRun) {
  PostgresServer server;
  const std::string url = server.NewDatabase();
  const std::unique_ptr<JobStore> running = std::make_unique<JobStore>(*OpenPostgresDatabase({url, 2}));
  RunAJob(running.get(), 1);

  const std::unique_ptr<SqlDatabase> next = *OpenPostgresDatabase({url, 2});
  const auto run = [&next](const std::string& sql) {
    const auto rows = (*next->Connect(SqlDatabase::Use::kWrite))->Run(sql, {});
    EXPECT_TRUE(rows.ok()) << sql << ": " << rows.status();
    return rows.ok() && !rows->empty() ? rows->Int(0, 0) : 0;
  };
  for (const std::string table : {"jobs", "events", "labels", "works", "tenants", "blobs"}) {
    run("ALTER TABLE " + table + " ADD COLUMN of_next BIGINT NOT NULL DEFAULT 7");
    run("CREATE INDEX of_next_" + table + " ON " + table + " (of_next)");
  }
  run("CREATE TABLE of_next (number BIGINT PRIMARY KEY)");
  run("UPDATE meta SET version = version + 1");
  const std::int64_t version = run("SELECT version FROM meta");
  RunAJob(running.get(), 2);
  const std::unique_ptr<JobStore> started = std::make_unique<JobStore>(*OpenPostgresDatabase({url, 2}));
  RunAJob(started.get(), 3);
  EXPECT_EQ(run("SELECT version FROM meta"), version) << "a server of the older version takes nothing back";

  run("UPDATE meta SET version = version + 1");
  const absl::Status refused = OpenPostgresDatabase({url, 2}).status();
  EXPECT_EQ(ErrorReason(refused), "STORE_VERSION");
  EXPECT_THAT(std::string(refused.message()), ::testing::HasSubstr("upgrade them release by release"));
}

TEST_F(PostgresTest, RowsAskedForLaterComeWithTheNextJourney) {
  PostgresServer server;
  const std::unique_ptr<SqlDatabase> database = *OpenPostgresDatabase({server.NewDatabase(), 2});
  const SqlDatabase::Lease connection = *database->Connect(SqlDatabase::Use::kWrite);
  SqlRows first, second;
  ASSERT_TRUE(connection->Begin(Durability::kLater).ok());
  ASSERT_TRUE(connection->RunLater("SELECT CAST(? AS BIGINT)", {std::int64_t{1}}, &first).ok());
  ASSERT_TRUE(connection->RunLater("SELECT CAST(? AS BIGINT)", {std::int64_t{2}}, &second).ok());
  EXPECT_TRUE(first.empty()) << "nothing was sent";
  EXPECT_EQ(connection->Run("SELECT CAST(3 AS BIGINT)", {})->Int(0, 0), 3);
  EXPECT_EQ(first.Int(0, 0), 1);
  EXPECT_EQ(second.Int(0, 0), 2);
  ASSERT_TRUE(connection->RunLater("SELECT CAST(6 AS BIGINT)", {}, &second).ok());
  ASSERT_TRUE(connection->Flush().ok());
  EXPECT_EQ(second.Int(0, 0), 6);
  ASSERT_TRUE(connection->Flush().ok()) << "nothing waits";
  ASSERT_TRUE(connection->RunLater("SELECT CAST(4 AS BIGINT)", {}, &first).ok());
  ASSERT_TRUE(connection->Commit().ok());
  EXPECT_EQ(first.Int(0, 0), 4);
  ASSERT_TRUE(connection->RunLater("SELECT CAST(5 AS BIGINT)", {}, &first).ok());
  EXPECT_EQ(first.Int(0, 0), 5) << "at once without a transaction";
}

TEST_F(PostgresTest, TurnsAreTakenByAFewAtATime) {
  PostgresServer server;
  const std::unique_ptr<SqlDatabase> database = *OpenPostgresDatabase({server.NewDatabase(), 5});
  const auto begin = [&database](std::uint64_t number) {
    SqlDatabase::Lease connection = *database->Connect(SqlDatabase::Use::kWrite);
    EXPECT_TRUE(connection->Begin(Durability::kLater).ok());
    EXPECT_TRUE(connection->TakeTurn(number).ok());
    EXPECT_TRUE(connection->Flush().ok());
    return connection;
  };
  const SqlDatabase::Lease first = begin(0);
  EXPECT_TRUE(first->HasTurn());
  const SqlDatabase::Lease other = begin(1);  // of another number: at once
  const SqlDatabase::Lease plain = *database->Connect(SqlDatabase::Use::kWrite);
  EXPECT_TRUE(plain->Begin(Durability::kNow).ok());
  EXPECT_LT(plain->Slot(), std::min(first->Slot(), other->Slot())) << "whoever waits for the disk is not in their way";
  EXPECT_NE(first->Slot(), other->Slot());
  EXPECT_TRUE(plain->HasTurn()) << "none is wanted";
  EXPECT_TRUE(plain->Commit().ok());
  {
    const SqlDatabase::Lease late = begin(kTurns);
    EXPECT_FALSE(late->HasTurn());
    EXPECT_TRUE(late->Run("SELECT 1", {}).ok()) << "that is no error";
    EXPECT_TRUE(late->Commit().ok());
  }
  std::atomic<bool> passed = false;
  std::thread waiter([&] {
    while (!passed) {
      const SqlDatabase::Lease second = begin(kTurns);
      passed = second->HasTurn();
      EXPECT_TRUE(second->Commit().ok());
    }
  });
  EXPECT_TRUE(first->Commit().ok());
  waiter.join();
  EXPECT_TRUE(passed);
}

TEST_F(PostgresTest, AClaimGivesUpWhenItsTurnDoesNotCome) {
  PostgresServer server;
  const std::string url = server.NewDatabase();
  const std::unique_ptr<SqlDatabase> database = *OpenPostgresDatabase({url, kTurns});
  const std::unique_ptr<JobStore> store = std::make_unique<JobStore>(*OpenPostgresDatabase({url, 1}));
  ASSERT_TRUE(store->Accept({}, JobNumber(1)).ok());
  const std::vector<SqlDatabase::Lease> others = TakeAllTurns(database.get());
  ClaimWait wait;
  const auto claim = [&] { return *store->Claim({}, {"a", absl::Seconds(10), 1, 0, ""}, &wait); };
  EXPECT_TRUE(claim().empty());
  EXPECT_TRUE(wait.gave_up);
  EXPECT_GE(wait.queued, absl::Milliseconds(20));
  for (const SqlDatabase::Lease& other : others) EXPECT_TRUE(other->Commit().ok());
  EXPECT_THAT(claim(), SizeIs(1));
  EXPECT_FALSE(wait.gave_up);
}

// A claim must not miss a job that joins the work between the claim's look at the queue and its lock.
TEST_F(PostgresTest, WorkIsReadWithJobsThatJoinedItBeforeItWasLocked) {
  PostgresServer server;
  const std::string url = server.NewDatabase();
  const std::unique_ptr<SqlDatabase> database = *OpenPostgresDatabase({url, 3});
  const std::unique_ptr<JobStore> store = std::make_unique<JobStore>(*OpenPostgresDatabase({url, 1}));
  const auto accept = [&store](std::int64_t number) {
    NewJob job = JobNumber(number);
    job.record.set_work_key("the same");
    return store->Accept({}, job).status();
  };
  ASSERT_TRUE(accept(1).ok());
  const auto begin = [&database] {
    SqlDatabase::Lease connection = *database->Connect(SqlDatabase::Use::kWrite);
    EXPECT_TRUE(connection->Begin(Durability::kLater).ok());
    return connection;
  };
  const SqlDatabase::Lease blocker = begin();
  ASSERT_TRUE(blocker->Run("SELECT CAST(pg_advisory_xact_lock(7) AS TEXT)", {}).ok());
  std::size_t rows = 0;
  std::thread reader([&] {
    const SqlDatabase::Lease connection = begin();
    const absl::StatusOr<SqlRows> read = connection->Run(
        "SELECT heads.*, jobs.number FROM (SELECT name, CAST(pg_advisory_xact_lock(7) AS TEXT) FROM works {skip}) "
        "AS heads {with_jobs}",
        {});
    EXPECT_TRUE(read.ok()) << read.status();
    if (read.ok()) rows = read->size();
    EXPECT_TRUE(connection->Commit().ok());
  });
  const SqlDatabase::Lease watcher = *database->Connect(SqlDatabase::Use::kRead);
  while (watcher->Run("SELECT count(*) FROM pg_locks WHERE locktype = 'advisory' AND NOT granted", {})->Int(0, 0) ==
         0) {
    std::this_thread::sleep_for(std::chrono::milliseconds(1));
  }
  EXPECT_TRUE(accept(2).ok());
  EXPECT_TRUE(blocker->Commit().ok());
  reader.join();
  EXPECT_EQ(rows, 2);
}

TEST_F(PostgresTest, OfManyProcessesThoseThatNeedNotHearDoNot) {
  PostgresServer server;
  const std::string url = server.NewDatabase();
  const std::unique_ptr<SqlDatabase> front = *OpenPostgresDatabase({.url = url});
  const std::unique_ptr<SqlDatabase> worker = *OpenPostgresDatabase({.url = url, .must_hear = false});
  std::mutex mutex;
  std::set<std::string> at_front, at_worker;
  const auto listen = [&mutex](SqlDatabase* database, std::set<std::string>* heard) {
    database->Listen([&mutex, heard](std::string_view message) {
      const std::lock_guard lock(mutex);
      heard->emplace(message);
    });
    ASSERT_TRUE(WaitUntil([&] { return database->hears(); }));
  };
  listen(front.get(), &at_front);
  listen(worker.get(), &at_worker);
  const auto has = [&mutex](const std::set<std::string>& heard, const std::string& message) {
    const std::lock_guard lock(mutex);
    return heard.contains(message);
  };
  for (SqlDatabase* const each : {front.get(), worker.get()}) each->SetProcesses(100, 1);
  ASSERT_TRUE(WaitUntil([&] { return !worker->hears(); }));
  EXPECT_TRUE(front->hears());
  worker->Publish("told");
  EXPECT_TRUE(WaitUntil([&] { return has(at_front, "told\n"); })) << "who does not hear speaks";
  {
    const std::lock_guard lock(mutex);
    at_worker.clear();
  }
  worker->SetProcesses(2, 1);
  EXPECT_TRUE(WaitUntil([&] { return has(at_worker, "*\n"); })) << "something may have been missed";
  EXPECT_TRUE(worker->hears());
  front->Publish("again");
  EXPECT_TRUE(WaitUntil([&] { return has(at_worker, "again\n"); }));
}

TEST_F(PostgresTest, AWrongAddressIsSaid) {
  const absl::Status status = OpenPostgresDatabase({"postgresql://nobody@/x?host=/nonexistent", 2}).status();
  EXPECT_EQ(ErrorReason(status), "STORE_UNAVAILABLE");
  EXPECT_THAT(std::string(status.message()), ::testing::HasSubstr("PostgreSQL cannot be reached"));
}

}  // namespace
}  // namespace planish
