// The library against a server that does what the test says.
#include "planish/client.h"

#include <atomic>
#include <chrono>
#include <future>
#include <thread>

#include "gmock/gmock.h"
#include "gtest/gtest.h"
#include "tests/client/fake_server.h"
#include "tests/testing/process.h"

namespace planish {
namespace {

using testing::Bytes;
using ::testing::ElementsAre;
using testing::ErrorOf;
using testing::FakeServer;
using testing::FakeStream;
using ::testing::HasSubstr;
using testing::kUv;
using testing::MakeStatus;
using testing::ProgressEvent;
using testing::StateEvent;
using testing::SuccessEvent;

constexpr int kUnavailable = 14;
using Status = google::rpc::Status;

// Two triangles; vertices 0 and 3 are isolated, so 1, 2, 4, 5 travel as 0, 1, 2, 3.
const std::vector<float> kWithIsolated = {9, 9, 9, 0, 0, 0, 1, 0, 0, 8, 8, 8, 1, 1, 0, 0, 1, 0};
const std::vector<std::uint32_t> kTrianglesOfIt = {1, 2, 4, 1, 4, 5};

ClientOptions Impatient() {
  ClientOptions options;
  options.reattach_timeout = std::chrono::seconds(1);
  options.backoff = std::chrono::milliseconds(10);
  return options;
}

class ClientTest : public ::testing::Test {
 protected:
  Client NewClient() { return Client(server_.target(), Impatient()); }

