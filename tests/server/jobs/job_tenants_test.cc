// Several tenants: what they cannot tell of each other, and what each may have.
#include <filesystem>
#include <functional>
#include <map>

#include "absl/strings/escaping.h"
#include "gmock/gmock.h"
#include "google/protobuf/unknown_field_set.h"
#include "gtest/gtest.h"
#include "server/store/sqlite.h"
#include "tests/server/blobs/blobs_in.h"
#include "tests/server/jobs/job_manager_fixture.h"
#include "tests/testing/files.h"

namespace planish {
namespace {

using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::SizeIs;

constexpr Rights kUser = {true, true, false, false};
const Caller kAnn = {"ann", "token one", kUser, "00-aa-bb-01"};
const Caller kBob = {"bob", "token one", kUser, ""};
const Caller kOperator = {"ops", "token ops", Rights::All(), ""};
const Caller kFarm = {"ann", "token farm", {true, false, false, false}, ""};
const Caller kOtherFarm = {"ann", "token other farm", {true, false, false, false}, ""};

class JobTenantsTest : public JobManagerTest {
 protected:
  JobTenantsTest() {
    options_.limits.queue_capacity = 100;
    options_.tenant_limits = [this](const std::string& tenant) {
      const auto found = limits_.find(tenant);
      return found == limits_.end() ? TenantLimits() : found->second;
    };
    Restart();
  }

  void RestartWithBytes(std::int64_t bytes) {
    manager_.reset();
    store_ = OpenStore(*OpenSqliteDatabase(":memory:"));
    blobs_ = std::make_unique<BlobCatalog>(BlobPlaces{}, bytes, options_.tenant_limits);
    Resume();
  }

  std::string CreateAs(
      const Caller& caller, const std::string& mesh = "",
      const std::function<void(JobRequest*)>& change = [](JobRequest*) {}) {
    JobRequest request = Request();
    if (!mesh.empty()) request.bytes = mesh;
    change(&request);
    const auto accepted = manager_->Create(caller, std::move(request));
    EXPECT_TRUE(accepted.ok()) << accepted.status();
    return accepted.ok() ? accepted->job.name() : "";
  }

  std::string EndedAs(const Caller& caller, const std::string& uv, const std::string& mesh = "") {
    const std::string name = CreateAs(caller, mesh);
    EXPECT_EQ(Take(), name);
    Succeed(name, uv);
    return name;
  }

  v1::JobState StateOf(const std::string& name) { return manager_->Get(kOperator, name)->state(); }

  // All answers about a job; the name in them is put as NAME.
  std::string EveryAnswer(const Caller& caller, const std::string& name) {
    std::string all;
    for (const absl::Status& status :
         {manager_->Get(caller, name).status(), manager_->Watch(caller, name, false, false).status(),
          manager_->Watch(caller, name, true, false).status(), manager_->Watch(caller, name, false, true).status(),
          manager_->Stop(caller, name).status(), manager_->Cancel(caller, name).status(),
          manager_->Delete(caller, name)}) {
      all += ToRpcStatus(status).ShortDebugString() + "\n" + status.ToString() + "\n";
    }
    for (std::size_t at = all.find(name); at != std::string::npos; at = all.find(name)) {
      all.replace(at, name.size(), "NAME");
    }
    return all;
  }

