// What every JobStore must do, whatever its engine: the conformance suite, with job_store_faults_test.cc.
#include "server/store/job_store.h"

#include <algorithm>
#include <cstdint>
#include <set>
#include <string>
#include <vector>

#include "absl/time/clock.h"
#include "gmock/gmock.h"
#include "google/protobuf/util/time_util.h"
#include "gtest/gtest.h"
#include "tests/server/store/job_store_fixture.h"

namespace planish {
namespace {

using ::testing::ElementsAre;
using ::testing::IsEmpty;
using ::testing::Pair;
using ::testing::SizeIs;

// ---- accepting

TEST_P(JobStoreTest, AnAcceptedJobIsThere) {
  NewJob job = Job("1");
  job.record.set_request_id("r1");
  (*job.record.mutable_job()->mutable_labels())["k"] = "v";
  job.blobs.push_back({{"ann", "mesh of key of 1"}, StoredBlob::InMemory(*Blob::Copy(std::string("\0bytes", 6)))});
  const AcceptedChange accepted = Accept(job);
  EXPECT_TRUE(accepted.created);
  EXPECT_FALSE(accepted.shares);
  EXPECT_GT(accepted.change.record.number(), 0);
  EXPECT_EQ(accepted.change.record.work(), "jobs/1");
  EXPECT_THAT(accepted.change.events, SizeIs(1));
  EXPECT_EQ(Find("jobs/1").SerializeAsString(), accepted.change.record.SerializeAsString());
  EXPECT_EQ(History("jobs/1"), "1 QUEUED");
  EXPECT_EQ((*store_->FindByRequestId("ann", "r1"))->job().name(), "jobs/1");
  EXPECT_FALSE((*store_->FindByRequestId("bob", "r1")).has_value());
  EXPECT_FALSE((*store_->Find("jobs/2")).has_value());
  EXPECT_TRUE(*store_->UsesBlob({"ann", "mesh of key of 1"}));
  EXPECT_FALSE(*store_->UsesBlob({"bob", "mesh of key of 1"}));
  if (store_->rows() == nullptr) return;
  EXPECT_EQ(store_->rows()->Read({"ann", "mesh of key of 1"}).value(), std::string("\0bytes", 6));
  EXPECT_THAT(*store_->rows()->List(), SizeIs(1));
  EXPECT_FALSE(*store_->rows()->Remove({"ann", "mesh of key of 1"})) << "the job needs it";
  EXPECT_TRUE(store_->EndEarly(context_, "jobs/1", EarlyEnd::kCancel, /*forget=*/false).ok());
  EXPECT_TRUE(*store_->rows()->Remove({"ann", "mesh of key of 1"}));
  EXPECT_EQ(ErrorReason(store_->rows()->Read({"ann", "mesh of key of 1"}).status()), "BLOB_NOT_FOUND");
}

TEST_P(JobStoreTest, ARequestThatComesAgainIsTheSameJob) {
  NewJob job = Job("1");
  job.record.set_request_id("r1");
  Accept(job);
  EXPECT_FALSE(Accept(job).created) << "by its name";
  NewJob again = Job("2");
  again.record.set_request_id("r1");
  const AcceptedChange known = Accept(again);
  EXPECT_FALSE(known.created);
  EXPECT_EQ(known.change.record.job().name(), "jobs/1");
  EXPECT_THAT(known.change.events, IsEmpty());
  again.record.mutable_job()->set_tenant("bob");
  EXPECT_TRUE(Accept(again).created) << "request ids are each tenant's own";
}

TEST_P(JobStoreTest, EqualWorkIsDoneOnce) {
  Add("1", "k");
  const AcceptedChange queued = Accept(Job("2", "k"));
  EXPECT_TRUE(queued.shares);
  EXPECT_EQ(queued.change.record.work(), "jobs/1");
  EXPECT_EQ(queued.change.record.job().result_of(), "jobs/1");
  NewJob fresh = Job("fresh", "k");
  fresh.record.mutable_job()->mutable_scheduling()->set_fresh(true);
  EXPECT_FALSE(Accept(fresh).shares);
  NewJob bobs = Job("bobs", "k");
  bobs.record.mutable_job()->set_tenant("bob");
  EXPECT_FALSE(Accept(bobs).shares) << "tenants share nothing";

  const Lease lease = Claim("a", "jobs/1");
  ASSERT_TRUE(store_->Delete("jobs/none").code() == absl::StatusCode::kNotFound);
  ASSERT_TRUE(store_->Fail(context_, "jobs/fresh", ToRpcStatus(InternalError("x")), false).ok());
  const AcceptedChange running = Accept(Job("3", "k"));
  EXPECT_EQ(running.change.record.job().state(), v1::JOB_STATE_RUNNING);
  EXPECT_EQ(running.change.record.job().attempts(), 1);
  EXPECT_EQ(History("jobs/3"), "1 QUEUED, 2 RUNNING");
  const std::vector<JobChange> ends = *store_->Finish(context_, lease, Success());
  EXPECT_THAT(ends, SizeIs(3));
  for (const char* name : {"jobs/1", "jobs/2", "jobs/3"}) EXPECT_EQ(State(name), v1::JOB_STATE_SUCCEEDED) << name;
}

// What a connection is asked first decides on the types of what it is asked later.
TEST_P(JobStoreTest, AFreshJobMayComeFirst) {
  NewJob fresh = Job("1", "k");
  fresh.record.mutable_job()->mutable_scheduling()->set_fresh(true);
  EXPECT_TRUE(Accept(fresh).created);
  NewJob job = Job("2", "other");
  job.record.set_request_id("r");
  EXPECT_TRUE(Accept(job).created);
}

TEST_P(JobStoreTest, AKeptResultIsGivenAtOnce) {
  Add("1", "k");
  ASSERT_TRUE(store_->Finish(context_, Claim(), Success()).ok());
  NewJob job = Job("2", "k");
  job.result_of = "jobs/1";
  const AcceptedChange accepted = Accept(job);
  EXPECT_TRUE(accepted.shares);
  EXPECT_EQ(accepted.change.record.job().result_of(), "jobs/1");
  EXPECT_EQ(History("jobs/2"), "1 QUEUED, 2 SUCCEEDED");
  EXPECT_EQ(Find("jobs/2").job().report().input().triangles(), 7);
  ASSERT_TRUE(store_->Expire(context_, "jobs/1").ok());
  job = Job("3", "k");
  job.result_of = "jobs/1";
  EXPECT_EQ(Accept(job).change.record.job().state(), v1::JOB_STATE_QUEUED) << "it was dropped in the meantime";
}

TEST_P(JobStoreTest, NobodyJoinsWorkThatIsToEnd) {
  Add("1", "k");
  const Lease lease = Claim();
  ASSERT_TRUE(store_->RequestStop(context_, "jobs/1").ok());
  EXPECT_FALSE(Accept(Job("2", "k")).shares);
  ASSERT_TRUE(store_->Finish(context_, lease, Success()).ok());
  ASSERT_TRUE(Claim().work == "jobs/2");
  ASSERT_TRUE(store_->EndEarly(context_, "jobs/2", EarlyEnd::kCancel, false).ok());
  EXPECT_FALSE(Accept(Job("3", "k")).shares);
}

// ---- claiming

TEST_P(JobStoreTest, WorkIsClaimedInItsOrderAndOnce) {
  for (const char* name : {"1", "2", "3"}) {
    NewJob job = Job(name);
    job.record.mutable_job()->mutable_create_time()->set_seconds(*name == '3' ? 10 : 20);
    Accept(job);
  }
  EXPECT_EQ(Claim().work, "jobs/3");
  ClaimRequest request = {"b", absl::Seconds(10), 5, 0, ""};
  const std::vector<ClaimedWork> claimed = *Other().Claim(context_, request);
  ASSERT_THAT(claimed, SizeIs(2));
  EXPECT_EQ(claimed[0].lease.work, "jobs/1");
  EXPECT_EQ(claimed[0].lease.attempt, 1);
  EXPECT_EQ(claimed[1].jobs[0].record.owner(), "b");
  EXPECT_THAT(*store_->Claim(context_, request), IsEmpty());
  EXPECT_EQ(History("jobs/2"), "1 QUEUED, 2 RUNNING");
  EXPECT_EQ(Find("jobs/2").job().attempts(), 1);
}

// ---- leases

TEST_P(JobStoreTest, AZombieChangesNothing) {
  const std::string name = Add("1");
  const Lease zombie = Claim("a");
  now_ += absl::Seconds(9);
  EXPECT_THAT(*Other().Reap(context_, "", 10), IsEmpty()) << "the lease still holds";
  EXPECT_THAT(*store_->Renew({zombie}, absl::Seconds(10)), ElementsAre(Wish::kGoOn));
  now_ += absl::Seconds(9);
  EXPECT_THAT(*Other().Reap(context_, "", 10), IsEmpty()) << "it was renewed";
  now_ += absl::Seconds(1);
  ASSERT_THAT(*Other().Reap(context_, "", 10), SizeIs(1));
  EXPECT_EQ(State(name), v1::JOB_STATE_QUEUED);
  EXPECT_EQ(Find(name).crashes(), 1);
  const std::string before = Find(name).SerializeAsString();
  const auto try_all = [&] {
    EXPECT_EQ(ErrorReason(store_->Finish(context_, zombie, Success()).status()), "LEASE_LOST");
    EXPECT_EQ(ErrorReason(store_->Finish(context_, zombie, Lost()).status()), "LEASE_LOST");
    EXPECT_EQ(ErrorReason(store_->Report(context_, zombie, {v1::Progress()}).status()), "LEASE_LOST");
    EXPECT_THAT(*store_->Renew({zombie}, absl::Seconds(10)), ElementsAre(Wish::kGiveUp));
  };
  try_all();
  EXPECT_EQ(Find(name).SerializeAsString(), before);
  const Lease next = Claim("b");
  EXPECT_EQ(next.attempt, 2);
  try_all();
  EXPECT_THAT(*store_->Release(context_, "a"), IsEmpty());
  const Lease same_owner_again = {next.work, 1, "b"};
  EXPECT_EQ(ErrorReason(store_->Finish(context_, same_owner_again, Success()).status()), "LEASE_LOST");
  EXPECT_TRUE(Other().Finish(context_, next, Success()).ok());
  EXPECT_EQ(State(name), v1::JOB_STATE_SUCCEEDED);
  try_all();
  EXPECT_EQ(History(name), "1 QUEUED, 2 RUNNING, 3 QUEUED, 4 RUNNING, 5 SUCCEEDED");
}

TEST_P(JobStoreTest, WishesAreToldWithTheRenewal) {
  Add("1", "k");
  Add("2", "k");
  const Lease lease = Claim();
  const auto wish = [&] { return store_->Renew({lease}, absl::Seconds(10))->at(0); };
  ASSERT_TRUE(Other().RequestStop(context_, "jobs/1").ok());
  EXPECT_EQ(wish(), Wish::kGoOn) << "the other job wants all of it";
  EXPECT_THAT(*Other().Wishes("a"), IsEmpty());
  ASSERT_TRUE(store_->RequestStop(context_, "jobs/2").ok());
  EXPECT_EQ(wish(), Wish::kStop);
  EXPECT_THAT(*Other().Wishes("a"), ElementsAre(Pair(lease.work, Wish::kStop)));
  EXPECT_THAT(*Other().Wishes("b"), IsEmpty()) << "of its own work only";
  EXPECT_EQ(store_->EndEarly(context_, "jobs/1", EarlyEnd::kCancel, false)->record.job().state(),
            v1::JOB_STATE_CANCELLED)
      << "the work goes on for the other";
  EXPECT_EQ(wish(), Wish::kStop);
  EXPECT_EQ(Other().EndEarly(context_, "jobs/2", EarlyEnd::kCancel, false)->record.job().state(),
            v1::JOB_STATE_STOPPING);
  EXPECT_EQ(wish(), Wish::kCancel);
  AttemptOutcome obeyed;
  obeyed.status = ToRpcStatus(absl::CancelledError("as told"));
  ASSERT_TRUE(store_->Finish(context_, lease, obeyed).ok());
  EXPECT_EQ(State("jobs/2"), v1::JOB_STATE_CANCELLED);
  EXPECT_EQ(wish(), Wish::kGiveUp);
}

TEST_P(JobStoreTest, JobsThatComeTogetherAreCommittedTogether) {
  Add("before");
  std::vector<NewJob> jobs;
  for (int i = 0; i < 200; ++i) jobs.push_back(Job(std::to_string(i)));
  jobs[150].record.set_request_id("r");
  jobs[160].record.set_request_id("r");
  jobs[161].record.set_work_key("key of before");
  for (const int i : {170, 180, 190}) jobs[static_cast<std::size_t>(i)].record.set_work_key("one");
  fault_.commits = 0;
  const std::vector<absl::StatusOr<AcceptedChange>> accepted = store_->AcceptAll(context_, jobs);
  EXPECT_EQ(fault_.commits, 1);
  ASSERT_THAT(accepted, SizeIs(200));
  std::set<std::int64_t> numbers;
  for (std::size_t i = 0; i < accepted.size(); ++i) {
    ASSERT_TRUE(accepted[i].ok()) << accepted[i].status();
    EXPECT_EQ(accepted[i]->created, i != 160);
    EXPECT_EQ(accepted[i]->shares, i == 161 || i == 180 || i == 190) << i;
    const JobRecord& record = accepted[i]->change.record;
    EXPECT_EQ(record.job().name(), "jobs/" + std::to_string(i == 160 ? 150 : i));
    EXPECT_EQ(Find(record.job().name()).number(), record.number());
    numbers.insert(record.number());
  }
  EXPECT_THAT(numbers, SizeIs(199));
  EXPECT_EQ(Find("jobs/190").work(), "jobs/170");
  EXPECT_EQ((*store_->Accounts()).tenants.at("ann").waiting, 197) << "before, and all but 160, 161, 180 and 190";
  EXPECT_EQ(History("jobs/190"), "1 QUEUED");
}

TEST_P(JobStoreTest, ABatchStopsWhereTheQueueIsFull) {
  std::vector<NewJob> jobs;
  for (int i = 0; i < 5; ++i) {
    jobs.push_back(Job(std::to_string(i)));
    jobs.back().limits = QueueLimits();
    jobs.back().limits->tenant_jobs = 3;
  }
  const std::vector<absl::StatusOr<AcceptedChange>> accepted = store_->AcceptAll(context_, jobs);
  for (std::size_t i = 0; i < accepted.size(); ++i) {
    EXPECT_EQ(accepted[i]->room, i < 3 ? Room::kYes : Room::kTenantFull) << i;
  }
}

// A mesh that was sent a thousand times is no dearer than a new one.
TEST_P(JobStoreTest, JobsWithTheSameWorkThatEndedCostNothing) {
  Add("first", "same");
  const Lease lease = Claim();
  ASSERT_TRUE(store_->Finish(context_, lease, Success()).ok());
  constexpr int kKept = 4000, kAtOnce = 200;
  for (int i = 0; i < kKept; i += kAtOnce) {
    std::vector<NewJob> jobs;
    for (int k = 0; k < kAtOnce; ++k) {
      jobs.push_back(Job(std::to_string(i + k), "same"));
      jobs.back().result_of = "jobs/first";
    }
    store_->AcceptAll(context_, jobs);
  }
  ASSERT_EQ((*store_->Totals()).tenants.at("ann").ended, kKept + 1);
  // The cheapest of some: the machine may be busy.
  const auto cost = [&](const std::string& kind, const std::string& key) {
    absl::Duration least = absl::InfiniteDuration();
    for (int i = 0; i < 30; ++i) {
      NewJob job = Job(kind + std::to_string(i), key.empty() ? kind + std::to_string(i) : key);
      const absl::Time start = absl::Now();
      EXPECT_EQ((*store_->FindResult(job.record.work_key())).has_value(), !key.empty());
      EXPECT_TRUE(store_->IsUnderWay("ann", job.record.work_key()).ok());
      EXPECT_TRUE(store_->Accept(context_, job).ok());
      least = std::min(least, absl::Now() - start);
    }
    return least;
  };
  const absl::Duration other = cost("other", ""), same = cost("same", "same");
  EXPECT_LT(same, 4 * other);
}

TEST_P(JobStoreTest, CountsWhatEndedJobsTake) {
  const auto bytes = [this] { return (*store_->Totals()).tenants.at("ann").record_bytes; };
  Add("1");
  EXPECT_EQ(bytes(), 0);
  const Lease lease = Claim();
  ASSERT_TRUE(store_->Report(context_, lease, std::vector<v1::Progress>(100)).ok());
  AttemptOutcome outcome = Success();
  ASSERT_TRUE(store_->Finish(context_, lease, outcome).ok());
  const std::int64_t first = bytes();
  EXPECT_GT(first, 1000);
  EXPECT_LT(first, 5000);
  Add("2");
  outcome.report.add_warnings()->set_message(std::string(100'000, 'x'));
  ASSERT_TRUE(store_->Finish(context_, Claim(), outcome).ok());
  EXPECT_GT(bytes(), first + 100'000);
  EXPECT_LT(bytes(), first + 105'000);
  ASSERT_TRUE(store_->Expire(context_, "jobs/2").ok());
  EXPECT_GT(bytes(), first + 100'000) << "the report stays";
  ASSERT_TRUE(store_->Delete("jobs/2").ok());
  EXPECT_EQ(bytes(), first);
  EXPECT_THAT(*store_->DeleteOldest("ann", 10), SizeIs(1));
  EXPECT_EQ(bytes(), 0);
}

TEST_P(JobStoreTest, TimesAreInOrderThoughTheClockIsSetBack) {
  Add("1");
  v1::Job job = Find("jobs/1").job();
  NewJob now = Job("2");
  now.record.mutable_job()->clear_create_time();
  Accept(now);
  const Lease first = Claim();
  now_ -= absl::Hours(1);
  const Lease second = Claim();
  now_ -= absl::Hours(1);
  for (const Lease& lease : {first, second}) ASSERT_TRUE(store_->Finish(context_, lease, Success()).ok());
  for (const std::string name : {"jobs/1", "jobs/2"}) {
    job = Find(name).job();
    EXPECT_GE(job.start_time(), job.create_time()) << name;
    EXPECT_GE(job.end_time(), job.start_time()) << name;
    EXPECT_GE(job.report().times().queue().seconds(), 0) << name;
  }
}

TEST_P(JobStoreTest, AClockThatIsSetBackEndsNoLease) {
  Add("1");
  const Lease lease = Claim();
  now_ -= absl::Hours(1);
  EXPECT_THAT(*store_->Reap(context_, "", 10), IsEmpty());
  EXPECT_EQ(Claim("b").work, "") << "never two owners";
  now_ += absl::Hours(2);
  EXPECT_THAT(*store_->Reap(context_, "", 10), SizeIs(1));
  EXPECT_EQ(Claim("b").attempt, 2);
  EXPECT_EQ(ErrorReason(store_->Finish(context_, lease, Success()).status()), "LEASE_LOST");
}

TEST_P(JobStoreTest, AJobThatTakesItsOwnerDownFailsAfterThreeAttempts) {
  Add("1");
  for (int attempt = 1; attempt <= 3; ++attempt) {
    EXPECT_EQ(Claim().attempt, attempt);
    now_ += absl::Seconds(10);
    ASSERT_THAT(*store_->Reap(context_, "", 10), SizeIs(1));
  }
  EXPECT_EQ(ErrorOf("jobs/1"), "SERVER_CRASHED");
  EXPECT_EQ(Find("jobs/1").server_crashes(), 3);
}

TEST_P(JobStoreTest, TheOnlyOwnerTakesAllOtherLeases) {
  Add("1");
  Add("2");
  Claim("a");
  Claim("b");
  const std::vector<JobChange> reaped = *store_->Reap(context_, "b", 10);
  ASSERT_THAT(reaped, SizeIs(1));
  EXPECT_EQ(reaped[0].record.job().name(), "jobs/1");
  EXPECT_EQ(State("jobs/2"), v1::JOB_STATE_RUNNING);
}

TEST_P(JobStoreTest, WhatIsReleasedIsNotHeldAgainstIt) {
  Add("1");
  Add("2");
  Add("3");
  for (int i = 0; i < 5; ++i) {
    EXPECT_EQ(Claim().work, "jobs/1");
    EXPECT_EQ(Claim().work, "jobs/2");
    if (i == 4) {
      ASSERT_TRUE(store_->EndEarly(context_, "jobs/2", EarlyEnd::kCancel, false).ok());
    }
    EXPECT_THAT(*store_->Release(context_, "a"), SizeIs(2));
  }
  EXPECT_EQ(State("jobs/1"), v1::JOB_STATE_QUEUED);
  EXPECT_EQ(Find("jobs/1").crashes(), 0);
  EXPECT_EQ(State("jobs/2"), v1::JOB_STATE_CANCELLED) << "it was to end anyway";
}

// ---- how attempts end

TEST_P(JobStoreTest, WhatTheWorkerSaysBecomesOfItsJobs) {
  context_.retained_time = absl::Hours(1);
  Add("ok");
  ASSERT_TRUE(store_->Finish(context_, Claim(), Success()).ok());
  EXPECT_EQ(Find("jobs/ok").job().uv().total_bytes(), 5);
  EXPECT_TRUE(Find("jobs/ok").job().has_expire_time());
  EXPECT_EQ(store_->Events(Find("jobs/ok").number())->back().job().has_report(), false) << "the record has it";
  EXPECT_EQ((*store_->FindResult("key of ok"))->job().name(), "jobs/ok");

  Add("bad");
  AttemptOutcome error;
  error.status = ToRpcStatus(MakeError(absl::StatusCode::kInvalidArgument, "MESH_EMPTY", "no triangle"));
  ASSERT_TRUE(store_->Finish(context_, Claim(), error).ok());
  EXPECT_EQ(ErrorOf("jobs/bad"), "MESH_EMPTY");

  Add("odd");
  error.status = ToRpcStatus(absl::CancelledError("why not"));
  ASSERT_TRUE(store_->Finish(context_, Claim(), error).ok());
  EXPECT_EQ(ErrorOf("jobs/odd"), "INTERNAL");

  Add("late");
  const Lease lease = Claim();
  EXPECT_EQ(store_->EndEarly(context_, "jobs/late", EarlyEnd::kTimeout, true)->record.job().state(),
            v1::JOB_STATE_STOPPING);
  EXPECT_EQ(store_->Renew({lease}, absl::Seconds(1))->at(0), Wish::kCancel);
  ASSERT_TRUE(store_->Finish(context_, lease, Success()).ok());
  EXPECT_EQ(ErrorOf("jobs/late"), "DEADLINE_EXCEEDED");
}

TEST_P(JobStoreTest, LostWorkersCostThreeAttempts) {
  Add("1");
  for (int i = 0; i < 2; ++i) ASSERT_TRUE(store_->Finish(context_, Claim(), Lost()).ok());
  EXPECT_EQ(State("jobs/1"), v1::JOB_STATE_QUEUED);
  ASSERT_TRUE(store_->Finish(context_, Claim(), Lost()).ok());
  EXPECT_EQ(ErrorOf("jobs/1"), "WORKER_CRASHED");
  EXPECT_THAT(Find("jobs/1").job().error().message(), ::testing::HasSubstr("3 attempts"));
  Add("2");
  ASSERT_TRUE(store_->Finish(context_, Claim(), Lost(/*is_final=*/true)).ok());
  EXPECT_EQ(ErrorOf("jobs/2"), "WORKER_CRASHED");
  Add("3");
  const Lease lease = Claim();
  ASSERT_TRUE(store_->EndEarly(context_, "jobs/3", EarlyEnd::kCancel, false).ok());
  ASSERT_TRUE(store_->Finish(context_, lease, Lost()).ok());
  EXPECT_EQ(State("jobs/3"), v1::JOB_STATE_CANCELLED);
}

TEST_P(JobStoreTest, WorkWaitsForALargerReservation) {
  Add("1", "k");
  Add("2", "k");
  const auto claim = [this] {
    const ClaimRequest request = {"a", absl::Seconds(10), 1, /*memory_bytes=*/1000, "", nullptr};
    return *store_->Claim(context_, request);
  };
  AttemptOutcome outcome;
  outcome.status.set_code(static_cast<int>(absl::StatusCode::kResourceExhausted));
  outcome.memory_bytes = 600;
  ASSERT_TRUE(store_->Finish(context_, claim().at(0).lease, outcome).ok());
  EXPECT_EQ(History("jobs/2"), "1 QUEUED, 2 RUNNING, 3 QUEUED");
  EXPECT_EQ(Find("jobs/2").enlargements(), 1);
  EXPECT_EQ(Find("jobs/2").job().memory_bytes(), 600);
  EXPECT_EQ(Find("jobs/2").crashes(), 0);
  Add("3");
  const std::vector<ClaimedWork> larger = claim();
  ASSERT_EQ(larger.size(), 1u) << "it is in its old place";
  EXPECT_EQ(larger[0].memory_bytes, 600);
  EXPECT_EQ(larger[0].jobs.size(), 2u);
  ASSERT_TRUE(store_->EndEarly(context_, "jobs/1", EarlyEnd::kCancel, false).ok());
  outcome.memory_bytes = 1200;
  ASSERT_TRUE(store_->Finish(context_, larger[0].lease, outcome).ok());
  EXPECT_EQ(claim().at(0).lease.work, "jobs/3") << "this owner never has as much";
  EXPECT_EQ(State("jobs/2"), v1::JOB_STATE_QUEUED);
}

TEST_P(JobStoreTest, EarlyEndsOfWhatWaits) {
  Add("1", "k");
  Add("2", "k");
  NewJob third = Job("3");
  third.record.set_request_id("r3");
  Accept(third);
  EXPECT_EQ(store_->EndEarly(context_, "jobs/1", EarlyEnd::kCancel, false)->record.job().state(),
            v1::JOB_STATE_CANCELLED);
  EXPECT_EQ(Claim().work, "jobs/1") << "the work is still that of the other job";
  store_->EndEarly(context_, "jobs/3", EarlyEnd::kTimeout, true).IgnoreError();
  EXPECT_EQ(ErrorOf("jobs/3"), "DEADLINE_EXCEEDED");
  EXPECT_TRUE(Accept(third).change.record.job().name() == "jobs/3") << "by its name";
  third.record.mutable_job()->set_name("jobs/4");
  EXPECT_TRUE(Accept(third).created) << "the request id is free again";
  EXPECT_EQ(ErrorReason(store_->EndEarly(context_, "jobs/5", EarlyEnd::kCancel, false).status()), "JOB_NOT_FOUND");
  EXPECT_THAT(store_->EndEarly(context_, "jobs/3", EarlyEnd::kCancel, false)->events, IsEmpty());
  EXPECT_EQ(State("jobs/3"), v1::JOB_STATE_FAILED);
}

// ---- events

TEST_P(JobStoreTest, EventsHaveNoGaps) {
  Add("1", "k");
  Add("2", "k");
  const Lease lease = Claim();
  ASSERT_TRUE(store_->Report(context_, lease, {v1::Progress(), v1::Progress()}).ok());
  ASSERT_TRUE(Other().RequestStop(context_, "jobs/1").ok());
  ASSERT_TRUE(store_->Report(context_, lease, {v1::Progress()}).ok());
  ASSERT_TRUE(store_->Finish(context_, lease, Success()).ok());
  EXPECT_EQ(History("jobs/1"), "1 QUEUED, 2 RUNNING, 3 progress, 4 progress, 5 STOPPING, 6 progress, 7 SUCCEEDED");
  EXPECT_EQ(History("jobs/2"), "1 QUEUED, 2 RUNNING, 3 progress, 4 progress, 5 progress, 6 SUCCEEDED");
  EXPECT_THAT(*Other().Events(Find("jobs/1").number(), 5), SizeIs(2));
}

// A loss of power takes back progress, but no number that was told.
TEST_P(JobStoreTest, WhoTakesOverGoesOnBehindWhatMayHaveBeenTold) {
  Add("1");
  const Lease lease = Claim();
  const std::int64_t reserved = Find("jobs/1").reserved_sequence();
  ASSERT_GT(reserved, 100);
  const std::vector<v1::Progress> news(static_cast<std::size_t>(reserved) - 3);
  ASSERT_TRUE(store_->Report(context_, lease, news).ok());
  EXPECT_EQ(Find("jobs/1").reserved_sequence(), reserved) << "nothing that would have to be durable";
  ASSERT_TRUE(store_->Report(context_, lease, {news.begin(), news.begin() + 10}).ok());
  const std::int64_t next = Find("jobs/1").reserved_sequence();
  EXPECT_GT(next, reserved + 100);
  ASSERT_THAT(*store_->Reap(context_, "another", 10), SizeIs(1));
  EXPECT_EQ(store_->Events(Find("jobs/1").number())->back().sequence(), next + 1);
}

TEST_P(JobStoreTest, OfLongWorkTheNewestProgressIsKept) {
  Add("1");
  const Lease lease = Claim();
  for (int i = 0; i < 200; ++i) {
    ASSERT_TRUE(store_->Report(context_, lease, std::vector<v1::Progress>(50)).ok());
  }
  const std::vector<v1::JobEvent> events = *store_->Events(Find("jobs/1").number());
  EXPECT_LT(events.size(), 5000u);
  EXPECT_GT(events.size(), 2000u);
  EXPECT_TRUE(events[0].has_job() && events[1].has_job()) << "changes of state stay";
  EXPECT_EQ(events.back().sequence(), 10'002);
}

// ---- what is kept

TEST_P(JobStoreTest, RecordsAreKeptCountedAndDropped) {
  for (const char* name : {"1", "2", "3"}) {
    Add(name);
    ASSERT_TRUE(store_->Finish(context_, Claim(), Success()).ok());
    now_ += absl::Seconds(1);
  }
  Add("4");
  EXPECT_EQ((*store_->FirstEnded("ann", v1::JOB_STATE_SUCCEEDED))->job().name(), "jobs/1");
  EXPECT_EQ((*store_->FirstEnded("", v1::JOB_STATE_UNSPECIFIED))->job().name(), "jobs/1");
  EXPECT_FALSE((*store_->FirstEnded("bob", v1::JOB_STATE_UNSPECIFIED)).has_value());
  EXPECT_EQ(store_->Totals()->tenants.at("ann").ended, 3);
  EXPECT_EQ(store_->Totals()->tenants.at("ann").result_bytes, 15);
  EXPECT_THAT(*store_->Unfinished(), SizeIs(1));
  EXPECT_EQ(store_->Expire(context_, "jobs/1")->record.job().state(), v1::JOB_STATE_EXPIRED);
  EXPECT_EQ(store_->Expire(context_, "jobs/4")->record.job().state(), v1::JOB_STATE_QUEUED);
  EXPECT_EQ((*store_->FirstEnded("ann", v1::JOB_STATE_SUCCEEDED))->job().name(), "jobs/2");
  EXPECT_TRUE(*store_->UsesBlob({"ann", "uv"}));
  EXPECT_FALSE(*store_->UsesBlob({"ann", "mesh of key of 1"}));
  const std::int64_t number = Find("jobs/2").number();
  EXPECT_EQ(ErrorReason(store_->Delete("jobs/4")), "JOB_NOT_FINISHED");
  for (const char* name : {"jobs/2", "jobs/3"}) EXPECT_TRUE(store_->Delete(name).ok());
  EXPECT_THAT(*store_->Events(number), IsEmpty());
  EXPECT_FALSE(*store_->UsesBlob({"ann", "uv"}));
  EXPECT_FALSE((*store_->FindResult("key of 3")).has_value());
}

TEST_P(JobStoreTest, TheOldestAreDroppedTogether) {
  for (const char* name : {"1", "2", "3", "4"}) {
    Add(name);
    ASSERT_TRUE(store_->Finish(context_, Claim(), Success()).ok());
    now_ += absl::Seconds(1);
  }
  Add("5");
  EXPECT_THAT(*store_->DeleteOldest("bob", 10), IsEmpty());
  const std::vector<JobRecord> gone = *store_->DeleteOldest("ann", 2);
  ASSERT_THAT(gone, SizeIs(2));
  EXPECT_EQ(gone[0].job().name() + gone[1].job().name(), "jobs/1jobs/2");
  EXPECT_THAT(*store_->Events(gone[0].number()), IsEmpty());
  EXPECT_EQ(store_->Totals()->tenants.at("ann").ended, 2);
  EXPECT_EQ(store_->Totals()->tenants.at("ann").result_bytes, 10);
  EXPECT_THAT(*store_->DeleteOldest("", 10), SizeIs(2)) << "but not the one that has not ended";
  EXPECT_THAT(*store_->Unfinished(), SizeIs(1));
}

TEST_P(JobStoreTest, ListsAreFilteredAndPaged) {
  for (int i = 1; i <= 5; ++i) {
    NewJob job = Job(std::to_string(i));
    job.record.mutable_job()->mutable_create_time()->set_seconds(i);
    (*job.record.mutable_job()->mutable_labels())["file"] = i < 4 ? "a%.obj" : "b.obj";
    if (i == 5) job.record.mutable_job()->set_tenant("bob");
    Accept(job);
  }
  const auto names = [&](const std::string& filter, int limit = 0, std::int64_t before = 0) {
    std::string text;
    JobQuery query;
    query.filter = *ParseJobFilter(filter);
    query.limit = limit;
    query.before_number = before;
    const absl::StatusOr<std::vector<JobRecord>> records = store_->List(query);
    EXPECT_TRUE(records.ok()) << records.status();
    for (const JobRecord& record : *records) text += record.job().name().substr(5);
    return text;
  };
  EXPECT_EQ(names(""), "54321");
  EXPECT_EQ(names("", 2), "54");
  EXPECT_EQ(names("", 2, Find("jobs/4").number()), "32");
  EXPECT_EQ(names("labels.file = b.obj"), "54");
  EXPECT_EQ(names("labels.file = \"a%*\""), "321");
  EXPECT_EQ(names("labels.file != b.obj AND create_time >= 1970-01-01T00:00:02Z"), "32");
  EXPECT_EQ(names("state = RUNNING"), "");
  // More different statements than a connection keeps.
  for (int ones = 0; ones < 16; ++ones) {
    for (int others = 0; others < 16; ++others) {
      std::string filter = "state != RUNNING";
      for (int i = 0; i < ones; ++i) filter += " AND state = QUEUED";
      for (int i = 0; i < others; ++i) filter += " AND labels:file";
      EXPECT_EQ(names(filter), "54321");
    }
  }
}

INSTANTIATE_TEST_SUITE_P(Memory, JobStoreTest, ::testing::Values(Engine::kSqliteInMemory),
                         [](const auto&) { return std::string("Sqlite"); });
INSTANTIATE_TEST_SUITE_P(File, JobStoreTest, ::testing::Values(Engine::kSqlite),
                         [](const auto&) { return std::string("Sqlite"); });
INSTANTIATE_TEST_SUITE_P(Postgres, JobStoreTest, ::testing::Values(Engine::kPostgres),
                         [](const auto&) { return std::string("15"); });

}  // namespace
}  // namespace planish
