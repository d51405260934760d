#include "server/monitoring.h"

#include <filesystem>

#include "gmock/gmock.h"
#include "gtest/gtest.h"
#include "tests/server/rpc/rpc_test_server.h"
#include "tests/testing/http_get.h"

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

  void Attach(const std::string& data_dir = "") {
    WatchedServer watched;
    watched.jobs = &server_.manager();
    watched.uploads = &server_.uploads();
    watched.blobs = &blobs_;
    watched.streams = &streams_;
    watched.rpc = &server_.rpc();
    watched.data_dir = data_dir;
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
  std::filesystem::create_directory(dir.Path("data"));
  Attach(dir.Path("data"));
  monitoring_.Beat();
  EXPECT_EQ(Ask("/readyz"), "200 ready\n");
  Monitoring other("1");
  EXPECT_TRUE(other.Listen(*ParseHttpAddress("127.0.0.1:0")).ok());
  WatchedServer watched;
  watched.jobs = &server_.manager();
  watched.rpc = &server_.rpc();
  watched.data_dir = dir.Path("gone");
  other.Attach(watched);
  other.Beat();
  const auto answer = HttpGet("http://" + *other.address(), "/readyz");
  EXPECT_EQ(answer.status, 503);
  EXPECT_THAT(answer.body, HasSubstr("gone: No such file or directory"));
}

TEST_F(MonitoringTest, NotLiveWhenCallsAreNotAnswered) {
  Attach();
  EXPECT_EQ(Ask("/livez"), "200 live\n");
  server_.rpc().Shutdown(absl::Now());
  EXPECT_THAT(Ask("/livez"), HasSubstr("503 the gRPC server does not answer"));
}

}  // namespace
}  // namespace planish