  std::map<std::string, TenantLimits> limits_;
};

// ---- what cannot be told

TEST_F(JobTenantsTest, AnotherTenantsJobIsNoneWordForWord) {
  const std::string ended = EndedAs(kAnn, "uv");
  const std::string running = CreateAs(kAnn);
  EXPECT_EQ(Take(), running);
  const std::string queued = CreateAs(kAnn);
  const std::string never = "jobs/id9";
  ASSERT_EQ(never.size(), ended.size()) << "the wire form has lengths in it";
  const std::string none = EveryAnswer(kBob, never);
  EXPECT_THAT(none, HasSubstr("JOB_NOT_FOUND"));
  for (const std::string& name : {ended, running, queued}) EXPECT_EQ(EveryAnswer(kBob, name), none);
  EXPECT_EQ(StateOf(ended), v1::JOB_STATE_SUCCEEDED);
  EXPECT_EQ(StateOf(running), v1::JOB_STATE_RUNNING) << "and nothing was done to it";
  EXPECT_EQ(StateOf(queued), v1::JOB_STATE_QUEUED);
  EXPECT_EQ(EveryAnswer(kFarm, queued), none) << "who may only submit sees no jobs";
  EXPECT_TRUE(manager_->Cancel(kAnn, queued).ok());
  EXPECT_TRUE(manager_->Cancel(kOperator, running).ok()) << "the right all-jobs";
}

TEST_F(JobTenantsTest, JobsSayWhoseTheyAreAndWhereTheyComeFrom) {
  const v1::Job job = *manager_->Get(kAnn, CreateAs(kAnn));
  EXPECT_EQ(job.tenant(), "ann");
  EXPECT_EQ(job.traceparent(), "00-aa-bb-01");
  Resume();
  EXPECT_EQ(manager_->Get(kAnn, job.name())->tenant(), "ann");
}

TEST_F(JobTenantsTest, RequestIdsAreEachTenantsOwn) {
  const auto with_id = [](JobRequest* request) { request->request_id = "r1"; };
  const std::string anns = CreateAs(kAnn, "mesh", with_id);
  const std::string bobs = CreateAs(kBob, "another mesh", with_id);
  EXPECT_NE(anns, bobs);
  EXPECT_EQ(CreateAs(kAnn, "mesh", with_id), anns);
  EXPECT_EQ(CreateAs(kBob, "another mesh", with_id), bobs);
  EXPECT_EQ(CreateAs(kFarm, "mesh", with_id), anns) << "a retry of the same tenant";
  Resume();
  EXPECT_EQ(CreateAs(kAnn, "mesh", with_id), anns);
  JobRequest other = Request("r1");
  EXPECT_EQ(ErrorInfoOf(manager_->Create(kAnn, other).status()).metadata.at("job"), anns);
  const absl::Status refused = manager_->Create(kFarm, other).status();
  EXPECT_EQ(Reason(refused), "REQUEST_ID_REUSED");
  EXPECT_THAT(ErrorInfoOf(refused).metadata, IsEmpty());
  EXPECT_THAT(std::string(refused.message()), ::testing::Not(HasSubstr(anns)));
}

TEST_F(JobTenantsTest, NothingIsSharedBetweenTenants) {
  const std::string anns = CreateAs(kAnn, "the same mesh");
  const std::string bobs = CreateAs(kBob, "the same mesh");
  EXPECT_EQ(manager_->Get(kBob, bobs)->result_of(), "");
  EXPECT_EQ(blobs_->bytes(), 2 * 13) << "each has its own, so room says nothing either";
  Take();
  Succeed(anns, "uv");
  EXPECT_EQ(StateOf(bobs), v1::JOB_STATE_QUEUED);
  EXPECT_EQ(Take(), bobs);
  Succeed(bobs, "uv");
  EXPECT_EQ(manager_->Get(kBob, CreateAs(kBob, "the same mesh"))->result_of(), bobs);
  ASSERT_TRUE(manager_->Delete(kAnn, anns).ok());
  manager_->Tick();
  EXPECT_EQ(manager_->Watch(kBob, bobs, false, true)->events->uv()->ReadAll().value(), "uv");
}

TEST_F(JobTenantsTest, ListsAreOfOnesOwnTenant) {
  const std::string anns = CreateAs(kAnn);
  CreateAs(kBob);
  CreateAs(kBob);
  const auto names = [this](const Caller& caller, const std::string& tenant) {
    v1::ListJobsRequest request;
    if (!tenant.empty()) request.set_filter("tenant = " + tenant);
    return manager_->List(caller, request)->jobs;
  };
  ASSERT_THAT(names(kAnn, ""), SizeIs(1));
  EXPECT_EQ(names(kAnn, "")[0].name(), anns);
  EXPECT_THAT(names(kAnn, "ann"), SizeIs(1));
  EXPECT_THAT(names(kAnn, "bob"), IsEmpty());
  EXPECT_THAT(names(kFarm, ""), IsEmpty());
  EXPECT_THAT(names(kOperator, ""), SizeIs(3));
  EXPECT_THAT(names(kOperator, "bob"), SizeIs(2));
  EXPECT_THAT(names(kOperator, "nobody"), IsEmpty());
}

TEST_F(JobTenantsTest, PageTokensAreEachTenantsOwnAndSayNothing) {
  for (int i = 0; i < 3; ++i) CreateAs(kAnn);
  for (int i = 0; i < 3; ++i) CreateAs(kBob);
  v1::ListJobsRequest request;
  request.set_page_size(1);
  const std::string token = manager_->List(kAnn, request)->next_page_token;
  const auto answer = [&](const Caller& caller, const std::string& page) {
    request.set_page_token(page);
    return manager_->List(caller, request);
  };
  ASSERT_TRUE(answer(kAnn, token).ok());
  const absl::Status foreign = answer(kBob, token).status();
  EXPECT_EQ(foreign.code(), absl::StatusCode::kInvalidArgument);
  EXPECT_EQ(foreign.ToString(), answer(kBob, "garbage").status().ToString());
  EXPECT_EQ(ToRpcStatus(foreign).SerializeAsString(),
            ToRpcStatus(answer(kBob, "garbage").status()).SerializeAsString());
  EXPECT_THAT(token, ::testing::Not(HasSubstr(store_->id())));
}

TEST_F(JobTenantsTest, WhoMayOnlySubmitComesBackToItsOwnJobs) {
  auto accepted = manager_->Create(kFarm, Request("r1", /*attached=*/true));
  const std::string name = accepted->job.name();
  EXPECT_TRUE(manager_->Watch(kFarm, name, /*attach=*/true, true).ok());
  EXPECT_EQ(Reason(manager_->Watch(kOtherFarm, name, /*attach=*/true, true).status()), "JOB_NOT_FOUND");
  manager_->Suspend();
  accepted->attachment = JobAttachment();
  Resume();
  EXPECT_TRUE(manager_->Watch(kFarm, name, /*attach=*/true, true).ok()) << "after a restart too";
  EXPECT_EQ(Reason(manager_->Get(kFarm, name).status()), "JOB_NOT_FOUND");
  EXPECT_EQ(Reason(manager_->Cancel(kOtherFarm, name).status()), "JOB_NOT_FOUND");
  EXPECT_TRUE(manager_->Cancel(kFarm, name).ok());
}

// ---- what each may have

TEST_F(JobTenantsTest, AFloodDelaysAnotherTenantByOneJobAtMost) {
  options_.workers = 2;
  options_.limits.queue_capacity = 2000;
  options_.queue_total = 2000;
  Restart();
  for (int i = 0; i < 1000; ++i) CreateAs(kAnn);
  std::vector<std::string> running = {Take(), Take()};
  for (int round = 0; round < 20; ++round) {
    now_ += absl::Seconds(10);
    Succeed(running[0]);
    running[0] = Take();
    const std::string single = CreateAs(kBob);
    EXPECT_EQ(manager_->Get(kBob, single)->queue_position(), 0);
    now_ += absl::Seconds(10);
    Succeed(running[1]);
    running[1] = Take();
    EXPECT_EQ(running[1], single) << "the next worker that has ended its job";
    now_ += absl::Seconds(10);
    Succeed(single);
    running[1] = Take();
  }
}

TEST_F(JobTenantsTest, SharesOfTheWorkers) {
  limits_["ann"].share = 2;
  options_.limits.queue_capacity = 2000;
  options_.queue_total = 2000;
  Restart();
  for (int i = 0; i < 400; ++i) {
    CreateAs(kAnn);
    CreateAs(kBob);
  }
  std::map<std::string, int> served;
  for (int i = 0; i < 300; ++i) {
    const std::string name = Take();
    ++served[manager_->Get(kOperator, name)->tenant()];
    now_ += absl::Seconds(3);
    Succeed(name);
  }
  EXPECT_NEAR(served["ann"], 200, 1);
  EXPECT_NEAR(served["bob"], 100, 1);
}

TEST_F(JobTenantsTest, QueuesAreEachTenantsOwn) {
  options_.limits.queue_capacity = 2;
  limits_["bob"].queue = 1;
  Restart();
  CreateAs(kAnn);
  Take();
  CreateAs(kAnn);
  CreateAs(kAnn);
  const absl::Status full = manager_->Create(kAnn, Request()).status();
  EXPECT_EQ(Reason(full), "QUEUE_FULL");
  EXPECT_EQ(ErrorInfoOf(full).metadata.at("queue_capacity"), "2");
  EXPECT_EQ(manager_->QueueCapacity(kBob), 1);
  CreateAs(kBob);
  const absl::Status bobs = manager_->Create(kBob, Request()).status();
  EXPECT_EQ(ErrorInfoOf(bobs).metadata.at("queue_capacity"), "1");
}

TEST_F(JobTenantsTest, RunningJobsOfATenant) {
  limits_["ann"].running = 1;
  options_.workers = 3;
  Restart();
  const std::string first = CreateAs(kAnn);
  const std::string second = CreateAs(kAnn);
  const std::string bobs = CreateAs(kBob);
  EXPECT_EQ(Take(), first);
  EXPECT_EQ(Take(), bobs);
  JobAssignment none;
  EXPECT_EQ(manager_->source()->TakeNext(absl::ZeroDuration(), &none), Turn::kNothing)
      << "a worker is free, but not for ann";
  Succeed(first);
  EXPECT_EQ(Take(), second);
}

TEST_F(JobTenantsTest, AJobThatWaitsForMemoryIsOvertakenOnlyUntilOthersHadAsMuch) {
  options_.workers = 4;
  options_.memory_bytes = 500;
  options_.estimate = [](std::string_view draco, std::int64_t, const v1::MeshSize&,
                         const v1::UnwrapOptions&) -> absl::StatusOr<JobNeeds> {
    JobNeeds needs;
    needs.memory_bytes = draco[0] == 'L' ? 500 : 100;
    needs.run_seconds = 10;
    return needs;
  };
  Restart();
  CreateAs(kAnn, "small");
  const std::string large = CreateAs(kAnn, "Large");
  std::vector<std::pair<std::string, int>> running;
  int rounds = 0;
  while (StateOf(large) == v1::JOB_STATE_QUEUED && rounds < 20) {
    ++rounds;
    // Bob always has jobs waiting that would fit.
    for (int i = 0; i < 3; ++i) CreateAs(kBob, "b" + std::to_string(3 * rounds + i));
    JobAssignment next;
    while (manager_->source()->TakeNext(absl::ZeroDuration(), &next) == Turn::kWork)
      running.emplace_back(next.name, next.attempt);
    now_ += absl::Seconds(10);
    for (const auto& [name, attempt] : running)
      manager_->source()->ReportResult(name, attempt, Success("uv"), *Blob::Copy("uv"));
    running.clear();
  }
  EXPECT_LE(rounds, 3);
}

TEST_F(JobTenantsTest, AFullStoreOfOneTenantIsItsOwnMatter) {
  limits_["ann"].store_bytes = 100;
  RestartWithBytes(1000);
  const std::string bobs = EndedAs(kBob, std::string(50, 'b'));
  const std::string anns = EndedAs(kAnn, std::string(60, 'a'));
  const std::string next = EndedAs(kAnn, std::string(70, 'c'));
  EXPECT_EQ(StateOf(anns), v1::JOB_STATE_EXPIRED) << "the oldest of that tenant goes first";
  EXPECT_EQ(StateOf(next), v1::JOB_STATE_SUCCEEDED);
  EXPECT_EQ(StateOf(bobs), v1::JOB_STATE_SUCCEEDED);
  JobRequest large = Request();
  large.bytes = std::string(101, 'm');
  const absl::Status refused = manager_->Create(kAnn, large).status();
  EXPECT_EQ(Reason(refused), "STORAGE_FULL");
  EXPECT_EQ(ToRpcStatus(refused).details_size(), 2) << "with a retry delay";
  EXPECT_THAT(std::string(refused.message()), HasSubstr("tenant ann"));
  EXPECT_EQ(StateOf(bobs), v1::JOB_STATE_SUCCEEDED);
  EXPECT_TRUE(manager_->Create(kBob, large).ok());
}

TEST_F(JobTenantsTest, WhoFillsTheWholeStoreGivesWayToOthersNotTheyToIt) {
  RestartWithBytes(300);
  const std::string bobs = EndedAs(kBob, std::string(60, 'b'));
  std::vector<std::string> anns;
  for (int i = 0; i < 5; ++i) anns.push_back(EndedAs(kAnn, std::string(70, static_cast<char>('0' + i))));
  EXPECT_EQ(StateOf(bobs), v1::JOB_STATE_SUCCEEDED) << "the oldest of all, but ann has more than her part";
  EXPECT_EQ(StateOf(anns[0]), v1::JOB_STATE_EXPIRED);
  EXPECT_EQ(StateOf(anns[4]), v1::JOB_STATE_SUCCEEDED);
  EndedAs(kBob, std::string(60, 'B'));
  EXPECT_EQ(StateOf(bobs), v1::JOB_STATE_SUCCEEDED);
}

TEST_F(JobTenantsTest, KeepsEachTenantsNewestEndedJobs) {
  options_.limits.retained_record_bytes = 4000;  // two of them
  options_.limits.retained_bytes = 100;
  Restart();
  const std::string bobs = EndedAs(kBob, std::string(100, 'b'));
  std::vector<std::string> anns;
  for (int i = 0; i < 4; ++i) anns.push_back(EndedAs(kAnn, std::string(60, static_cast<char>('0' + i))));
  EXPECT_EQ(StateOf(bobs), v1::JOB_STATE_SUCCEEDED);
  EXPECT_EQ(Reason(manager_->Get(kAnn, anns[1]).status()), "JOB_NOT_FOUND");
  EXPECT_EQ(StateOf(anns[2]), v1::JOB_STATE_EXPIRED);
  EXPECT_EQ(StateOf(anns[3]), v1::JOB_STATE_SUCCEEDED);
  Resume();
  EndedAs(kAnn, std::string(60, 'x'));
  EXPECT_EQ(StateOf(anns[3]), v1::JOB_STATE_EXPIRED) << "the counts go on after a restart";
  EXPECT_EQ(StateOf(bobs), v1::JOB_STATE_SUCCEEDED);
}

// ---- for operators

TEST_F(JobTenantsTest, Stats) {
  options_.limits.queue_capacity = 1;
  Restart();
  CreateAs(kAnn, "same");
  Take();
  CreateAs(kAnn, "same");
  now_ += absl::Seconds(5);
  CreateAs(kAnn, "", [](JobRequest* request) { request->scheduling.set_priority(v1::PRIORITY_HIGH); });
  now_ += absl::Seconds(5);
  CreateAs(kBob);
  EXPECT_FALSE(manager_->Create(kAnn, Request()).ok());
  EXPECT_FALSE(manager_->Create(kAnn, JobRequest()).ok());
  const ManagerStats stats = manager_->Stats();
  EXPECT_EQ(stats.running, 2);
  EXPECT_EQ(stats.running_work, 1);
  EXPECT_EQ(stats.queued, 2);
  EXPECT_EQ(stats.queued_work, 2);
  EXPECT_EQ(stats.oldest_wait, absl::Seconds(5));
  EXPECT_EQ(stats.refused_by_reason.at("QUEUE_FULL"), 1);
  EXPECT_EQ(stats.refused_by_reason.at("MESH_MISSING"), 1);
  EXPECT_EQ(stats.stored_bytes, blobs_->bytes());
  EXPECT_FALSE(stats.draining);
  ASSERT_THAT(stats.tenants, SizeIs(2));
  EXPECT_EQ(stats.tenants[0].tenant, "ann");
  EXPECT_EQ(stats.tenants[0].accepted, 3);
  EXPECT_EQ(stats.tenants[0].shared, 1);
  EXPECT_EQ(stats.tenants[0].refused, 2);
  EXPECT_EQ(stats.tenants[0].running, 2);
  EXPECT_EQ(stats.tenants[0].queued, 1);
  EXPECT_EQ(stats.tenants[0].waiting.at(v1::PRIORITY_HIGH).jobs, 1);
  EXPECT_EQ(stats.tenants[0].waiting.at(v1::PRIORITY_HIGH).longest, absl::Seconds(5));
  EXPECT_FALSE(stats.tenants[0].waiting.contains(v1::PRIORITY_NORMAL));
  EXPECT_EQ(stats.tenants[1].tenant, "bob");
  EXPECT_EQ(stats.tenants[1].waiting.at(v1::PRIORITY_NORMAL).longest, absl::ZeroDuration());
}

TEST_F(JobTenantsTest, DrainCanBeTakenBackUnlessTheServerEnds) {
  const std::string waits = CreateAs(kAnn);
  manager_->Drain(nullptr);
  EXPECT_TRUE(manager_->Stats().draining);
  EXPECT_EQ(Reason(manager_->Create(kAnn, Request()).status()), "DRAINING");
  EXPECT_EQ(Take(), waits) << "what was accepted goes on";
  EXPECT_TRUE(manager_->Undrain().ok());
  CreateAs(kAnn);
  manager_->Drain([] {});
  const absl::Status refused = manager_->Undrain();
  EXPECT_EQ(refused.code(), absl::StatusCode::kFailedPrecondition);
  EXPECT_EQ(Reason(refused), "SHUTTING_DOWN");
  EXPECT_EQ(Reason(manager_->Create(kAnn, Request()).status()), "DRAINING");
}

}  // namespace
}  // namespace planish
