// What dies in a farm, and what callers see of it.
#include <unistd.h>

#include <chrono>
#include <csignal>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <string>
#include <vector>

#include "core/base/sanitizers.h"
#include "gmock/gmock.h"
#include "gtest/gtest.h"
#include "planish/admin.h"
#include "tests/farm/farm_fixture.h"
#include "tests/server/blobs/s3_server.h"
#include "tests/testing/http_get.h"

namespace planish {
namespace {

using ::testing::HasSubstr;

// Callers of a front that was killed go on at another within 2 s. On a busy machine that may take longer, and does with
// sanitizers.
constexpr double kLongestGapSeconds = kSanitized ? 10 : 5;

TEST_F(FarmTest, AJobOfOneFrontIsSeenAtAnother) {
  StartWorker("w");
  StartFront("a");
  StartFront("b");
  Client a = ClientOf("a"), b = ClientOf("b");
  const Job job = a.CreateJob(quick_.View());
  Heard heard;
  const UnwrapResult result = b.AttachResult(job.name, quick_.View(), heard.Listen());
  EXPECT_TRUE(heard.in_order());
  EXPECT_EQ(heard.skipped(), 0);
  EXPECT_EQ(heard.ends(), 1);
  EXPECT_EQ(result.uv.As<double>().size(), 2 * quick_.triangles.size());
  // The result is the farm's.
  Heard again;
  EXPECT_EQ(a.Unwrap(quick_.View(), {}, again.Listen()).uv.As<double>(), result.uv.As<double>());
  EXPECT_EQ(b.ListJobs().size(), 2u);
  EXPECT_EQ(b.GetCapabilities().workers, 1) << "of all servers";
  const ServerStats stats = AdminClient("unix:" + SocketOf("b")).GetStats();
  EXPECT_EQ(stats.workers, 1);
  EXPECT_EQ(stats.workers_ready, 1);
  EXPECT_GT(stats.memory_bytes, 0);
}

// A worker whose clock was a minute slow lost results, and jobs seemed to start before they came.
TEST_F(FarmTest, AClockThatIsWrongChangesNoJob) {
  if (kSanitized) GTEST_SKIP() << "the sanitizer wants to be loaded first";
  Start("front", {"--role=front", "--listen=unix:" + SocketOf("front"), "--retain-hours=0.01"});
  setenv("LD_PRELOAD", PLANISH_SHIFTED_CLOCK, 1);
  setenv("CLOCK_SHIFT", "-60", 1);
  Daemon& worker = Start(
      "worker", {"--role=worker", "--workers=1", "--threads=1", "--retain-hours=0.01", "--metrics-listen=127.0.0.1:0"});
  unsetenv("LD_PRELOAD");
  unsetenv("CLOCK_SHIFT");
  Client client = ClientOf("front");
  const auto before = std::chrono::system_clock::now() - std::chrono::seconds(10);
  for (int i = 0; i < 5; ++i) {
    const Arrays mesh(5 + i);
    const Job job = client.CreateJob(mesh.View());
    const Job ended = client.WaitJob(job.name, Seconds(60));
    ASSERT_EQ(ended.state, JobState::kSucceeded);
    EXPECT_GE(*ended.start_time, *ended.create_time);
    EXPECT_GE(*ended.end_time, *ended.start_time);
    EXPECT_GE(*ended.create_time, before);
    EXPECT_GE(*ended.end_time, before) << "36 s later its UV go";
    EXPECT_GT(client.AttachResult(job.name, mesh.View()).uv.size(), 0u);
  }
  const std::string log = worker.ReadUntil("this machine's clock is");
  EXPECT_THAT(log, HasSubstr("behind the database's"));
  const std::size_t at = log.find("http://");
  const std::string metrics = HttpGet(log.substr(at, log.find_first_of("\n\" ", at) - at), "/metrics").body;
  EXPECT_THAT(metrics, ::testing::ContainsRegex("planish_clock_skew_seconds -(59|60)"));
}

TEST_F(FarmTest, JobsOfTwoFrontsShareTheirWork) {
  StartFront("a");
  StartFront("b");
  Client a = ClientOf("a"), b = ClientOf("b");
  const Job first = a.CreateJob(quick_.View()), second = b.CreateJob(quick_.View());
  EXPECT_EQ(second.result_of, first.name);
  StartWorker("w");
  EXPECT_EQ(a.WaitJob(second.name, Seconds(60)).state, JobState::kSucceeded);
  EXPECT_EQ(b.WaitJob(first.name, Seconds(60)).state, JobState::kSucceeded);
}

TEST_F(FarmTest, AFrontThatIsKilledCostsItsCallersASecondOrTwo) {
  StartFront("a");
  StartFront("b");
  if (!StartProxy({"a", "b"})) GTEST_SKIP() << "there is no " << kHaproxy;
  StartWorker("w");
  Client client = ClientOf("proxy");
  Heard heard;
  Call call = client.StartUnwrap(slow_.View(), Slowly(), heard.Listen());
  ASSERT_TRUE(WaitUntil([&] { return heard.count() > 3; }));
  // The log of the front that has the call says so.
  const std::string has = daemons_["a"]->Output().find(call.job()) != std::string::npos ? "a" : "b";
  const double killed = Now();
  daemons_[has]->Signal(SIGKILL);
  daemons_[has]->Wait();
  EXPECT_TRUE(WaitUntil([&] { return heard.Silence(killed) < 1e9; }));
  EXPECT_LT(heard.Silence(killed), kLongestGapSeconds);
  // So does one that ends in order.
  StartFront(has);
  ASSERT_TRUE(WaitUntil([&] { return daemons_[has]->IsRunning(); }));
  usleep(500'000);  // HAProxy has seen it
  const double ended = Now();
  Daemon& other = *daemons_[has == "a" ? "b" : "a"];
  other.CloseSupervisor();
  EXPECT_EQ(other.Wait(), 0) << other.Output();
  EXPECT_TRUE(WaitUntil([&] { return heard.Silence(ended) < 1e9; }));
  call.Stop();
  const UnwrapResult result = call.Wait();
  EXPECT_TRUE(heard.in_order());
  EXPECT_EQ(heard.skipped(), 0);
  EXPECT_EQ(heard.ends(), 1);
  EXPECT_EQ(result.uv.As<double>().size(), 2 * slow_.triangles.size());
}

// The example for JavaScript, with arrays and @grpc/grpc-js.
TEST_F(FarmTest, AFrontThatIsKilledCostsJavaScriptASecondOrTwoToo) {
  StartFront("a");
  StartFront("b");
  if (!StartProxy({"a", "b"})) GTEST_SKIP() << "there is no " << kHaproxy;
  StartWorker("w");
  Process node({"/bin/sh", "-c", "exec " PLANISH_NODE " slow_unwrap.mjs unix:" + SocketOf("proxy")});
  const auto heard = [&] { return node.Out().size(); };
  ASSERT_TRUE(
      WaitUntil([&] { return node.Out().find("progress\nprogress\n") != std::string::npos || !node.IsRunning(); }, 60));
  if (node.Out().find("SKIPPED") != std::string::npos) GTEST_SKIP() << node.Out();
  ASSERT_TRUE(node.IsRunning()) << node.Err();
  const std::string job = ClientOf("proxy").ListJobs().at(0).name;
  const std::string has = daemons_["a"]->Output().find(job) != std::string::npos ? "a" : "b";
  const double killed = Now();
  daemons_[has]->Signal(SIGKILL);
  daemons_[has]->Wait();
  const std::size_t before = heard();
  EXPECT_TRUE(WaitUntil([&] { return heard() > before; }));
  EXPECT_LT(Now() - killed, kLongestGapSeconds);
  Client client = ClientOf("proxy");
  EXPECT_EQ(client.ListJobs().size(), 1u) << "the same job";
  client.StopJob(job);
  EXPECT_EQ(node.Wait().exit_code, 0) << node.Err();
  EXPECT_THAT(node.Out(), HasSubstr("uv of 45000 triangles"));
}

TEST_F(FarmTest, AWorkerThatDiesOrSleepsLosesItsJobToAnother) {
  StartFront("a");
  Daemon& first = StartWorker("first");
  Client client = ClientOf("a");
  Heard heard;
  Call call = client.StartUnwrap(slow_.View(), Slowly(), heard.Listen());
  ASSERT_TRUE(WaitUntil([&] { return heard.count() > 3; }));
  first.Signal(SIGKILL);
  StartWorker("second");
  ASSERT_TRUE(WaitUntil([&] { return client.GetJob(call.job()).attempts == 2; }));
  // It does not renew its lease, and when it goes on somebody else has the job.
  daemons_["second"]->Signal(SIGSTOP);
  StartWorker("third");
  ASSERT_TRUE(WaitUntil([&] { return client.GetJob(call.job()).attempts == 3; }));
  daemons_["second"]->Signal(SIGCONT);
  const std::size_t before = heard.count();
  ASSERT_TRUE(WaitUntil([&] { return heard.count() > before + 5; })) << "the third one goes on with it";
  EXPECT_EQ(client.GetJob(call.job()).attempts, 3);
  call.Stop();
  call.Wait();
  EXPECT_TRUE(heard.in_order()) << "numbers that a lost attempt may have told are left out";
  EXPECT_EQ(heard.ends(), 1);
  EXPECT_EQ(client.GetJob(call.job()).state, JobState::kSucceeded);
}

TEST_F(FarmTest, NothingIsLostWithTheDatabasesProcesses) {
  StartFront("a");
  StartWorker("w", 2);
  Client client = ClientOf("a");
  Heard heard;
  Call running = client.StartUnwrap(slow_.View(), Slowly(), heard.Listen());
  ASSERT_TRUE(WaitUntil([&] { return heard.count() > 3; }));
  std::vector<std::string> jobs;
  CallOptions fresh;
  fresh.scheduling.fresh = true;
  for (int i = 0; i < 8; ++i) jobs.push_back(client.CreateJob(quick_.View(), {}, fresh).name);
  postgres_->Crash();
  usleep(300'000);
  postgres_->Start();
  for (const std::string& job : jobs) EXPECT_EQ(client.WaitJob(job, Seconds(60)).state, JobState::kSucceeded) << job;
  running.Stop();
  running.Wait();
  EXPECT_TRUE(heard.in_order());
  EXPECT_EQ(heard.skipped(), 0);
  EXPECT_EQ(heard.ends(), 1);
}

TEST_F(FarmTest, AServerThatEndsInOrderLeavesItsJobToAnother) {
  StartFront("a");
  StartWorker("first");
  Client client = ClientOf("a");
  Heard heard;
  Call call = client.StartUnwrap(slow_.View(), Slowly(), heard.Listen());
  ASSERT_TRUE(WaitUntil([&] { return heard.count() > 3; }));
  StartWorker("second");
  daemons_["first"]->CloseSupervisor();
  EXPECT_EQ(daemons_["first"]->Wait(), 0) << daemons_["first"]->Output();
  ASSERT_TRUE(WaitUntil([&] { return client.GetJob(call.job()).state == JobState::kRunning; }));
  // So does a front: its callers go on at the next one.
  const double begin = Now();
  daemons_["a"]->CloseSupervisor();
  EXPECT_EQ(daemons_["a"]->Wait(), 0) << daemons_["a"]->Output();
  StartFront("a");
  EXPECT_TRUE(WaitUntil([&] { return heard.Silence(begin) < 1e9; }));
  call.Stop();
  call.Wait();
  EXPECT_TRUE(heard.in_order());
  EXPECT_EQ(heard.skipped(), 0);
  EXPECT_EQ(heard.ends(), 1);
}

// A standby takes over; the old primary, which would still take writes, is not used when it is back.
TEST_F(FarmTest, AStandbyThatIsPromotedGoesOn) {
  PostgresServer standby(*postgres_);
  const std::string database = url_.substr(0, url_.find('?'));
  url_ = database + "?host=" + postgres_->host() + "," + standby.host() + "&target_session_attrs=read-write";
  StartFront("a");
  StartWorker("w");
  Client client = ClientOf("a");
  Heard heard;
  Call call = client.StartUnwrap(slow_.View(), Slowly(), heard.Listen());
  ASSERT_TRUE(WaitUntil([&] { return heard.count() > 3; }));
  EXPECT_THAT(daemons_["a"]->Output(), HasSubstr("asynchronous")) << "it warns of what may be lost";
  postgres_->WaitForStandbys();
  postgres_->Crash();
  standby.Promote();
  const double promoted = Now();
  ASSERT_TRUE(WaitUntil([&] { return heard.Silence(promoted) < 1e9; }));
  postgres_->Start();
  CallOptions fresh;
  fresh.scheduling.fresh = true;
  for (int i = 0; i < 5; ++i)
    EXPECT_EQ(client.Unwrap(quick_.View(), {}, {}, fresh).uv.As<double>().size(), 2 * quick_.triangles.size());
  call.Stop();
  call.Wait();
  EXPECT_EQ(heard.ends(), 1);
  // A server that has seen neither of them chooses the new one, too.
  StartFront("fresh");
  EXPECT_EQ(ClientOf("fresh").ListJobs().size(), 6u);
  // All of it is at the new one.
  url_ = database + "?host=" + standby.host();
  StartFront("b");
  EXPECT_EQ(ClientOf("b").ListJobs().size(), 6u);
  url_ = database + "?host=" + postgres_->host();
  StartFront("c");
  EXPECT_LE(ClientOf("c").ListJobs().size(), 1u);
}

// What deploy/FARM.md says of backups: a copy by pg_dump is a farm with all results.
TEST_F(FarmTest, ABackupIsAFarm) {
  StartWorker("w");
  StartFront("a");
  const UnwrapResult result = ClientOf("a").Unwrap(quick_.View());
  url_ = postgres_->Copy(url_);
  StartFront("b");
  EXPECT_EQ(ClientOf("b").AttachResult(result.job, quick_.View()).uv.As<double>(), result.uv.As<double>());
}

// UV that are too large for a row.
TEST_F(FarmTest, ABackupAndACopyOfTheBucketAreAFarm) {
  S3Server s3;
  if (!s3.why_not().empty()) GTEST_SKIP() << s3.why_not();
  std::ofstream(dir_.Path("keys")) << "[default]\naws_access_key_id = " << s3.Options().credentials.access_key_id
                                   << "\naws_secret_access_key = " << s3.Options().credentials.secret_access_key
                                   << "\n";
  const auto set_prefix = [&](const std::string& prefix) {
    blobs_ = {"--blobs=s3://blobs/" + prefix, "--s3-endpoint=" + s3.Options().endpoint,
              "--s3-credentials=" + dir_.Path("keys")};
  };
  set_prefix("farm");
  StartWorker("w");
  StartFront("a");
  const UnwrapResult result = ClientOf("a").Unwrap(slow_.View());
  url_ = postgres_->Copy(url_);  // first the database, then the bucket
  const std::filesystem::path bucket = s3.FileOf("farm").parent_path();
  std::filesystem::copy(bucket / "farm", bucket / "copy", std::filesystem::copy_options::recursive);
  std::filesystem::remove_all(bucket / "farm");
  set_prefix("copy");
  StartFront("b");
  EXPECT_EQ(ClientOf("b").AttachResult(result.job, slow_.View()).uv.As<double>(), result.uv.As<double>());
}

}  // namespace
}  // namespace planish