  FakeServer server_;
};

TEST_F(ClientTest, UnwrapBringsUvAndReport) {
  v1::UnwrapRequest seen;
  server_.on_unwrap = [&](const v1::UnwrapRequest& request, FakeStream& stream) {
    seen = request;
    stream.Send(StateEvent(1, v1::JOB_STATE_QUEUED));
    stream.Send(ProgressEvent(2, 1, 1e-3));
    stream.Send(SuccessEvent(3, request.spec().draco(), Bytes(kUv)));
    stream.SendUv(0, Bytes(kUv).substr(0, 10));
    stream.SendUv(10, Bytes(kUv).substr(10));
    return Status();
  };
  UnwrapOptions options;
  options.solver.method = Solver::kMinres;
  options.solver.tolerance = 1e-7;
  CallOptions call;
  call.labels = {{"file", "square"}};
  std::vector<std::int64_t> sequences;
  Callbacks callbacks;
  callbacks.on_event = [&](const Event& event) { sequences.push_back(event.sequence); };

  const UnwrapResult result = NewClient().Unwrap({kWithIsolated, kTrianglesOfIt}, options, callbacks, call);

  EXPECT_EQ(result.job, "jobs/1");
  EXPECT_EQ(result.uv.precision(), Precision::kFloat);
  EXPECT_EQ(std::get<std::vector<float>>(result.uv.numbers()), kUv);
  EXPECT_TRUE(result.IsUsable());
  EXPECT_EQ(result.report.charts.at(0).solver, Solver::kDirect);
  const StageTimes& times = result.report.times;
  EXPECT_EQ(times.solve, std::chrono::milliseconds(250));
  EXPECT_GT(times.upload, Seconds(0));
  EXPECT_GE(times.total, times.upload + times.download);
  EXPECT_THAT(sequences, ElementsAre(1, 2, 3));
  EXPECT_EQ(seen.spec().options().solver(), v1::SOLVER_MINRES);
  EXPECT_EQ(seen.spec().options().tolerance(), 1e-7);
  EXPECT_EQ(seen.spec().labels().at("file"), "square");
  EXPECT_EQ(seen.request_id().size(), 36u);
  EXPECT_FALSE(seen.detached());
}

TEST_F(ClientTest, SeamsAndAtlasTravel) {
  v1::UnwrapRequest seen;
  server_.on_unwrap = [&](const v1::UnwrapRequest& request, FakeStream& stream) {
    seen = request;
    v1::JobEvent success = SuccessEvent(1, request.spec().draco(), Bytes(kUv));
    v1::Report& report = *success.mutable_job()->mutable_report();
    report.mutable_charts(0)->set_stretch_l2(1.25);
    report.mutable_charts(0)->set_chart(3);
    report.mutable_chart_totals()->set_charts(40);
    report.mutable_chart_totals()->set_not_converged(2);
    report.mutable_chart_totals()->mutable_residual()->set_wheel(0.5);
    report.mutable_atlas()->set_pack(v1::PACK_ON);
    report.mutable_atlas()->set_tiles(3);
    report.mutable_atlas()->set_texels_per_unit(12.5);
    report.mutable_atlas()->set_effort(v1::EFFORT_BEST);
    report.mutable_atlas()->set_layout(v1::ATLAS_LAYOUT_STACKED);
    v1::AtlasPart& part = *report.mutable_atlas()->add_atlases();
    part.set_atlas(7);
    part.set_triangles(1);
    part.set_charts(2);
    part.set_first_tile(3);
    part.set_tiles(4);
    part.set_texels_per_unit(5);
    part.set_packing_efficiency(0.5);
    *success.mutable_job()->mutable_options() = request.spec().options();
    stream.Send(success);
    stream.SendUv(0, Bytes(kUv));
    return Status();
  };
  UnwrapOptions options;
  options.seams = Seams::kKeep;
  options.hard_edge_degrees = 30;
  options.max_stretch = 2;
  options.texture_size = 512;
  options.padding = 0;
  options.tiles = 4;
  options.effort = Effort::kFast;
  options.atlas_layout = AtlasLayout::kStacked;
  options.pack = false;
  Job echo;
  Callbacks callbacks;
  callbacks.on_event = [&](const Event& event) { echo = *event.job; };
  const std::vector<std::uint32_t> edges = {4, 1, 5, 4};  // the diagonal, in the caller's ids, and an outer edge
  const std::vector<std::int32_t> corners = {0};          // faces the edge 2-4
  const std::vector<std::int32_t> uncut = {5, 1};
  const std::vector<std::int32_t> atlas = {0, 7};
  const std::vector<float> weights = {1, 0.5F};
  const UnwrapResult result = NewClient().Unwrap(MeshView(kWithIsolated, kTrianglesOfIt)
                                                     .WithSeams(edges)
                                                     .WithSeamCorners(corners)
                                                     .WithUncutCorners(uncut)
                                                     .WithFaceAtlas(atlas)
                                                     .WithFaceWeights(weights),
                                                 options, callbacks);

  EXPECT_THAT(seen.spec().seam_corners(), ElementsAre(1, 3, 0));
  EXPECT_THAT(seen.spec().uncut_corners(), ElementsAre(5, 1));
  EXPECT_THAT(seen.spec().face_atlas(), ElementsAre(0, 7));
  EXPECT_THAT(seen.spec().face_weights(), ElementsAre(1, 0.5F));
  EXPECT_EQ(seen.spec().options().atlas_layout(), v1::ATLAS_LAYOUT_STACKED);
  EXPECT_EQ(seen.spec().options().seams(), v1::SEAMS_KEEP);
  EXPECT_EQ(seen.spec().options().hard_edge_degrees(), 30);
  EXPECT_EQ(seen.spec().options().max_stretch(), 2);
  EXPECT_EQ(seen.spec().options().texture_size(), 512);
  EXPECT_TRUE(seen.spec().options().has_padding());
  EXPECT_EQ(seen.spec().options().padding(), 0);
  EXPECT_EQ(seen.spec().options().tiles(), 4);
  EXPECT_EQ(seen.spec().options().effort(), v1::EFFORT_FAST);
  EXPECT_EQ(seen.spec().options().pack(), v1::PACK_OFF);
  EXPECT_EQ(echo.options.seams, Seams::kKeep);
  EXPECT_EQ(echo.options.padding, 0);
  EXPECT_EQ(echo.options.effort, Effort::kFast);
  EXPECT_FALSE(echo.options.pack);
  EXPECT_EQ(result.report.charts.at(0).stretch_l2, 1.25);
  EXPECT_EQ(result.report.charts.at(0).chart, 3);
  EXPECT_EQ(result.report.chart_totals.charts, 40);
  EXPECT_EQ(result.report.chart_totals.residual.Worst(), 0.5);
  EXPECT_EQ(result.report.atlas.tiles, 3);
  EXPECT_EQ(result.report.atlas.texels_per_unit, 12.5);
  EXPECT_EQ(result.report.atlas.effort, Effort::kBest);
  EXPECT_EQ(result.report.atlas.layout, AtlasLayout::kStacked);
  ASSERT_EQ(result.report.atlas.atlases.size(), 1u);
  const AtlasPart& part = result.report.atlas.atlases[0];
  EXPECT_EQ(part.atlas, 7);
  EXPECT_EQ(part.triangles, 1);
  EXPECT_EQ(part.charts, 2);
  EXPECT_EQ(part.first_tile, 3);
  EXPECT_EQ(part.tiles, 4);
  EXPECT_EQ(part.texels_per_unit, 5);
  EXPECT_EQ(part.packing_efficiency, 0.5);
  EXPECT_FALSE(result.IsUsable()) << "two charts did not converge, be they described or not";
}

TEST_F(ClientTest, DefaultsAreTheServers) {
  v1::CreateJobRequest seen;
  server_.on_create = [&](const v1::CreateJobRequest& request, v1::Job&) {
    seen = request;
    return Status();
  };
  const std::vector<std::int32_t> edge = {1, 4};
  const Job job = NewClient().CreateJob(MeshView(kWithIsolated, kTrianglesOfIt).WithSeams(edge));
  EXPECT_EQ(seen.spec().options().seams(), v1::SEAMS_AUTO);
  EXPECT_FALSE(seen.spec().options().has_padding());
  EXPECT_EQ(seen.spec().options().pack(), v1::PACK_ON);
  EXPECT_THAT(seen.spec().seam_corners(), ElementsAre(1));
  EXPECT_EQ(job.options.seams, Seams::kAuto) << "what a server leaves open is auto";
}

TEST_F(ClientTest, SeamsThatAreNoneAreRefusedBeforeTheyTravel) {
  const MeshView mesh(kWithIsolated, kTrianglesOfIt);
  const std::vector<std::uint32_t> diagonal = {1, 4, 2, 5};
  Error error = ErrorOf([&] { NewClient().Unwrap(mesh.WithSeams(diagonal)); });
  EXPECT_EQ(error.reason(), "OPTIONS_INVALID");
  EXPECT_EQ(error.metadata().at("edges"), "2-5") << "in the caller's ids";
  EXPECT_EQ(ErrorOf([&] {
              NewClient().Unwrap(mesh.WithSeams(std::vector<std::int32_t>{1, 2, 4}));
            }).reason(),
            "OPTIONS_INVALID");
  for (const std::int32_t corner : {-1, 6}) {
    error = ErrorOf([&] { NewClient().Unwrap(mesh.WithSeamCorners(std::vector<std::int32_t>{0, corner})); });
    EXPECT_EQ(error.reason(), "OPTIONS_INVALID");
    EXPECT_EQ(error.metadata().at("corner"), std::to_string(corner));
    error = ErrorOf([&] { NewClient().Unwrap(mesh.WithUncutCorners(std::vector<std::int32_t>{corner})); });
    EXPECT_EQ(error.metadata().at("field"), "uncut_corners");
  }
  error = ErrorOf([&] { NewClient().Unwrap(mesh.WithFaceAtlas(std::vector<std::int32_t>{0})); });
  EXPECT_EQ(error.metadata().at("field"), "face_atlas") << "of two triangles";
  error = ErrorOf([&] { NewClient().Unwrap(mesh.WithFaceWeights(std::vector<float>{1, 1, 1})); });
  EXPECT_EQ(error.metadata().at("field"), "face_weights");
}

TEST_F(ClientTest, DoubleUvAndDoublePositions) {
  const std::vector<double> uv = {0, 0, 1.0 / 3, 0, 1, 0.1};
  server_.on_unwrap = [&](const v1::UnwrapRequest& request, FakeStream& stream) {
    stream.Send(SuccessEvent(1, request.spec().draco(), Bytes(uv), v1::PRECISION_DOUBLE));
    stream.SendUv(0, Bytes(uv));
    return Status();
  };
  const std::vector<double> positions = {0, 0, 0, 1, 0, 0, 0, 1, 0};
  const std::vector<std::int32_t> triangles = {0, 1, 2};
  const UnwrapResult result = NewClient().Unwrap({positions, triangles});
  EXPECT_EQ(result.uv.precision(), Precision::kDouble);
  EXPECT_EQ(std::get<std::vector<double>>(result.uv.numbers()), uv);
  EXPECT_EQ(result.uv.As<float>(), std::vector<float>(uv.begin(), uv.end()));
  ASSERT_EQ(result.uv.size(), uv.size());
  EXPECT_EQ(result.uv[2], 1.0 / 3) << "one view, whatever the type";
}

TEST_F(ClientTest, FailedJobThrowsInTheCallersIds) {
  server_.on_unwrap = [&](const v1::UnwrapRequest&, FakeStream& stream) {
    v1::JobEvent failed = StateEvent(1, v1::JOB_STATE_FAILED);
    *failed.mutable_job()->mutable_error() =
        MakeStatus(3, "more than two faces meet at 2 edges", "MESH_EDGE_NON_MANIFOLD",
                   {{"edges", "0-3,1-2"}, {"vertices", "2"}, {"faces", "1"}, {"count", "2"}});
    stream.Send(failed);
    return Status();
  };
  const Error error = ErrorOf([&] { NewClient().Unwrap({kWithIsolated, kTrianglesOfIt}); });
  EXPECT_EQ(error.code(), ErrorCode::kInvalidArgument);
  EXPECT_EQ(error.reason(), "MESH_EDGE_NON_MANIFOLD");
  EXPECT_STREQ(error.what(), "more than two faces meet at 2 edges");
  EXPECT_EQ(error.metadata().at("edges"), "1-5,2-4");
  EXPECT_EQ(error.metadata().at("vertices"), "4");
  EXPECT_EQ(error.metadata().at("faces"), "1");
  EXPECT_EQ(error.metadata().at("count"), "2");
  EXPECT_EQ(error.job(), "jobs/1");
}

TEST_F(ClientTest, BadMeshesAreRefusedBeforeTheyTravel) {
  const std::vector<std::uint32_t> beyond = {1, 2, 6};
  Error error = ErrorOf([&] { NewClient().Unwrap({kWithIsolated, beyond}); });
  EXPECT_EQ(error.reason(), "MESH_INDEX_OUT_OF_RANGE");
  EXPECT_EQ(error.metadata().at("faces"), "0");
  const std::vector<std::int32_t> negative = {1, 2, -1};
  EXPECT_EQ(ErrorOf([&] { NewClient().Unwrap({kWithIsolated, negative}); }).reason(), "MESH_INDEX_OUT_OF_RANGE");
  EXPECT_EQ(ErrorOf([&] { NewClient().Unwrap({kWithIsolated, std::vector<std::uint32_t>()}); }).reason(), "MESH_EMPTY");
}

TEST_F(ClientTest, RefusedCallThrowsItsErrorInfo) {
  server_.on_unwrap = [&](const v1::UnwrapRequest&, FakeStream&) {
    return MakeStatus(8, "the mesh is too large", "MESH_TOO_LARGE", {{"max_mesh_bytes", "10"}});
  };
  const Error error = ErrorOf([&] { NewClient().Unwrap({kWithIsolated, kTrianglesOfIt}); });
  EXPECT_EQ(error.code(), ErrorCode::kResourceExhausted);
  EXPECT_EQ(error.reason(), "MESH_TOO_LARGE");
  EXPECT_EQ(error.metadata().at("max_mesh_bytes"), "10");
  EXPECT_EQ(error.job(), "");
}

TEST_F(ClientTest, WaitsForRoomInTheQueue) {
  std::vector<std::string> request_ids;
  server_.on_unwrap = [&](const v1::UnwrapRequest& request, FakeStream& stream) {
    request_ids.push_back(request.request_id());
    if (request_ids.size() < 3) return MakeStatus(8, "the queue is full", "QUEUE_FULL", {}, 0.02);
    stream.Send(SuccessEvent(1, request.spec().draco(), Bytes(kUv)));
    stream.SendUv(0, Bytes(kUv));
    return Status();
  };
  EXPECT_EQ(NewClient().Unwrap({kWithIsolated, kTrianglesOfIt}).uv.As<float>(), kUv);
  EXPECT_THAT(request_ids, ElementsAre(request_ids[0], request_ids[0], request_ids[0]));

  request_ids.clear();
  ClientOptions options = Impatient();
  options.queue_full_timeout = Seconds(0);
  const Error error = ErrorOf([&] { Client(server_.target(), options).Unwrap({kWithIsolated, kTrianglesOfIt}); });
  EXPECT_EQ(error.reason(), "QUEUE_FULL");
  EXPECT_NEAR(error.retry_after().count(), 0.02, 1e-6);
}

TEST_F(ClientTest, ReattachesWhereTheStreamBroke) {
  std::string draco;
  std::vector<v1::WatchJobRequest> watches;
  server_.on_unwrap = [&](const v1::UnwrapRequest& request, FakeStream& stream) {
    draco = request.spec().draco();
    stream.Send(StateEvent(1, v1::JOB_STATE_QUEUED));
    stream.Send(StateEvent(2, v1::JOB_STATE_RUNNING));
    return MakeStatus(kUnavailable, "Socket closed");
  };
  server_.on_watch = [&](const v1::WatchJobRequest& request, FakeStream& stream) {
    watches.push_back(request);
    switch (watches.size()) {
      case 1:
        stream.Send(StateEvent(2, v1::JOB_STATE_RUNNING));  // an overlap, which must not be told twice
        stream.Send(ProgressEvent(3, 1, 1e-3));
        stream.Send(SuccessEvent(4, draco, Bytes(kUv)));
        stream.SendUv(0, Bytes(kUv).substr(0, 20));
        return MakeStatus(13, "RST_STREAM");
      case 2:
        return MakeStatus(kUnavailable, "not yet");
      default:
        stream.SendUv(request.uv_offset() - 4, Bytes(kUv).substr(16));
        return Status();
    }
  };
  std::vector<std::int64_t> sequences;
  int reconnects = 0;
  Callbacks callbacks;
  callbacks.on_event = [&](const Event& event) { sequences.push_back(event.sequence); };
  callbacks.on_reconnect = [&](const Error&, Seconds) { ++reconnects; };
  const UnwrapResult result = NewClient().Unwrap({kWithIsolated, kTrianglesOfIt}, {}, callbacks);
  EXPECT_EQ(result.uv.As<float>(), kUv);
  EXPECT_THAT(sequences, ElementsAre(1, 2, 3, 4));
  EXPECT_EQ(reconnects, 3);
  ASSERT_EQ(watches.size(), 3u);
  EXPECT_EQ(watches[0].name(), "jobs/1");
  EXPECT_EQ(watches[0].after_sequence(), 2);
  EXPECT_EQ(watches[0].uv_offset(), 0);
  EXPECT_TRUE(watches[0].include_uv());
  EXPECT_TRUE(watches[0].attach()) << "the job is this call's";
  EXPECT_EQ(watches[1].after_sequence(), 4);
  EXPECT_EQ(watches[1].uv_offset(), 20);
}

TEST_F(ClientTest, GivesUpReattachingAfterSomeTime) {
  std::atomic<int> watches = 0;
  server_.on_unwrap = [&](const v1::UnwrapRequest&, FakeStream& stream) {
    stream.Send(StateEvent(1, v1::JOB_STATE_QUEUED));
    return MakeStatus(kUnavailable, "Socket closed");
  };
  server_.on_watch = [&](const v1::WatchJobRequest&, FakeStream&) {
    ++watches;
    return MakeStatus(kUnavailable, "Socket closed");
  };
  // With sanitizers on a busy machine a call takes a third of a second.
  ClientOptions options = Impatient();
  options.reattach_timeout = std::chrono::seconds(3);
  const Error error = ErrorOf([&] { Client(server_.target(), options).Unwrap({kWithIsolated, kTrianglesOfIt}); });
  EXPECT_EQ(error.reason(), "CONNECTION_LOST");
  EXPECT_EQ(error.job(), "jobs/1");
  EXPECT_GE(watches, 5) << "it doubles its pauses from 0.01 s on";
  EXPECT_LE(watches, 15);
}

TEST_F(ClientTest, SubmitsAnewWhenTheJobWentWithTheStream) {
  std::vector<std::string> request_ids;
  server_.on_unwrap = [&](const v1::UnwrapRequest& request, FakeStream& stream) {
    request_ids.push_back(request.request_id());
    stream.Send(StateEvent(1, v1::JOB_STATE_QUEUED));
    if (request_ids.size() < 3) return MakeStatus(kUnavailable, "Socket closed");
    stream.Send(SuccessEvent(2, request.spec().draco(), Bytes(kUv)));
    stream.SendUv(0, Bytes(kUv));
    return Status();
  };
  int watches = 0;
  server_.on_watch = [&](const v1::WatchJobRequest&, FakeStream& stream) {
    if (++watches == 1) return MakeStatus(5, "no such job", "JOB_NOT_FOUND");  // the server was started anew
    stream.Send(StateEvent(2, v1::JOB_STATE_CANCELLED));                       // the server noticed our absence
    return Status();
  };
  EXPECT_EQ(NewClient().Unwrap({kWithIsolated, kTrianglesOfIt}).uv.As<float>(), kUv);
  ASSERT_EQ(request_ids.size(), 3u);
  EXPECT_NE(request_ids[0], request_ids[1]);
  EXPECT_NE(request_ids[1], request_ids[2]);
}

TEST_F(ClientTest, UvOfAnotherMeshOrWithDamageAreRefused) {
  std::string damage;
  server_.on_unwrap = [&](const v1::UnwrapRequest& request, FakeStream& stream) {
    const bool other_mesh = damage == "mesh";
    v1::JobEvent success = SuccessEvent(1, other_mesh ? "another" : request.spec().draco(), Bytes(kUv));
    std::string bytes = Bytes(kUv);
    if (damage == "bytes") bytes[5] = static_cast<char>(bytes[5] ^ 1);
    if (damage == "corners") success.mutable_job()->mutable_uv()->set_corner_count(7);
    stream.Send(success);
    if (damage == "gap") {
      stream.SendUv(8, bytes.substr(8));
    } else {
      stream.SendUv(0, bytes);
    }
    return Status();
  };
  for (const auto& [what, reason] : std::map<std::string, std::string>{
           {"mesh", "MESH_MISMATCH"}, {"bytes", "UV_CORRUPT"}, {"corners", "UV_CORRUPT"}, {"gap", "UV_CORRUPT"}}) {
    damage = what;
    EXPECT_EQ(ErrorOf([&] { NewClient().Unwrap({kWithIsolated, kTrianglesOfIt}); }).reason(), reason) << what;
  }
}

// Runs until somebody cancels "jobs/1" or the call.
class ClientCancelTest : public ClientTest {
 protected:
  ClientCancelTest() {
    server_.on_unwrap = [this](const v1::UnwrapRequest&, FakeStream& stream) {
      stream.Send(StateEvent(1, v1::JOB_STATE_RUNNING));
      started_.set_value();
      while (!cancelled_ && !stream.IsCancelled()) std::this_thread::sleep_for(std::chrono::milliseconds(1));
      cancelled_ = true;  // by CancelJob, or with the call before it knew the job
      stream.Send(StateEvent(2, v1::JOB_STATE_CANCELLED));
      return Status();
    };
    server_.on_job = [this](const std::string& method, const std::string& job, v1::Job&) {
      if (method == "Cancel" && job == "jobs/1") cancelled_ = true;
      return Status();
    };
  }
  ~ClientCancelTest() override { server_.Stop(); }

