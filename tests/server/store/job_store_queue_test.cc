// The third part of the conformance suite: whose turn it is, how much may wait, limits of time, news.
#include <algorithm>
#include <chrono>
#include <condition_variable>
#include <map>
#include <mutex>
#include <set>
#include <string>
#include <vector>

#include "gmock/gmock.h"
#include "gtest/gtest.h"
#include "server/store/job_store.h"
#include "tests/server/store/job_store_fixture.h"

namespace planish {
namespace {

using ::testing::ElementsAre;
using ::testing::IsEmpty;
using ::testing::SizeIs;

// Tenants whose names say what they do, and workers that a test plays.
class JobQueueStoreTest : public JobStoreTest {
 protected:
  ClaimRequest Request(const std::string& owner = "a", int most = 1) {
    ClaimRequest request = {owner, absl::Hours(1), most, memory_, ""};
    request.tenant_limits = [this](const std::string& tenant) { return limits_[tenant]; };
    return request;
  }

  std::vector<ClaimedWork> ClaimSome(const std::string& owner = "a", int most = 1) {
    absl::StatusOr<std::vector<ClaimedWork>> claimed = Other().Claim(context_, Request(owner, most));
    EXPECT_TRUE(claimed.ok()) << claimed.status();
    return claimed.ok() ? *std::move(claimed) : std::vector<ClaimedWork>();
  }

  // The name of what was claimed, and "" if nothing was.
  std::string Next(const std::string& owner = "a") {
    const std::vector<ClaimedWork> claimed = ClaimSome(owner);
    if (claimed.empty()) return "";
    last_ = claimed[0].lease;
    return last_.work.substr(5);
  }

  std::string AddOf(const std::string& tenant, const std::string& name) {
    return Accept(JobOf(tenant, name)).change.record.job().name();
  }
  void AddMany(const std::string& tenant, int count) {
    for (int i = 0; i < count; ++i) AddOf(tenant, tenant + std::to_string(i));
  }
  void Succeed(const Lease& lease) { ASSERT_TRUE(store_->Finish(context_, lease, Success()).ok()); }

  // One worker does `count` pieces of work, each of which takes what `seconds` says of its tenant; how many of each.
  std::map<std::string, int> Work(int count, std::map<std::string, int> seconds) {
    std::map<std::string, int> done;
    for (int i = 0; i < count; ++i) {
      const std::vector<ClaimedWork> claimed = ClaimSome();
      if (claimed.empty()) break;
      const std::string tenant = claimed[0].jobs[0].record.job().tenant();
      ++done[tenant];
      now_ += absl::Seconds(seconds.at(tenant));
      Succeed(claimed[0].lease);
    }
    return done;
  }

  NewJob Limited(const std::string& tenant, const std::string& name, QueueLimits limits, std::int64_t bytes = 0) {
    NewJob job = JobOf(tenant, name);
    job.record.mutable_job()->set_mesh_bytes(bytes);
    job.limits = limits;
    return job;
  }

