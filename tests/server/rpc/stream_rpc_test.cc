// Unwrap and WatchJob.
#include <chrono>
#include <cstring>
#include <thread>

#include "core/base/error.h"
#include "gmock/gmock.h"
#include "gtest/gtest.h"
#include "server/link/mesh_elements.h"
#include "tests/server/rpc/rpc_test_server.h"

namespace planish {
namespace {

v1::UnwrapRequest UnwrapOfMesh() {
  v1::UnwrapRequest request;
  request.mutable_spec()->set_draco("mesh");
  return request;
}

Received Unwrap(RpcTestServer& server, const v1::UnwrapRequest& request) {
  grpc::ClientContext context;
  return ReceiveAll(server.stub().Unwrap(&context, request).get());
}

v1::WatchJobRequest WatchRequest(const std::string& name, std::int64_t after, bool uv = false,
                                 std::int64_t offset = 0) {
  v1::WatchJobRequest request;
  request.set_name(name);
  request.set_after_sequence(after);
  request.set_include_uv(uv);
  request.set_uv_offset(offset);
  return request;
}

Received Watch(RpcTestServer& server, const v1::WatchJobRequest& request) {
  grpc::ClientContext context;
  return ReceiveAll(server.stub().WatchJob(&context, request).get());
}

// A call to Unwrap under way whose first `events` events were read.
class UnwrapCaller {
 public:
  UnwrapCaller(RpcTestServer& server, const v1::UnwrapRequest& request, int events,
               std::chrono::milliseconds deadline = std::chrono::minutes(1)) {
    context_.set_deadline(std::chrono::system_clock::now() + deadline);
    reader_ = server.stub().Unwrap(&context_, request);
    v1::UnwrapResponse response;
    for (int i = 0; i < events && reader_->Read(&response); ++i) {
      if (response.event().has_job()) name_ = response.event().job().name();
    }
  }

  const std::string& name() const { return name_; }
  void GoAway() { context_.TryCancel(); }
  Received Rest() { return ReceiveAll(reader_.get()); }