  // A call that is cancelled may end before the server has noticed.
  bool ServerNoticesCancel() const {
    return WaitUntil([this] { return cancelled_.load(); });
  }

  std::promise<void> started_;
  std::atomic<bool> cancelled_ = false;
};

TEST_F(ClientCancelTest, CancelFromAnotherThreadCancelsOnTheServer) {
  Client client = NewClient();
  std::atomic<int> done = 0, failed = 0;
  std::atomic<bool> on_library_thread = false;
  const std::thread::id here = std::this_thread::get_id();
  Callbacks callbacks;
  callbacks.on_done = [&](const UnwrapResult&) { ++done; };
  callbacks.on_error = [&](const Error& error) {
    if (error.code() == ErrorCode::kCancelled) ++failed;
    on_library_thread = std::this_thread::get_id() != here;
  };
  Call call = client.StartUnwrap({kWithIsolated, kTrianglesOfIt}, {}, callbacks);
  started_.get_future().wait();
  EXPECT_FALSE(call.WaitFor(std::chrono::milliseconds(10)));
  std::thread([&] { call.Cancel(); }).join();
  EXPECT_TRUE(call.WaitFor(std::chrono::seconds(10)));
  const Error error = ErrorOf([&] { call.Wait(); });
  EXPECT_EQ(error.code(), ErrorCode::kCancelled);
  EXPECT_EQ(call.job(), "jobs/1");
  EXPECT_TRUE(ServerNoticesCancel());
  EXPECT_EQ(done, 0);
  EXPECT_EQ(failed, 1);
  EXPECT_TRUE(on_library_thread);
}

TEST_F(ClientCancelTest, StopTokenCancelsABlockingCall) {
  std::stop_source stop;
  CallOptions call;
  call.stop = stop.get_token();
  std::thread stopper([&] {
    started_.get_future().wait();
    stop.request_stop();
  });
  const Error error = ErrorOf([&] { NewClient().Unwrap({kWithIsolated, kTrianglesOfIt}, {}, {}, call); });
  stopper.join();
  EXPECT_EQ(error.code(), ErrorCode::kCancelled);
  EXPECT_TRUE(ServerNoticesCancel());
}

TEST_F(ClientCancelTest, DestructorCancels) {
  {
    Client client = NewClient();
    const Call call = client.StartUnwrap({kWithIsolated, kTrianglesOfIt});
    started_.get_future().wait();
  }
  EXPECT_TRUE(ServerNoticesCancel());
}

TEST_F(ClientCancelTest, DeadlineEndsTheCall) {
  CallOptions call;
  call.timeout = Seconds(0.1);
  const Error error = ErrorOf([&] { NewClient().Unwrap({kWithIsolated, kTrianglesOfIt}, {}, {}, call); });
  EXPECT_EQ(error.code(), ErrorCode::kDeadlineExceeded);
  EXPECT_EQ(error.job(), "jobs/1");
}

TEST_F(ClientCancelTest, ExceptionOfACallbackComesOut) {
  Callbacks callbacks;
  callbacks.on_event = [](const Event&) { throw std::logic_error("mine"); };
  EXPECT_THROW(NewClient().Unwrap({kWithIsolated, kTrianglesOfIt}, {}, callbacks), std::logic_error);
  started_ = std::promise<void>();
  Client client = NewClient();
  Call call = client.StartUnwrap({kWithIsolated, kTrianglesOfIt}, {}, callbacks);
  EXPECT_THROW(call.Wait(), std::logic_error);
}

TEST_F(ClientCancelTest, NothrowBringsErrorsAndExceptionsInAResult) {
  Callbacks callbacks;
  callbacks.on_event = [](const Event&) { throw std::logic_error("mine"); };
  Client client = NewClient();
  Result<UnwrapResult> result = client.Unwrap(std::nothrow, {kWithIsolated, kTrianglesOfIt}, {}, callbacks);
  ASSERT_FALSE(result.ok());
  EXPECT_EQ(result.error().reason(), "CALLBACK_FAILED");
  EXPECT_EQ(result.error().trace_id().size(), 32u);
  EXPECT_THROW(std::move(result).value(), std::logic_error) << "whose it was";
  const Result<Client> none = Client::Make("host:1", [] {
    ClientOptions options;
    options.tls_key_file = "key.pem";
    return options;
  }());
  EXPECT_EQ(none.error().reason(), "OPTIONS_INVALID");
  EXPECT_EQ(Call().Wait(std::nothrow).error().reason(), "CALL_EMPTY");
}

TEST_F(ClientTest, AsynchronousCallBringsItsResult) {
  server_.on_unwrap = [&](const v1::UnwrapRequest& request, FakeStream& stream) {
    stream.Send(SuccessEvent(1, request.spec().draco(), Bytes(kUv)));
    stream.SendUv(0, Bytes(kUv));
    return Status();
  };
  std::promise<std::vector<float>> delivered;
  Callbacks callbacks;
  callbacks.on_done = [&](const UnwrapResult& result) { delivered.set_value(result.uv.As<float>()); };
  Client client = NewClient();
  Client moved = std::move(client);
  Call call = moved.StartUnwrap({kWithIsolated, kTrianglesOfIt}, {}, callbacks);
  EXPECT_EQ(call.Wait().uv.As<float>(), kUv);
  EXPECT_EQ(delivered.get_future().get(), kUv);
}

TEST_F(ClientTest, ListJobsFollowsPages) {
  server_.on_list = [&](const v1::ListJobsRequest& request, v1::ListJobsResponse& response) {
    const int first = request.page_token().empty() ? 0 : std::stoi(request.page_token());
    for (int i = first; i < std::min(first + 2, 5); ++i) response.add_jobs()->set_name("jobs/" + std::to_string(i));
    if (first + 2 < 5) response.set_next_page_token(std::to_string(first + 2));
    return Status();
  };
  Client client = NewClient();
  EXPECT_EQ(client.ListJobs(0).size(), 5u);
  EXPECT_EQ(client.ListJobs(4).size(), 4u);
  EXPECT_EQ(client.ListJobs(0).at(4).name, "jobs/4");
}

TEST_F(ClientTest, WatchedJobThatFailedIsNoException) {
  server_.on_watch = [&](const v1::WatchJobRequest& request, FakeStream& stream) {
    v1::JobEvent failed = StateEvent(request.after_sequence() + 1, v1::JOB_STATE_FAILED);
    *failed.mutable_job()->mutable_error() = MakeStatus(3, "closed", "MESH_CLOSED");
    stream.Send(failed);
    return Status();
  };
  const Job job = NewClient().WatchJob("jobs/1", {}, 7);
  EXPECT_EQ(job.state, JobState::kFailed);
  EXPECT_EQ(job.error->reason(), "MESH_CLOSED");
  EXPECT_EQ(job.error->code(), ErrorCode::kInvalidArgument);
}

TEST_F(ClientTest, UnaryErrorsCarryTheirReason) {
  server_.on_job = [](const std::string&, const std::string&, v1::Job&) {
    return MakeStatus(9, "still running", "JOB_NOT_FINISHED");
  };
  EXPECT_EQ(ErrorOf([&] { NewClient().DeleteJob("jobs/1"); }).reason(), "JOB_NOT_FINISHED");
}

TEST(ClientUnreachable, RefusedConnectionFailsAtOnce) {
  const auto start = std::chrono::steady_clock::now();
  for (const char* target : {"127.0.0.1:1", "unix:/nonexistent/socket"}) {
    try {
      Client(target).Unwrap({kWithIsolated, kTrianglesOfIt});
      ADD_FAILURE();
    } catch (const Error& error) {
      EXPECT_EQ(error.reason(), "SERVER_UNREACHABLE");
      EXPECT_THAT(error.what(), HasSubstr(target));
    }
  }
  EXPECT_LT(std::chrono::steady_clock::now() - start, std::chrono::seconds(5));
}

TEST(ClientUnreachable, SilentPeerFailsWithinTheConnectTimeout) {
  ClientOptions options;
  options.connect_timeout = Seconds(0.3);
  const auto start = std::chrono::steady_clock::now();
  // 192.0.2.0/24 is reserved for documentation: packets to it go nowhere, or are refused on the way.
  EXPECT_THROW(Client("192.0.2.1:50051", options).GetCapabilities(), Error);
  EXPECT_LT(std::chrono::steady_clock::now() - start, std::chrono::seconds(5));
}

}  // namespace
}  // namespace planish
