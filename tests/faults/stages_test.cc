// What goes wrong at a named point of a job, through a real server with real workers.
#include <chrono>
#include <thread>

#include "core/base/sanitizers.h"
#include "core/draco/codec.h"
#include "gmock/gmock.h"
#include "google/rpc/error_details.pb.h"
#include "grpcpp/create_channel.h"
#include "grpcpp/security/credentials.h"
#include "gtest/gtest.h"
#include "planish/v1/planish.grpc.pb.h"
#include "tests/testing/daemon.h"
#include "tests/testing/files.h"
#include "tests/testing/meshes.h"

namespace planish {
namespace {

using ::testing::AnyOf;

const std::vector<std::string> kWithFailpoints = {"--workers=1", "--threads=1", "--failpoints", "--reattach-grace=60"};
const std::vector<std::string> kWithoutFailpoints = {"--workers=1", "--threads=1", "--reattach-grace=60"};

class Faults : public ::testing::Test {
 protected:
  Faults() : server_(directory_.Path("s"), kWithFailpoints) {}

  v1::Planish::Stub& stub() {
    if (stub_ == nullptr) {
      stub_ = v1::Planish::NewStub(grpc::CreateChannel(server_.target(), grpc::InsecureChannelCredentials()));
    }
    return *stub_;
  }

  // Creates a job at which `failpoint` happens; its name.
  std::string Create(const std::string& failpoint) {
    grpc::ClientContext context;
    if (!failpoint.empty()) context.AddMetadata("planish-failpoint", failpoint);
    v1::CreateJobRequest request;
    request.mutable_spec()->set_draco(*EncodeDraco(Bump(12)));
    request.mutable_spec()->mutable_scheduling()->set_fresh(true);
    v1::Job job;
    const grpc::Status status = stub().CreateJob(&context, request, &job);
    EXPECT_TRUE(status.ok()) << status.error_message();
    return job.name();
  }

  v1::Job Get(const std::string& name) {
    grpc::ClientContext context;
    v1::GetJobRequest request;
    request.set_name(name);
    v1::Job job;
    EXPECT_TRUE(stub().GetJob(&context, request, &job).ok());
    return job;
  }

  v1::Job WaitForEnd(const std::string& name) {
    grpc::ClientContext context;
    context.set_deadline(std::chrono::system_clock::now() + std::chrono::seconds(60));
    v1::WatchJobRequest request;
    request.set_name(name);
    const auto reader = stub().WatchJob(&context, request);
    for (v1::WatchJobResponse response; reader->Read(&response);) {
    }
    EXPECT_TRUE(reader->Finish().ok());
    return Get(name);
  }

  void WaitForState(const std::string& name, v1::JobState state) {
    WaitUntil([&] { return Get(name).state() == state; });
  }

  // A job whose worker hangs at `point`.
  std::string CreateHanging(const std::string& point) {
    const std::string name = Create(point + "=hang");
    WaitForState(name, v1::JOB_STATE_RUNNING);
    // A job without a fault takes a few milliseconds.
    std::this_thread::sleep_for(std::chrono::milliseconds(300));
    EXPECT_EQ(Get(name).state(), v1::JOB_STATE_RUNNING);
    return name;
  }

  static std::string ReasonOf(const v1::Job& job) {
    google::rpc::ErrorInfo info;
    return job.error().details_size() > 0 && job.error().details(0).UnpackTo(&info) ? info.reason() : "";
  }

  void ExpectHealthy() {
    EXPECT_EQ(WaitForEnd(Create("")).state(), v1::JOB_STATE_SUCCEEDED);
    EXPECT_EQ(server_.Zombies(), 0);
    EXPECT_TRUE(server_.IsRunning());
  }

