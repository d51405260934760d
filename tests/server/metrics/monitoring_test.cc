#include "server/monitoring.h"

#include <atomic>
#include <filesystem>
#include <functional>
#include <mutex>
#include <optional>
#include <system_error>
#include <utility>

#include "gmock/gmock.h"
#include "gtest/gtest.h"
#include "server/metrics/patient_question.h"
#include "server/metrics/store_probe.h"
#include "tests/server/rpc/rpc_test_server.h"
#include "tests/testing/files.h"
#include "tests/testing/http_get.h"
#include "tests/testing/process.h"

namespace planish {
namespace {

using ::testing::HasSubstr;

constexpr char kOfService[] = "\x0a\x12planish.v1.Planish";

class MonitoringTest : public ::testing::Test {
 protected:
  MonitoringTest() : monitoring_("1.2.3"), server_(Succeed(1, "uv")) {
    EXPECT_TRUE(monitoring_.Listen(*ParseHttpAddress("127.0.0.1:0")).ok());
  }
  ~MonitoringTest() override { monitoring_.Detach(); }

  void Attach(std::function<absl::Status()> ask_store = nullptr) {
    WatchedServer watched;
    watched.jobs = &server_.manager();
    watched.uploads = &server_.uploads();
    watched.blobs = &blobs_;
    watched.streams = &streams_;
    watched.rpc = &server_.rpc();
    watched.ask_store = std::move(ask_store);
    monitoring_.Attach(watched);
  }

  std::string Health(const std::string& request) { return server_.CallBytes("/grpc.health.v1.Health/Check", request); }

  // "503 why"
  std::string Ask(const std::string& path) {
    const HttpReply answer = HttpGet("http://" + *monitoring_.address(), path);
    return std::to_string(answer.status) + " " + answer.body;
  }

  Monitoring monitoring_;
  RpcTestServer server_;
  BlobCatalog blobs_{{}, 1000};
  StreamCounter streams_;
};

TEST_F(MonitoringTest, IsLiveButNotReadyWhileItStarts) {
  EXPECT_EQ(Ask("/livez"), "200 live\n");
  EXPECT_EQ(Ask("/readyz"), "503 the server is starting\n");
  EXPECT_EQ(Ask("/metrics"), "503 the server is starting\n");
  EXPECT_THAT(Ask("/"), HasSubstr("404"));
  Attach();
  EXPECT_EQ(Ask("/livez"), "200 live\n");
  EXPECT_EQ(Ask("/readyz"), "200 ready\n");
  EXPECT_THAT(Ask("/metrics"), HasSubstr("\nplanish_ready 1\n"));
  EXPECT_EQ(Health(kOfService), kServing);
}

TEST_F(MonitoringTest, DrainingIsLiveAndNotReady) {
  Attach();
  server_.manager().Drain([] {});
  monitoring_.Beat();
  EXPECT_EQ(Ask("/livez"), "200 live\n");
  EXPECT_EQ(Ask("/readyz"), "503 the server is draining and takes no new jobs\n");
  EXPECT_EQ(Health(""), kServing);
  EXPECT_EQ(Health(kOfService), kNotServing);
  EXPECT_THAT(Ask("/metrics"), HasSubstr("\nplanish_draining 1\n"));
}

TEST_F(MonitoringTest, EndingIsLiveAndNotReadyAtOnce) {
  Attach();
  monitoring_.SetEnding();
  EXPECT_EQ(Health(kOfService), kNotServing);
  monitoring_.Beat();
  EXPECT_THAT(Ask("/readyz"), HasSubstr("503"));
  monitoring_.Detach();
  EXPECT_EQ(Ask("/livez"), "200 live\n");
  EXPECT_EQ(Ask("/metrics"), "503 the server is ending\n");
}

TEST_F(MonitoringTest, NotReadyWithoutAnyWorker) {
  WorkerPoolOptions pool;
  int told = 0;
  pool.on_start_failed = [&told](const absl::Status&, absl::Duration) { ++told; };
  monitoring_.Hook(&pool);
  Attach();
  pool.on_worker_ready({});
  pool.on_start_failed(absl::UnavailableError("no more processes"), absl::Seconds(1));
  monitoring_.Beat();
  EXPECT_EQ(Ask("/readyz"), "200 ready\n") << "there is another worker";
  pool.on_worker_end({});
  pool.on_start_failed(absl::UnavailableError("no more processes"), absl::Seconds(1));
  monitoring_.Beat();
  EXPECT_EQ(Ask("/readyz"), "503 no worker can be started: no more processes\n");
  EXPECT_EQ(Health(kOfService), kNotServing);
  EXPECT_EQ(Ask("/livez"), "200 live\n");
  pool.on_worker_ready({});
  monitoring_.Beat();
  EXPECT_EQ(Ask("/readyz"), "200 ready\n");
  EXPECT_EQ(Health(kOfService), kServing);
  EXPECT_EQ(told, 2) << "whoever listened before still does";
}

TEST_F(MonitoringTest, NotReadyWhereTheStoreCannotBeWritten) {
  TempDir dir;
  const std::string data = dir.Path("data");
  std::filesystem::create_directory(data);
  Attach([data] { return TryToWrite(data); });
  const auto ask = [this] {
    monitoring_.Beat();
    return Ask("/readyz");
  };
  EXPECT_EQ(ask(), "200 ready\n");
  // A question that is still being answered may have a file there.
  EXPECT_TRUE(WaitUntil([&] {
    std::error_code error;
    return std::filesystem::remove(data, error);
  }));
  EXPECT_TRUE(WaitUntil([&] { return ask() != "200 ready\n"; }));
  EXPECT_THAT(ask(), HasSubstr("data: No such file or directory"));
  EXPECT_EQ(Ask("/livez"), "200 live\n");
}

TEST(PatientQuestionTest, WaitsForALimitedTimeAndThenHasTheAnswerBefore) {
  std::mutex hang;
  std::atomic<int> asked = 0;
  PatientQuestion<int> question([&] {
    const int answer = ++asked;
    const std::lock_guard lock(hang);
    return answer;
  });
  std::optional<int> answer;
  EXPECT_TRUE(question.AskAndWait(std::chrono::seconds(60), &answer));
  EXPECT_EQ(answer, 1);
  EXPECT_TRUE(question.AskAndWait(std::chrono::seconds(60), &answer));
  EXPECT_EQ(answer, 2) << "each time anew";
  {
    const std::lock_guard lock(hang);
    EXPECT_FALSE(question.AskAndWait(std::chrono::milliseconds(10), &answer));
    EXPECT_EQ(answer, 2);
    // Nobody waits once more for what has been open for longer than that.
    EXPECT_TRUE(WaitUntil([&] { return question.Silence() > std::chrono::milliseconds(10); }));
    EXPECT_FALSE(question.AskAndWait(std::chrono::milliseconds(10), &answer));
    EXPECT_EQ(question.Newest(), 2);
    EXPECT_EQ(asked, 3);
  }
  EXPECT_TRUE(question.AskAndWait(std::chrono::seconds(60), &answer));
  EXPECT_EQ(answer, 4);
}

TEST_F(MonitoringTest, NotLiveWhenCallsAreNotAnswered) {
  Attach();
  EXPECT_EQ(Ask("/livez"), "200 live\n");
  server_.rpc().Shutdown(absl::Now());
  EXPECT_THAT(Ask("/livez"), HasSubstr("503 the gRPC server does not answer"));
}

}  // namespace
}  // namespace planish