  std::map<std::string, TenantLimits> limits_;
  std::int64_t memory_ = 0;
  Lease last_;
  std::vector<ClaimedWork> running_;
};

// ---- between tenants

TEST_P(JobQueueStoreTest, ATenantThatComesIsNextWhateverOthersHaveWaiting) {
  AddMany("ann", 20);
  for (int i = 0; i < 5; ++i) {
    Next();
    now_ += absl::Seconds(10);
    Succeed(last_);
  }
  AddOf("bob", "bobs");
  EXPECT_EQ(Next(), "bobs");
}

TEST_P(JobQueueStoreTest, SharesAreKeptOverALongRun) {
  limits_["ann"].share = 3;
  AddMany("ann", 40);
  AddMany("bob", 40);
  std::map<std::string, int> done = Work(40, {{"ann", 10}, {"bob", 10}});
  EXPECT_NEAR(done["ann"], 30, 1);
  EXPECT_NEAR(done["bob"], 10, 1);
}

TEST_P(JobQueueStoreTest, SharesAreOfTimeNotOfJobsAndOfWhatWorkTookNotOfWhatWasExpected) {
  AddMany("ann", 60);
  AddMany("bob", 60);
  std::map<std::string, int> done = Work(44, {{"ann", 2}, {"bob", 20}});
  EXPECT_NEAR(done["ann"], 40, 2) << "both were expected to take 10 s";
  EXPECT_NEAR(done["bob"], 4, 1);
}

TEST_P(JobQueueStoreTest, SharesHoldWhileSeveralRun) {
  AddMany("ann", 40);
  AddMany("bob", 40);
  std::map<std::string, int> running;
  for (const ClaimedWork& work : ClaimSome("a", 8)) ++running[work.jobs[0].record.job().tenant()];
  EXPECT_EQ(running["ann"], 4) << "a batch is shared, too";
  EXPECT_EQ(running["bob"], 4);
}

TEST_P(JobQueueStoreTest, AbsenceEarnsNothing) {
  AddMany("ann", 40);
  Work(20, {{"ann", 10}});
  AddMany("bob", 40);
  std::map<std::string, int> done = Work(20, {{"ann", 10}, {"bob", 10}});
  EXPECT_NEAR(done["bob"], 10, 1);
}

TEST_P(JobQueueStoreTest, WhatWasTakenWhileOthersWaitedIsRemembered) {
  AddMany("ann", 1);
  AddMany("bob", 40);
  Work(6, {{"ann", 1000}, {"bob", 10}});  // hers is done, and bob is behind
  for (int i = 10; i < 20; ++i) AddOf("ann", "late" + std::to_string(i));
  std::map<std::string, int> done = Work(10, {{"ann", 1000}, {"bob", 10}});
  EXPECT_EQ(done["ann"], 0);
}

TEST_P(JobQueueStoreTest, AnIdleStoreForgetsWhoHadWhat) {
  AddMany("ann", 2);
  Work(2, {{"ann", 1000}});
  AddOf("ann", "anns");
  AddOf("bob", "bobs");
  EXPECT_EQ(Next(), "anns") << "both are new, and hers came first";
}

TEST_P(JobQueueStoreTest, ATenantRunsNoMoreThanItMay) {
  limits_["ann"].running = 2;
  AddMany("ann", 5);
  AddMany("bob", 1);
  EXPECT_THAT(ClaimSome("a", 10), SizeIs(3));
  EXPECT_THAT(ClaimSome("b", 10), IsEmpty());
  Succeed({"jobs/ann0", 1, "a"});
  EXPECT_THAT(ClaimSome("b", 10), SizeIs(1));
}

TEST_P(JobQueueStoreTest, WhatALimitKeepsATenantFromIsNoCredit) {
  limits_["ann"].running = 1;
  AddMany("ann", 40);
  AddMany("bob", 40);
  // One worker is ann's all the time; two are bob's.
  const std::vector<ClaimedWork> first = ClaimSome("a", 3);
  ASSERT_THAT(first, SizeIs(3));
  for (int i = 0; i < 5; ++i) {
    now_ += absl::Seconds(10);
    for (const ClaimedWork& work : i == 0 ? first : running_) Succeed(work.lease);
    running_ = ClaimSome("a", 3);
    ASSERT_THAT(running_, SizeIs(3));
  }
  limits_["ann"].running = -1;
  now_ += absl::Seconds(10);
  for (const ClaimedWork& work : running_) Succeed(work.lease);
  std::map<std::string, int> done = Work(20, {{"ann", 10}, {"bob", 10}});
  EXPECT_NEAR(done["ann"], 10, 2);
}

// ---- within a tenant

TEST_P(JobQueueStoreTest, PriorityCountsAsTimeWaited) {
  const auto add = [&](const std::string& name, v1::Priority priority, int seconds) {
    NewJob job = JobOf("ann", name);
    job.record.mutable_job()->mutable_scheduling()->set_priority(priority);
    job.record.mutable_job()->mutable_create_time()->set_seconds(10'000 + seconds);
    Accept(job);
  };
  add("low", v1::PRIORITY_LOW, 0);
  add("normal", v1::PRIORITY_NORMAL, 30);
  add("high", v1::PRIORITY_HIGH, 60);
  add("later", v1::PRIORITY_HIGH, 700);
  EXPECT_EQ(Next(), "high");
  EXPECT_EQ(Next(), "normal");
  EXPECT_EQ(Next(), "later");
  EXPECT_EQ(Next(), "low");
}

TEST_P(JobQueueStoreTest, AHigherPriorityPullsTheWorkForwardAndBackWhenItGoes) {
  AddOf("ann", "first");
  NewJob low = JobOf("ann", "low");
  low.record.mutable_job()->mutable_scheduling()->set_priority(v1::PRIORITY_LOW);
  Accept(low);
  NewJob high = JobOf("ann", "high");
  high.record.set_work_key(low.record.work_key());
  high.record.mutable_job()->mutable_scheduling()->set_priority(v1::PRIORITY_HIGH);
  EXPECT_TRUE(Accept(high).shares);
  EXPECT_EQ(Next(), "low") << "the work of both";
  ASSERT_THAT(*store_->Release(context_, "a"), SizeIs(2));
  ASSERT_TRUE(store_->EndEarly(context_, "jobs/high", EarlyEnd::kCancel, false).ok());
  EXPECT_EQ(Next(), "first");
}

// ---- what an owner may have

TEST_P(JobQueueStoreTest, WhatNeedsMoreMemoryIsNotPassedBy) {
  NewJob large = JobOf("ann", "large");
  large.record.mutable_job()->set_memory_bytes(1000);
  AddOf("ann", "1");
  Accept(large);
  AddOf("ann", "2");
  memory_ = 1050;
  EXPECT_THAT(ClaimSome("a", 5), SizeIs(1));
  EXPECT_THAT(ClaimSome("a", 5), IsEmpty()) << "the large one waits for room, and others for it";
  Succeed({"jobs/1", 1, "a"});
  EXPECT_EQ(Next(), "large");
}

TEST_P(JobQueueStoreTest, WhatIsTooLargeForAMachineIsLeftToOthers) {
  NewJob large = JobOf("ann", "large");
  large.record.mutable_job()->set_memory_bytes(1000);
  Accept(large);
  AddOf("ann", "2");
  memory_ = 500;
  EXPECT_EQ(Next("small"), "2");
  EXPECT_EQ(Next("small"), "");
  memory_ = 2000;
  EXPECT_EQ(Next("big"), "large");
}

TEST_P(JobQueueStoreTest, TheLastAttemptAfterAServerDiedRunsAlone) {
  const auto lose = [&](const std::string& owner) {
    ASSERT_THAT(ClaimSome(owner), SizeIs(1));
    ASSERT_THAT(*store_->Reap(context_, "nobody", 10), SizeIs(1));
  };
  AddOf("ann", "killer");
  lose("a");
  lose("a");
  NewJob other = JobOf("ann", "other");
  other.record.mutable_job()->mutable_create_time()->set_seconds(1);
  Accept(other);
  AddOf("ann", "third");
  EXPECT_EQ(Next("a"), "other");
  EXPECT_EQ(Next("a"), "") << "the killer is next, and a has something else";
  const std::vector<ClaimedWork> alone = ClaimSome("b", 5);
  ASSERT_THAT(alone, SizeIs(1));
  EXPECT_EQ(alone[0].lease.work, "jobs/killer");
  EXPECT_EQ(Next("b"), "") << "nothing runs beside it";
  EXPECT_EQ(Next("a"), "third");
  Succeed(alone[0].lease);
}

TEST_P(JobQueueStoreTest, ABatchIsClaimedInItsOrder) {
  AddMany("ann", 5);
  const std::vector<ClaimedWork> batch = ClaimSome("a", 3);
  ASSERT_THAT(batch, SizeIs(3));
  for (int i = 0; i < 3; ++i) EXPECT_EQ(batch[i].lease.work, "jobs/ann" + std::to_string(i));
  EXPECT_EQ(batch[0].run_time, absl::Seconds(10));
  EXPECT_THAT(ClaimSome("b", 10), SizeIs(2));
}

// ---- how much may wait

TEST_P(JobQueueStoreTest, RoomOfATenant) {
  const QueueLimits limits = {2};
  EXPECT_EQ(Accept(Limited("ann", "1", limits)).room, Room::kYes);
  NewJob second = Limited("ann", "2", limits);
  second.record.set_request_id("r");
  EXPECT_EQ(Accept(second).room, Room::kYes);
  const AcceptedChange third = Accept(Limited("ann", "3", limits));
  EXPECT_EQ(third.room, Room::kTenantFull);
  EXPECT_FALSE(third.created);
  EXPECT_FALSE((*store_->Find("jobs/3")).has_value());
  EXPECT_EQ(Accept(Limited("bob", "4", limits)).room, Room::kYes);
  NewJob shares = Limited("ann", "5", limits);
  shares.record.set_work_key("key of 1");
  EXPECT_TRUE(Accept(shares).created) << "what shares work takes no place";
  NewJob again = Limited("ann", "6", limits);
  again.record.set_request_id("r");
  EXPECT_EQ(Accept(again).change.record.job().name(), "jobs/2") << "what is there needs none";
  Next();
  EXPECT_EQ(Accept(Limited("ann", "7", limits)).room, Room::kYes) << "what runs waits no more";
  EXPECT_EQ(Accept(Limited("ann", "8", limits)).room, Room::kTenantFull);
  ASSERT_TRUE(store_->EndEarly(context_, "jobs/2", EarlyEnd::kCancel, false).ok());
  EXPECT_EQ(Accept(Limited("ann", "9", limits)).room, Room::kYes) << "nor what has ended";
  ASSERT_THAT(*store_->Release(context_, "a"), SizeIs(2));
  EXPECT_EQ(Accept(Limited("ann", "10", limits)).room, Room::kTenantFull) << "what was released waits again";
}

TEST_P(JobQueueStoreTest, RoomOfAll) {
  QueueLimits limits;
  limits.total_jobs = 4;
  for (int i = 0; i < 4; ++i) {
    EXPECT_EQ(Accept(Limited("ann", std::to_string(i), limits)).room, Room::kYes);
  }
  EXPECT_EQ(Accept(Limited("ann", "5", limits)).room, Room::kServerFull);
  EXPECT_EQ(Accept(Limited("bob", "6", limits)).room, Room::kYes) << "its equal part";
  EXPECT_EQ(Accept(Limited("bob", "7", limits)).room, Room::kYes);
  EXPECT_EQ(Accept(Limited("bob", "8", limits)).room, Room::kServerFull);
}

TEST_P(JobQueueStoreTest, OfALongQueueWithAmpleRoomNotAllIsReadForEachJob) {
  int full_reads = 0;
  fault_.before = [&full_reads](const std::string& sql) { full_reads += sql.find("HAVING sum") != sql.npos ? 1 : 0; };
  QueueLimits limits;
  limits.tenant_jobs = limits.total_jobs = 1'000'000;
  const auto add = [&](int count) {
    static int last = 0;
    full_reads = 0;
    for (int i = 0; i < count; ++i) {
      EXPECT_EQ(Accept(Limited("ann", "many" + std::to_string(++last), limits)).room, Room::kYes);
    }
    return full_reads;
  };
  EXPECT_EQ(add(1001), 1001);
  EXPECT_LT(add(100), 100);
  limits.total_jobs = limits.tenant_jobs = 2000;
  EXPECT_EQ(add(100), 100) << "it might be full if twice as many were waiting";
  limits.total_jobs = limits.tenant_jobs = 1201;
  EXPECT_EQ(Accept(Limited("ann", "one too many", limits)).room, Room::kTenantFull);
}

TEST_P(JobQueueStoreTest, RoomCountsBytesAndIdleWorkers) {
  QueueLimits limits;
  limits.total_bytes = 100;
  EXPECT_EQ(Accept(Limited("ann", "1", limits, 1000)).room, Room::kYes) << "the first may be of any size";
  EXPECT_EQ(Accept(Limited("ann", "2", limits, 1)).room, Room::kServerFull);
  Next();
  EXPECT_EQ(Accept(Limited("ann", "3", limits, 60)).room, Room::kYes);
  EXPECT_EQ(Accept(Limited("ann", "4", limits, 60)).room, Room::kServerFull);
  limits = {0};
  limits.workers = 3;
  EXPECT_EQ(Accept(Limited("bob", "5", limits)).room, Room::kYes) << "one worker has nothing to do";
  EXPECT_EQ(Accept(Limited("bob", "6", limits)).room, Room::kTenantFull);
}

TEST_P(JobQueueStoreTest, AccountsAreThoseOfTheJobs) {
  AddMany("ann", 3);
  AddMany("bob", 1);
  Next();
  const FairAccounts accounts = *Other().Accounts();
  EXPECT_EQ(accounts.tenants.at("ann").waiting + accounts.tenants.at("bob").waiting, 3);
  EXPECT_EQ(accounts.tenants.at("ann").running, 1);
  Work(10, {{"ann", 1}, {"bob", 1}});
  Succeed({"jobs/ann0", 1, "a"});
  EXPECT_TRUE(IsIdle(*Other().Accounts()));
  AddOf("cid", "first");
  EXPECT_THAT(Other().Accounts()->tenants, SizeIs(1)) << "who had what is forgotten with the next job";
  EXPECT_EQ(Other().Totals()->tenants.at("ann").ended, 3);
}

// ---- limits of time

TEST_P(JobQueueStoreTest, TimeoutsAndBudgetsAreKept) {
  const auto add = [&](const std::string& name, int timeout, int budget) {
    NewJob job = JobOf("ann", name);
    v1::Job* described = job.record.mutable_job();
    *described->mutable_create_time() = ToTimestamp(now_);
    if (timeout > 0) described->mutable_scheduling()->mutable_timeout()->set_seconds(timeout);
    if (budget > 0) described->mutable_scheduling()->mutable_compute_budget()->set_seconds(budget);
    Accept(job);
  };
  add("runs", 100, 20);
  add("waits", 50, 0);
  add("free", 0, 0);
  EXPECT_EQ(Next(), "runs");
  const Lease lease = last_;
  now_ += absl::Seconds(19);
  EXPECT_THAT(*Other().EndOverdue(context_, 10), IsEmpty());
  now_ += absl::Seconds(1);
  EXPECT_THAT(*Other().EndOverdue(context_, 10), SizeIs(1));
  EXPECT_EQ(State("jobs/runs"), v1::JOB_STATE_STOPPING);
  EXPECT_THAT(*Other().EndOverdue(context_, 10), IsEmpty()) << "once";
  EXPECT_THAT(*store_->Renew({lease}, absl::Hours(1)), ElementsAre(Wish::kStop));
  now_ += absl::Seconds(30);
  EXPECT_THAT(*Other().EndOverdue(context_, 10), SizeIs(1));
  EXPECT_EQ(ErrorOf("jobs/waits"), "DEADLINE_EXCEEDED");
  now_ += absl::Seconds(50);
  EXPECT_THAT(*Other().EndOverdue(context_, 10), SizeIs(1));
  EXPECT_THAT(*store_->Renew({lease}, absl::Hours(1)), ElementsAre(Wish::kCancel));
  EXPECT_THAT(*Other().EndOverdue(context_, 10), IsEmpty()) << "its worker was told";
  Succeed(lease);
  EXPECT_EQ(ErrorOf("jobs/runs"), "DEADLINE_EXCEEDED");
  EXPECT_EQ(State("jobs/free"), v1::JOB_STATE_QUEUED);
}

TEST_P(JobQueueStoreTest, JobsWhoseCallersAreGoneAreCancelled) {
  for (const char* name : {"1", "2", "3", "4"}) {
    NewJob job = JobOf("ann", name);
    job.record.set_attached(true);
    job.record.set_request_id(name);
    *job.record.mutable_callers_until() = ToTimestamp(now_ + absl::Seconds(10));
    Accept(job);
  }
  ASSERT_TRUE(store_->Detach("jobs/3").ok());
  EXPECT_EQ(Next(), "1");
  ASSERT_TRUE(Other().KeepCallers({"jobs/4", "jobs/3", "jobs/none"}, absl::Seconds(30)).ok());
  now_ += absl::Seconds(10);
  EXPECT_THAT(*store_->EndOverdue(context_, 10), SizeIs(2));
  EXPECT_EQ(State("jobs/1"), v1::JOB_STATE_STOPPING);
  EXPECT_EQ(State("jobs/2"), v1::JOB_STATE_CANCELLED);
  EXPECT_EQ(State("jobs/3"), v1::JOB_STATE_QUEUED) << "it belongs to nobody";
  EXPECT_EQ(State("jobs/4"), v1::JOB_STATE_QUEUED) << "somebody said that its callers are there";
  EXPECT_FALSE((*store_->FindByRequestId("ann", "2")).has_value()) << "a retry starts anew";
  ASSERT_TRUE(Other().KeepCallers({"jobs/4"}, absl::ZeroDuration()).ok());
  EXPECT_THAT(*store_->EndOverdue(context_, 10), SizeIs(1));
}

// ---- news

TEST_P(JobQueueStoreTest, ChangesAreToldToEveryProcess) {
  std::mutex mutex;
  std::condition_variable heard;
  std::set<std::string> jobs;
  bool work = false;
  auto subscription = Other().Subscribe([&](const StoreNews& news) {
    const std::lock_guard lock(mutex);
    jobs.insert(news.jobs.begin(), news.jobs.end());
    work = work || news.work;
    heard.notify_all();
  });
  const auto hears = [&](const auto& condition) {
    std::unique_lock lock(mutex);
    return heard.wait_for(lock, std::chrono::seconds(30), condition);
  };
  // Whoever begins to listen in the middle is told that everything may have changed, or hears of it.
  for (int i = 0; i < 100 && jobs.empty(); ++i) {
    AddOf("ann", "first" + std::to_string(i));
    std::unique_lock lock(mutex);
    heard.wait_for(lock, std::chrono::milliseconds(300), [&] { return !jobs.empty(); });
  }
  AddOf("ann", "told");
  EXPECT_TRUE(hears([&] { return jobs.contains("jobs/told") && work; }));
  ASSERT_TRUE(store_->EndEarly(context_, "jobs/told", EarlyEnd::kCancel, false).ok());
  std::vector<std::string> many;
  for (int i = 0; i < 50; ++i) many.push_back(AddOf("ann", "many" + std::to_string(i)));
  EXPECT_TRUE(hears([&] {
    return std::all_of(many.begin(), many.end(), [&](const std::string& name) { return jobs.contains(name); });
  }));
  // The listener goes before what it uses.
  subscription.reset();
  other_.reset();
}

INSTANTIATE_TEST_SUITE_P(Memory, JobQueueStoreTest, ::testing::Values(Engine::kSqliteInMemory),
                         [](const auto&) { return std::string("Sqlite"); });
INSTANTIATE_TEST_SUITE_P(File, JobQueueStoreTest, ::testing::Values(Engine::kSqlite),
                         [](const auto&) { return std::string("Sqlite"); });
INSTANTIATE_TEST_SUITE_P(Postgres, JobQueueStoreTest, ::testing::Values(Engine::kPostgres),
                         [](const auto&) { return std::string("15"); });

}  // namespace
}  // namespace planish