  const TempDir directory_;
  DurableServer server_;
  std::unique_ptr<v1::Planish::Stub> stub_;
};

class WorkerFaults : public Faults, public ::testing::WithParamInterface<const char*> {};

TEST_P(WorkerFaults, CostTheJobThreeWorkersAndNobodyElseAnything) {
  if (kSanitized && std::string(GetParam()) == "solve=oom") GTEST_SKIP() << "no memory limit with sanitizers";
  const v1::Job job = WaitForEnd(Create(GetParam()));
  EXPECT_EQ(job.state(), v1::JOB_STATE_FAILED);
  EXPECT_THAT(ReasonOf(job), AnyOf("WORKER_CRASHED", "INTERNAL", "OUT_OF_MEMORY"));
  EXPECT_EQ(job.attempts(), 3);
  ExpectHealthy();
}

INSTANTIATE_TEST_SUITE_P(AtEveryPoint, WorkerFaults,
                         ::testing::Values("start=abort", "decode=segv", "solve=exit", "solve=oom", "encode=garbage",
                                           "result=mute"),
                         [](const auto& which) {
                           std::string name = which.param;
                           for (char& c : name) c = c == '=' ? '_' : c;
                           return name;
                         });

class ServerKilled : public Faults, public ::testing::WithParamInterface<const char*> {};

TEST_P(ServerKilled, TheNextOneEndsTheJob) {
  const std::string hangs = CreateHanging(GetParam());
  const std::string waits = Create("");
  server_.Kill();
  server_.SetFlags(kWithoutFailpoints);
  server_.Start();
  stub_ = nullptr;
  const v1::Job job = WaitForEnd(hangs);
  EXPECT_EQ(job.state(), v1::JOB_STATE_SUCCEEDED);
  EXPECT_EQ(job.attempts(), 2);
  EXPECT_EQ(WaitForEnd(waits).attempts(), 1);
  ExpectHealthy();
}

INSTANTIATE_TEST_SUITE_P(AtEveryPoint, ServerKilled, ::testing::Values("start", "decode", "solve", "encode", "result"),
                         [](const auto& which) { return std::string(which.param); });

TEST_F(Faults, HungWorkerIsKilledWhenTheJobIsCancelled) {
  const std::string name = CreateHanging("solve");
  grpc::ClientContext context;
  v1::CancelJobRequest request;
  request.set_name(name);
  v1::Job job;
  ASSERT_TRUE(stub().CancelJob(&context, request, &job).ok());
  EXPECT_EQ(WaitForEnd(name).state(), v1::JOB_STATE_CANCELLED);
  ExpectHealthy();
}

TEST_F(Faults, SigtermUnderLoadLeavesJobsToTheNextServer) {
  server_.Kill();
  server_.SetFlags({"--workers=1", "--threads=1", "--failpoints", "--grace=0"});
  server_.Start();
  std::vector<std::string> names = {Create("solve=hang")};
  for (int i = 0; i < 5; ++i) names.push_back(Create(""));
  EXPECT_EQ(server_.Terminate(), 0);
  server_.SetFlags(kWithoutFailpoints);
  server_.Start();
  stub_ = nullptr;
  for (const std::string& name : names) EXPECT_EQ(WaitForEnd(name).state(), v1::JOB_STATE_SUCCEEDED) << name;
}

// Issue 26: a mesh that takes the server down was run again after every restart, without end.
TEST_F(Faults, RestartsInALoopLoseNothingButWhatRunsEachTime) {
  const std::string runs = CreateHanging("solve");
  std::vector<std::string> names;
  for (int i = 0; i < 3; ++i) names.push_back(Create(""));
  for (int i = 0; i < 3; ++i) {
    server_.Kill();
    if (i == 2) server_.SetFlags(kWithoutFailpoints);
    server_.Start();
    stub_ = nullptr;
    if (i < 2) WaitForState(runs, v1::JOB_STATE_RUNNING);
  }
  const v1::Job job = WaitForEnd(runs);
  EXPECT_EQ(job.state(), v1::JOB_STATE_FAILED);
  EXPECT_EQ(ReasonOf(job), "SERVER_CRASHED");
  EXPECT_EQ(job.attempts(), 3);
  for (const std::string& name : names) EXPECT_EQ(WaitForEnd(name).state(), v1::JOB_STATE_SUCCEEDED) << name;
}

// Restarts in order count for nothing, however many there are.
TEST_F(Faults, RestartsInOrderLoseNothing) {
  server_.Kill();
  server_.SetFlags({"--workers=1", "--threads=1", "--failpoints", "--grace=0"});
  server_.Start();
  stub_ = nullptr;
  const std::string name = CreateHanging("solve");
  for (int i = 0; i < 4; ++i) {
    EXPECT_EQ(server_.Terminate(), 0);
    server_.Start();
    stub_ = nullptr;
    WaitForState(name, v1::JOB_STATE_RUNNING);
  }
  EXPECT_EQ(server_.Terminate(), 0);
  server_.SetFlags(kWithoutFailpoints);
  server_.Start();
  stub_ = nullptr;
  EXPECT_EQ(WaitForEnd(name).state(), v1::JOB_STATE_SUCCEEDED);
}

}  // namespace
}  // namespace planish
