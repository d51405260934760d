#include <chrono>
#include <csignal>
#include <filesystem>
#include <memory>

#include "core/draco/codec.h"
#include "gmock/gmock.h"
#include "grpcpp/create_channel.h"
#include "gtest/gtest.h"
#include "planish/v1/planish.grpc.pb.h"
#include "tests/testing/daemon.h"
#include "tests/testing/files.h"
#include "tests/testing/meshes.h"

namespace planish {
namespace {

using ::testing::HasSubstr;

class PlanishdTest : public ::testing::Test {
 protected:
  std::string Address() const { return "unix:" + dir_.Path("s"); }

  std::unique_ptr<Daemon> Start(std::vector<std::string> flags = {}) {
    flags.push_back("--listen=" + Address());
    auto daemon = std::make_unique<Daemon>(std::move(flags), true);
    EXPECT_TRUE(daemon->WaitReady());
    stub_ = v1::Planish::NewStub(grpc::CreateChannel(Address(), grpc::InsecureChannelCredentials()));
    return daemon;
  }

  static v1::CreateJobRequest QuickJob() {
    v1::CreateJobRequest request;
    request.mutable_spec()->set_draco(*EncodeDraco(Bump(8)));
    return request;
  }

  // Minutes of work.
  static v1::CreateJobRequest LongJob() {
    v1::CreateJobRequest request;
    request.mutable_spec()->set_draco(*EncodeDraco(Bump(150)));
    request.mutable_spec()->mutable_options()->set_solver(v1::SOLVER_MINRES);
    request.mutable_spec()->mutable_options()->set_system(v1::SYSTEM_FULL);
    request.mutable_spec()->mutable_options()->set_preconditioner(v1::PRECONDITIONER_NONE);
    return request;
  }

  std::string Create(const v1::CreateJobRequest& request) {
    grpc::ClientContext context;
    v1::Job job;
    const grpc::Status status = stub_->CreateJob(&context, request, &job);
    EXPECT_TRUE(status.ok()) << status.error_message();
    return job.name();
  }

  // Reads events of a job as they come.
  struct Watcher {
    grpc::ClientContext context;
    std::unique_ptr<grpc::ClientReader<v1::WatchJobResponse>> reader;

    bool WaitFor(v1::Stage stage) {
      v1::WatchJobResponse response;
      while (reader->Read(&response)) {
        if (response.event().progress().stage() == stage) return true;
      }
      return false;
    }

    v1::JobState WaitForEnd() {
      v1::WatchJobResponse response;
      v1::JobState state = v1::JOB_STATE_UNSPECIFIED;
      while (reader->Read(&response)) {
        if (response.event().has_job()) state = response.event().job().state();
      }
      return state;
    }
  };

  std::unique_ptr<Watcher> Watch(const std::string& name) {
    auto watcher = std::make_unique<Watcher>();
    v1::WatchJobRequest request;
    request.set_name(name);
    watcher->reader = stub_->WatchJob(&watcher->context, request);
    return watcher;
  }