 private:
  grpc::ClientContext context_;
  std::unique_ptr<grpc::ClientReader<v1::UnwrapResponse>> reader_;
  std::string name_;
};

v1::JobState EndState(RpcTestServer& server, const std::string& name) {
  return Follow(*server.manager().Watch(kEverybody, name, false, false)->events).back().job().state();
}

TEST(UnwrapRpc, SeamsReachTheWorkerAndAreNotEchoed) {
  std::vector<std::vector<std::int32_t>> seen;
  RpcTestServer server([&seen](ServerLink& link, const ServerLink::Received& received) {
    EXPECT_EQ(received.blobs.size(), 2u);
    EXPECT_EQ(received.blobs.at(0)->bytes(), "mesh");
    v1::MeshElements elements;
    EXPECT_TRUE(elements.ParseFromString(std::string(received.blobs.at(1)->bytes())));
    const auto numbers = DecodeMeshElements(elements, {}, std::nullopt);
    seen.push_back(numbers->seam_corners);
    seen.push_back(numbers->uncut_corners);
    SendSuccess(link, "uv");
    return true;
  });
  const auto bytes = [](const std::vector<std::int32_t>& numbers) { return PackNumbers<std::int32_t>(numbers); };
  v1::UnwrapRequest request = UnwrapOfMesh();
  request.mutable_spec()->mutable_elements()->set_seam_corners(bytes({7, 0, 7}));
  const Received received = Unwrap(server, request);
  EXPECT_TRUE(received.status.ok()) << received.status.error_message();
  EXPECT_EQ(received.LastJob().mesh_bytes(), 4 + 3 * 4);

  v1::CreateJobRequest create;
  create.mutable_spec()->set_draco("mesh");
  create.mutable_spec()->mutable_elements()->set_seam_corners(bytes({3}));
  create.mutable_spec()->mutable_elements()->set_uncut_corners(bytes({8}));
  grpc::ClientContext context;
  v1::Job job;
  ASSERT_TRUE(server.stub().CreateJob(&context, create, &job).ok());
  Watch(server, WatchRequest(job.name(), 0));
  using ::testing::ElementsAre;
  EXPECT_THAT(seen, ElementsAre(ElementsAre(7, 0, 7), ElementsAre(), ElementsAre(3), ElementsAre(8)));

  request.mutable_spec()->mutable_elements()->set_seam_corners(bytes({-1}));
  const Received refused = Unwrap(server, request);
  EXPECT_EQ(refused.status.error_code(), grpc::StatusCode::INVALID_ARGUMENT);
  EXPECT_EQ(InfoOf(refused.status).reason(), "OPTIONS_INVALID");
  EXPECT_EQ(InfoOf(refused.status).metadata().at("field"), "spec.elements.seam_corners");
}

TEST(UnwrapRpc, EventsInOrderThenUvInChunks) {
  std::string uv((3 << 20) + 5, '\0');
  for (std::size_t i = 0; i < uv.size(); ++i) uv[i] = static_cast<char>(i * 7 + i / 1000);
  RpcTestServer server(Succeed(20, uv));
  const Received received = Unwrap(server, UnwrapOfMesh());
  EXPECT_TRUE(received.status.ok()) << received.status.error_message();
  ASSERT_EQ(received.events.size(), 23u);
  for (std::size_t i = 0; i < received.events.size(); ++i) {
    EXPECT_EQ(received.events[i].sequence(), static_cast<std::int64_t>(i) + 1);
    EXPECT_EQ(received.events[i].skipped(), 0);
  }
  EXPECT_EQ(received.events[0].job().state(), v1::JOB_STATE_QUEUED);
  EXPECT_EQ(received.LastJob().state(), v1::JOB_STATE_SUCCEEDED);
  ASSERT_EQ(received.chunks.size(), 25u);
  EXPECT_EQ(received.chunks[1].offset(), 128 << 10);
  EXPECT_EQ(received.chunks[24].data().size(), 5u);
  EXPECT_TRUE(received.uv == uv);
}

TEST(UnwrapRpc, FailedJobEndsTheStreamWithOk) {
  RpcTestServer server([](ServerLink& link, const ServerLink::Received&) {
    link.Send(
        FailureMessage(MakeError(absl::StatusCode::kInvalidArgument, "MESH_CLOSED", "no boundary", {{"loops", "0"}})));
    return true;
  });
  const Received received = Unwrap(server, UnwrapOfMesh());
  EXPECT_TRUE(received.status.ok());
  EXPECT_EQ(received.LastJob().state(), v1::JOB_STATE_FAILED);
  google::rpc::ErrorInfo info;
  ASSERT_TRUE(received.LastJob().error().details(0).UnpackTo(&info));
  EXPECT_EQ(info.reason(), "MESH_CLOSED");
  EXPECT_TRUE(received.chunks.empty());
}

TEST(UnwrapRpc, RefusalsCarryDetails) {
  RpcTestServer server(Succeed(1, "uv"));
  const Received received = Unwrap(server, v1::UnwrapRequest());
  EXPECT_EQ(received.status.error_code(), grpc::StatusCode::INVALID_ARGUMENT);
  EXPECT_EQ(InfoOf(received.status).reason(), "MESH_MISSING");
}

TEST(UnwrapRpc, CallerGoesAwayAndTheJobIsCancelled) {
  JobManagerOptions options;
  options.limits.reattach_grace = absl::Milliseconds(100);
  RpcTestServer server(WaitForCancel(), options);
  UnwrapCaller caller(server, UnwrapOfMesh(), 3);
  caller.GoAway();
  EXPECT_EQ(EndState(server, caller.name()), v1::JOB_STATE_CANCELLED);
  EXPECT_EQ(caller.Rest().status.error_code(), grpc::StatusCode::CANCELLED);
}

TEST(UnwrapRpc, DeadlinePassesAndTheJobIsCancelled) {
  RpcTestServer server(WaitForCancel());
  UnwrapCaller caller(server, UnwrapOfMesh(), 3, std::chrono::milliseconds(200));
  EXPECT_EQ(EndState(server, caller.name()), v1::JOB_STATE_CANCELLED);
  EXPECT_EQ(caller.Rest().status.error_code(), grpc::StatusCode::DEADLINE_EXCEEDED);
}

TEST(UnwrapRpc, DetachedJobRunsOn) {
  Gate gate;
  RpcTestServer server([&gate](ServerLink& link, const ServerLink::Received&) {
    link.Send(ProgressMessage(1));
    gate.Wait();
    SendSuccess(link, "uv");
    return true;
  });
  v1::UnwrapRequest request = UnwrapOfMesh();
  request.set_detached(true);
  UnwrapCaller caller(server, request, 3);
  caller.GoAway();
  EXPECT_EQ(caller.Rest().status.error_code(), grpc::StatusCode::CANCELLED);
  gate.Open();
  EXPECT_EQ(EndState(server, caller.name()), v1::JOB_STATE_SUCCEEDED);
  EXPECT_EQ(Watch(server, WatchRequest(caller.name(), 0, true)).uv, "uv");
}

TEST(UnwrapRpc, RetryAttachesToTheSameJob) {
  Gate gate;
  RpcTestServer server([&gate](ServerLink& link, const ServerLink::Received&) {
    link.Send(ProgressMessage(1));
    gate.Wait();
    SendSuccess(link, "uv");
    return true;
  });
  v1::UnwrapRequest request = UnwrapOfMesh();
  request.set_request_id("r1");
  UnwrapCaller lost(server, request, 3);
  UnwrapCaller retry(server, request, 3);
  EXPECT_EQ(retry.name(), lost.name());
  lost.GoAway();
  EXPECT_EQ(lost.Rest().status.error_code(), grpc::StatusCode::CANCELLED);
  gate.Open();
  const Received received = retry.Rest();
  EXPECT_EQ(received.LastJob().state(), v1::JOB_STATE_SUCCEEDED);
  EXPECT_EQ(received.uv, "uv");
}

TEST(UnwrapRpc, TenCallersOnTwoWorkers) {
  JobManagerOptions options;
  options.workers = 2;
  RpcTestServer server(Succeed(30, "uv"), options);
  std::vector<std::thread> callers;
  for (int i = 0; i < 10; ++i) {
    callers.emplace_back([&server] {
      v1::UnwrapRequest request = UnwrapOfMesh();
      request.mutable_spec()->mutable_scheduling()->set_fresh(true);
      const Received received = Unwrap(server, request);
      EXPECT_TRUE(received.status.ok());
      EXPECT_EQ(received.events.size(), 33u);
      for (std::size_t e = 0; e < received.events.size(); ++e) {
        EXPECT_EQ(received.events[e].sequence(), static_cast<std::int64_t>(e) + 1);
      }
      EXPECT_EQ(received.uv, "uv");
    });
  }
  for (std::thread& caller : callers) caller.join();
}

TEST(WatchRpc, AttachedWatchersKeepTheJobAlive) {
  JobManagerOptions options;
  options.limits.reattach_grace = absl::ZeroDuration();
  RpcTestServer server(WaitForCancel(), options);
  UnwrapCaller caller(server, UnwrapOfMesh(), 3);
  v1::WatchJobRequest attach = WatchRequest(caller.name(), 0);
  attach.set_attach(true);
  grpc::ClientContext context;
  const auto second = server.stub().WatchJob(&context, attach);
  v1::WatchJobResponse first_event;
  ASSERT_TRUE(second->Read(&first_event)) << "from here on the job is this call's too";
  caller.GoAway();
  EXPECT_EQ(caller.Rest().status.error_code(), grpc::StatusCode::CANCELLED);
  EXPECT_EQ(server.manager().Get(kEverybody, caller.name())->state(), v1::JOB_STATE_RUNNING);
  context.TryCancel();
  EXPECT_EQ(second->Finish().error_code(), grpc::StatusCode::CANCELLED);
  EXPECT_EQ(EndState(server, caller.name()), v1::JOB_STATE_CANCELLED) << "the last caller went";
}

TEST(WatchRpc, ResumesAfterASequence) {
  RpcTestServer server(Succeed(5, "0123456789"));
  const std::string name = server.Create();
  EXPECT_EQ(EndState(server, name), v1::JOB_STATE_SUCCEEDED);
  const Received all = Watch(server, WatchRequest(name, 0));
  ASSERT_EQ(all.events.size(), 8u);
  EXPECT_TRUE(all.chunks.empty()) << "not asked for";
  const Received rest = Watch(server, WatchRequest(name, 6, true, 4));
  ASSERT_EQ(rest.events.size(), 2u);
  EXPECT_EQ(rest.events[0].sequence(), 7);
  EXPECT_EQ(rest.events[0].skipped(), 0);
  ASSERT_EQ(rest.chunks.size(), 1u);
  EXPECT_EQ(rest.chunks[0].offset(), 4);
  EXPECT_EQ(rest.uv, "456789");
}

TEST(WatchRpc, OffsetsAtAndBeyondTheEnd) {
  RpcTestServer server(Succeed(1, "0123456789"));
  const std::string name = server.Create();
  EXPECT_TRUE(Watch(server, WatchRequest(name, 0, true, 10)).status.ok());
  const Received beyond = Watch(server, WatchRequest(name, 0, true, 11));
  EXPECT_EQ(beyond.status.error_code(), grpc::StatusCode::OUT_OF_RANGE);
  EXPECT_EQ(InfoOf(beyond.status).metadata().at("total_bytes"), "10");
  EXPECT_EQ(Watch(server, WatchRequest(name, -1)).status.error_code(), grpc::StatusCode::INVALID_ARGUMENT);
  EXPECT_EQ(Watch(server, WatchRequest(name, 0, true, -1)).status.error_code(), grpc::StatusCode::INVALID_ARGUMENT);
  EXPECT_EQ(Watch(server, WatchRequest("jobs/none", 0)).status.error_code(), grpc::StatusCode::NOT_FOUND);
}

TEST(WatchRpc, WatchersComeAndGoWithoutEffect) {
  RpcTestServer server(WaitForCancel());
  const std::string name = server.Create();
  {
    grpc::ClientContext context;
    const auto reader = server.stub().WatchJob(&context, WatchRequest(name, 0));
    v1::WatchJobResponse response;
    for (int i = 0; i < 3; ++i) ASSERT_TRUE(reader->Read(&response));
    context.TryCancel();
    EXPECT_EQ(reader->Finish().error_code(), grpc::StatusCode::CANCELLED);
  }
  EXPECT_EQ(server.manager().Get(kEverybody, name)->state(), v1::JOB_STATE_RUNNING);
  std::thread watcher([&] {
    const Received received = Watch(server, WatchRequest(name, 3));
    EXPECT_EQ(received.LastJob().state(), v1::JOB_STATE_CANCELLED);
  });
  EXPECT_TRUE(server.manager().Cancel(kEverybody, name).ok());
  watcher.join();
}

TEST(WatchRpc, SlowReaderSkipsProgressAndHoldsUpNobody) {
  constexpr int kIterations = 50'000;  // far more than HTTP/2 windows and socket buffers hold
  JobManagerOptions options;
  options.events_per_job = 16;
  RpcTestServer server(Succeed(kIterations, "uv"), options);
  UnwrapCaller slow(server, UnwrapOfMesh(), 1);
  EXPECT_EQ(EndState(server, slow.name()), v1::JOB_STATE_SUCCEEDED) << "although nobody reads";

  const Received received = slow.Rest();
  std::int64_t last = 1;
  std::int64_t skipped = 0;
  for (const v1::JobEvent& event : received.events) {
    EXPECT_EQ(event.sequence(), last + event.skipped() + 1);
    last = event.sequence();
    skipped += event.skipped();
  }
  EXPECT_EQ(last, kIterations + 3);
  EXPECT_GT(skipped, 0);
  EXPECT_EQ(received.LastJob().state(), v1::JOB_STATE_SUCCEEDED);
  EXPECT_EQ(received.uv, "uv");
}

TEST(WatchRpc, CrowdsGetTheNewestProgressNowAndThen) {
  Gate gate;
  // One stream counts as a crowd here: progress every 0.1 s.
  RpcTestServer server(
      [&gate](ServerLink& link, const ServerLink::Received&) {
        for (int i = 1; i <= 100; ++i) link.Send(ProgressMessage(i));
        gate.Wait();
        for (int i = 101; i <= 200; ++i) link.Send(ProgressMessage(i));
        SendSuccess(link, "uv");
        return true;
      },
      JobManagerOptions(), UploadStoreOptions(), 10);
  grpc::ClientContext context;
  const auto reader = server.stub().Unwrap(&context, UnwrapOfMesh());
  v1::UnwrapResponse response;
  int events = 0;
  while (reader->Read(&response) && response.event().progress().newton_iteration() < 100) ++events;
  EXPECT_EQ(response.event().progress().newton_iteration(), 100) << "the newest comes, though nothing wakes the stream";
  EXPECT_LE(events, 6) << "the job twice, and some of the first progress";
  const auto start = std::chrono::steady_clock::now();
  gate.Open();
  const Received rest = ReceiveAll(reader.get());
  EXPECT_EQ(rest.LastJob().state(), v1::JOB_STATE_SUCCEEDED);
  EXPECT_EQ(rest.LastJob().name(), rest.events.back().job().name());
  EXPECT_EQ(rest.events.back().sequence(), 203);
  EXPECT_LT(std::chrono::steady_clock::now() - start, std::chrono::seconds(5)) << "the end is never held back";
  EXPECT_EQ(rest.uv, "uv");
}

TEST(WatchRpc, StreamsEndWhenTheServerShutsDown) {
  Received received;
  std::thread watcher;
  {
    RpcTestServer server(WaitForCancel());
    UnwrapCaller caller(server, UnwrapOfMesh(), 3);
    watcher =
        std::thread([&server, &received, name = caller.name()] { received = Watch(server, WatchRequest(name, 0)); });
    server.manager().Drain([] {});
    server.manager().CancelAll();
    EXPECT_EQ(caller.Rest().LastJob().state(), v1::JOB_STATE_CANCELLED);
    watcher.join();
  }
  EXPECT_TRUE(received.status.ok());
  EXPECT_EQ(received.LastJob().state(), v1::JOB_STATE_CANCELLED);
}

// A caller may then go on elsewhere. CANCELLED would say that the caller itself gave up.
TEST(WatchRpc, CallsThatAreCutOffByAShutdownAreUnavailable) {
  RpcTestServer server(WaitForCancel());
  UnwrapCaller caller(server, UnwrapOfMesh(), 3);
  grpc::ClientContext context;
  const auto watcher = server.stub().WatchJob(&context, WatchRequest(caller.name(), 0));
  v1::WatchJobResponse first;
  ASSERT_TRUE(watcher->Read(&first));
  server.rpc().Shutdown(absl::Now() + absl::Milliseconds(20));
  const grpc::Status watched = ReceiveAll(watcher.get()).status;
  EXPECT_EQ(watched.error_code(), grpc::StatusCode::UNAVAILABLE) << watched.error_message();
  const grpc::Status unwrapped = caller.Rest().status;
  EXPECT_EQ(unwrapped.error_code(), grpc::StatusCode::UNAVAILABLE) << unwrapped.error_message();
}

}  // namespace
}  // namespace planish
