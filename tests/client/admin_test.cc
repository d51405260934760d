// AdminClient against a service that says what the test wants.
#include "planish/admin.h"

#include "gmock/gmock.h"
#include "google/protobuf/util/time_util.h"
#include "grpcpp/security/server_credentials.h"
#include "grpcpp/server.h"
#include "grpcpp/server_builder.h"
#include "gtest/gtest.h"
#include "planish/admin/v1/admin.grpc.pb.h"
#include "tests/client/fake_server.h"

namespace planish {
namespace {

using google::protobuf::util::TimeUtil;

class FakeAdmin : public admin::v1::Admin::Service {
 public:
  grpc::Status Drain(grpc::ServerContext*, const admin::v1::DrainRequest*, admin::v1::DrainResponse*) override {
    draining = true;
    return grpc::Status::OK;
  }
  grpc::Status Undrain(grpc::ServerContext*, const admin::v1::UndrainRequest*, admin::v1::UndrainResponse*) override {
    const google::rpc::Status rich = testing::MakeStatus(9, "the server is shutting down", "SHUTTING_DOWN");
    return grpc::Status(grpc::StatusCode::FAILED_PRECONDITION, rich.message(), rich.SerializeAsString());
  }
  grpc::Status GetStats(grpc::ServerContext*, const admin::v1::GetStatsRequest*, admin::v1::Stats* stats) override {
    stats->set_version("1.2.3");
    *stats->mutable_start_time() = TimeUtil::SecondsToTimestamp(1'000'000);
    stats->set_draining(draining);
    stats->set_workers(4);
    stats->set_workers_ready(3);
    stats->set_queued(2);
    stats->set_running(1);
    stats->set_reserved_memory_bytes(10);
    stats->set_memory_bytes(20);
    stats->set_stored_bytes(30);
    stats->set_store_bytes(40);
    *stats->mutable_oldest_wait() = TimeUtil::MillisecondsToDuration(2500);
    admin::v1::TenantStats* tenant = stats->add_tenants();
    tenant->set_tenant("farm");
    tenant->set_queued(2);
    tenant->set_running(1);
    tenant->set_accepted(7);
    tenant->set_refused(5);
    return grpc::Status::OK;
  }
  grpc::Status GetConfig(grpc::ServerContext*, const admin::v1::GetConfigRequest*, admin::v1::Config* config) override {
    config->set_yaml("queue: 64  # default\n");
    *config->mutable_load_time() = TimeUtil::SecondsToTimestamp(2'000'000);
    return grpc::Status::OK;
  }

  bool draining = false;
};

class AdminTest : public ::testing::Test {
 protected:
  AdminTest() {
    grpc::ServerBuilder builder;
    int port = 0;
    builder.AddListeningPort("127.0.0.1:0", grpc::InsecureServerCredentials(), &port);
    builder.RegisterService(&service_);
    server_ = builder.BuildAndStart();
    target_ = "127.0.0.1:" + std::to_string(port);
  }

  FakeAdmin service_;
  std::unique_ptr<grpc::Server> server_;
  std::string target_;
};

TEST_F(AdminTest, BringsWhatTheServerSays) {
  AdminClient admin(target_);
  admin.Drain();
  const ServerStats stats = admin.GetStats();
  EXPECT_EQ(stats.version, "1.2.3");
  EXPECT_EQ(std::chrono::system_clock::to_time_t(stats.start_time), 1'000'000);
  EXPECT_TRUE(stats.draining);
  EXPECT_EQ(stats.workers, 4);
  EXPECT_EQ(stats.workers_ready, 3);
  EXPECT_EQ(stats.queued, 2);
  EXPECT_EQ(stats.running, 1);
  EXPECT_FALSE(stats.IsIdle());
  EXPECT_EQ(stats.reserved_memory_bytes, 10);
  EXPECT_EQ(stats.memory_bytes, 20);
  EXPECT_EQ(stats.stored_bytes, 30);
  EXPECT_EQ(stats.store_bytes, 40);
  EXPECT_EQ(stats.oldest_wait, Seconds(2.5));
  ASSERT_EQ(stats.tenants.size(), 1u);
  EXPECT_EQ(stats.tenants[0].name, "farm");
  EXPECT_EQ(stats.tenants[0].queued, 2);
  EXPECT_EQ(stats.tenants[0].running, 1);
  EXPECT_EQ(stats.tenants[0].accepted, 7);
  EXPECT_EQ(stats.tenants[0].refused, 5);
  const ServerConfig config = admin.GetConfig();
  EXPECT_EQ(config.yaml, "queue: 64  # default\n");
  EXPECT_EQ(std::chrono::system_clock::to_time_t(config.load_time), 2'000'000);
}

TEST_F(AdminTest, ErrorsCarryTheirReason) {
  AdminClient admin(target_);
  try {
    admin.Undrain();
    FAIL() << "no error";
  } catch (const Error& error) {
    EXPECT_EQ(error.code(), ErrorCode::kFailedPrecondition);
    EXPECT_EQ(error.reason(), "SHUTTING_DOWN");
  }
  server_->Shutdown();
  try {
    AdminClient(target_).GetStats();
    FAIL() << "no error";
  } catch (const Error& error) {
    EXPECT_EQ(error.reason(), "SERVER_UNREACHABLE");
  }
}

}  // namespace
}  // namespace planish