  TempDir dir_;
  std::unique_ptr<v1::Planish::Stub> stub_;
};

TEST_F(PlanishdTest, VersionAndUsage) {
  Daemon version({"--version"}, false);
  EXPECT_EQ(version.Wait(), 0);
  EXPECT_THAT(version.Output(), HasSubstr("planishd "));
  Daemon unknown({"--frobnicate"}, false);
  EXPECT_EQ(unknown.Wait(), 2);
  EXPECT_THAT(unknown.Output(), HasSubstr("--frobnicate"));
  Daemon address({"--listen=nonsense"}, false);
  EXPECT_EQ(address.Wait(), 2);
  EXPECT_THAT(address.Output(), HasSubstr("nonsense"));
}

TEST_F(PlanishdTest, ServesUntilSigterm) {
  const auto daemon = Start({"--listen=127.0.0.1:0", "--workers=2"});
  EXPECT_EQ(Watch(Create(QuickJob()))->WaitForEnd(), v1::JOB_STATE_SUCCEEDED);
  v1::Capabilities capabilities;
  grpc::ClientContext context;
  ASSERT_TRUE(stub_->GetCapabilities(&context, v1::GetCapabilitiesRequest(), &capabilities).ok());
  EXPECT_EQ(capabilities.workers(), 2);
  EXPECT_GE(capabilities.threads(), 1);
  EXPECT_GT(capabilities.solvers_size(), 3);
  daemon->Signal(SIGTERM);
  EXPECT_EQ(daemon->Wait(), 0);
  EXPECT_FALSE(std::filesystem::exists(dir_.Path("s")));
  EXPECT_THAT(daemon->Output(), HasSubstr("listens on 127.0.0.1:"));
  EXPECT_THAT(daemon->Output(), HasSubstr("SUCCEEDED"));
}

TEST_F(PlanishdTest, FlagsOfAFarmMakeSenseTogether) {
  const std::pair<std::vector<std::string>, std::string> wrong[] = {
      {{"--role=front"}, "--role needs --store"},
      {{"--blobs=/srv/blobs"}, "--blobs needs --store"},
      {{"--store=postgresql://u@h/d", "--data-dir=/tmp/d"}, "--data-dir and --store cannot be combined"},
      {{"--store=postgresql://u:secret@h/d"}, "--store-password-file"},
      {{"--store=postgresql://u@h/d?password=secret"}, "--store-password-file"},
      {{"--store=host=h password=secret"}, "--store-password-file"},
      {{"--store=postgresql://u@h/d", "--blobs=s3:///x"}, "does not name a bucket"},
      {{"--store=postgresql://u@h/d", "--blobs=blobs"}, "is not postgresql, s3://BUCKET/PREFIX or /DIRECTORY"},
  };
  for (const auto& [flags, message] : wrong) {
    Daemon refused(flags, false);
    EXPECT_EQ(refused.Wait(), 2) << message;
    EXPECT_THAT(refused.Output(), AllOf(HasSubstr(message), Not(HasSubstr("secret")))) << message;
  }
}

TEST_F(PlanishdTest, AddressInUse) {
  const auto first = Start();
  Daemon second({"--listen=" + Address()}, false);
  EXPECT_EQ(second.Wait(), 2);
  EXPECT_THAT(second.Output(), HasSubstr(dir_.Path("s")));
  EXPECT_EQ(Watch(Create(QuickJob()))->WaitForEnd(), v1::JOB_STATE_SUCCEEDED) << "the first serves on";
}

TEST_F(PlanishdTest, GraceFinishesWhatWasAccepted) {
  const auto daemon = Start({"--workers=1", "--grace=60"});
  std::vector<std::unique_ptr<Watcher>> watchers;
  for (int i = 0; i < 4; ++i) watchers.push_back(Watch(Create(QuickJob())));
  daemon->Signal(SIGTERM);
  for (const auto& watcher : watchers) EXPECT_EQ(watcher->WaitForEnd(), v1::JOB_STATE_SUCCEEDED);
  EXPECT_EQ(daemon->Wait(), 0);
}

TEST_F(PlanishdTest, EndOfGraceCancelsAndTellsWatchers) {
  const auto daemon = Start({"--workers=1", "--grace=0"});
  const auto running = Watch(Create(LongJob()));
  const auto queued = Watch(Create(QuickJob()));
  ASSERT_TRUE(running->WaitFor(v1::STAGE_SOLVE));
  daemon->Signal(SIGTERM);
  EXPECT_EQ(running->WaitForEnd(), v1::JOB_STATE_CANCELLED);
  EXPECT_EQ(queued->WaitForEnd(), v1::JOB_STATE_CANCELLED);
  EXPECT_EQ(daemon->Wait(), 0);
}

TEST_F(PlanishdTest, SecondSignalEndsTheGrace) {
  const auto daemon = Start({"--workers=1", "--grace=3600"});
  const auto running = Watch(Create(LongJob()));
  ASSERT_TRUE(running->WaitFor(v1::STAGE_SOLVE));
  daemon->Signal(SIGTERM);
  // Pending signals merge: the second one counts only after the first was taken, and that shows in a refusal.
  grpc::StatusCode code = grpc::StatusCode::OK;
  while (code == grpc::StatusCode::OK) {
    grpc::ClientContext context;
    v1::Job job;
    code = stub_->CreateJob(&context, QuickJob(), &job).error_code();
  }
  EXPECT_EQ(code, grpc::StatusCode::UNAVAILABLE);
  daemon->Signal(SIGTERM);
  EXPECT_EQ(running->WaitForEnd(), v1::JOB_STATE_CANCELLED);
  EXPECT_EQ(daemon->Wait(), 0);
}

// Issue 26: callers waited for ever, and the server said nothing.
TEST_F(PlanishdTest, EndsWithTheLastWordsOfWorkersThatCannotStart) {
  const std::string program = dir_.Path("worker");
  PutFile(program, "#!/bin/sh\necho 'error while loading shared libraries: libfoo.so.1' >&2\nexit 127\n");
  std::filesystem::permissions(program, std::filesystem::perms::owner_all);
  const auto start = std::chrono::steady_clock::now();
  const auto daemon = Start({"--workers=2", "--worker-program=" + program});
  grpc::ClientContext context;
  v1::WatchJobRequest request;
  request.set_name(Create(QuickJob()));
  const auto reader = stub_->WatchJob(&context, request);
  v1::Job last;
  for (v1::WatchJobResponse response; reader->Read(&response);) last = response.event().job();
  EXPECT_EQ(last.state(), v1::JOB_STATE_FAILED);
  EXPECT_THAT(last.error().message(), HasSubstr("libfoo.so.1"));
  EXPECT_EQ(daemon->Wait(), 2);
  EXPECT_LT(std::chrono::steady_clock::now() - start, std::chrono::seconds(10));
  EXPECT_THAT(daemon->Output(), HasSubstr("no worker can be started: "));
  EXPECT_THAT(daemon->Output(), HasSubstr("exited with code 127; it wrote: error while loading shared libraries"));
}

TEST_F(PlanishdTest, WorkersThatCannotStartCostNoDurableJob) {
  const std::string data = "--data-dir=" + dir_.Path("data");
  std::string name;
  {
    const auto daemon = Start({"--workers=1", "--worker-program=/bin/false", data});
    name = Create(QuickJob());
    EXPECT_EQ(daemon->Wait(), 2);
  }
  const auto daemon = Start({"--workers=1", data});
  EXPECT_EQ(Watch(name)->WaitForEnd(), v1::JOB_STATE_SUCCEEDED);
}

TEST_F(PlanishdTest, EndsWithItsSupervisor) {
  const auto daemon = Start({"--workers=1"});
  const auto running = Watch(Create(LongJob()));
  ASSERT_TRUE(running->WaitFor(v1::STAGE_SOLVE));
  daemon->Signal(SIGINT);  // Ctrl-C is the supervisor's business
  const auto start = std::chrono::steady_clock::now();
  daemon->CloseSupervisor();
  EXPECT_EQ(running->WaitForEnd(), v1::JOB_STATE_CANCELLED);
  EXPECT_EQ(daemon->Wait(), 0);
  EXPECT_LT(std::chrono::steady_clock::now() - start, std::chrono::seconds(5));
}

}  // namespace
}  // namespace planish
