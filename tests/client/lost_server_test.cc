// The library against servers and networks that come and go.
#include <arpa/inet.h>
#include <netinet/in.h>
#include <sys/socket.h>

#include <atomic>
#include <chrono>
#include <future>
#include <thread>

#include "client/src/rpc.h"
#include "core/base/descriptor.h"
#include "core/base/sha256.h"
#include "gmock/gmock.h"
#include "gtest/gtest.h"
#include "planish/client.h"
#include "tests/client/fake_server.h"

namespace planish {
namespace {

using ::testing::AllOf;
using testing::Bytes;
using ::testing::Contains;
using ::testing::ElementsAre;
using testing::ErrorOf;
using testing::FakeServer;
using testing::FakeStream;
using testing::FakeUpload;
using testing::MakeStatus;
using ::testing::Not;
using testing::ProgressEvent;
using testing::StateEvent;
using testing::SuccessEvent;
using Status = google::rpc::Status;

constexpr int kAborted = 10, kNotFound = 5, kOutOfRange = 11, kResourceExhausted = 8, kUnavailable = 14;

using testing::kPositions;
using testing::kTriangles;
using testing::kUv;

ClientOptions Patient() {
  ClientOptions options;
  options.reattach_timeout = Seconds(60);
  options.retry_timeout = Seconds(60);
  options.backoff = Seconds(0.01);
  return options;
}

// ---- a server that is killed and started again at the same address

TEST(LostServer, UnwrapWaitsForTheServerAndGoesOnWithItsJob) {
  auto server = std::make_unique<FakeServer>();
  std::string draco;
  std::promise<void> running;
  server->on_unwrap = [&](const v1::UnwrapRequest& request, FakeStream& stream) {
    draco = request.spec().draco();
    stream.Send(StateEvent(1, v1::JOB_STATE_QUEUED));
    stream.Send(ProgressEvent(2, 1, 1e-3));
    running.set_value();
    while (!stream.IsCancelled()) std::this_thread::sleep_for(std::chrono::milliseconds(1));
    return Status();
  };
  std::vector<std::int64_t> sequences, skipped;
  std::atomic<int> reconnects = 0;
  Callbacks callbacks;
  callbacks.on_event = [&](const Event& event) {
    sequences.push_back(event.sequence);
    skipped.push_back(event.skipped);
  };
  callbacks.on_reconnect = [&](const Error&, Seconds) { ++reconnects; };
  Client client(server->target(), Patient());
  Call call = client.StartUnwrap({kPositions, kTriangles}, {}, callbacks);
  running.get_future().wait();
  const int port = server->port();
  server.reset();
  while (reconnects < 3) std::this_thread::sleep_for(std::chrono::milliseconds(1));

  FakeServer again(port);
  v1::WatchJobRequest seen;
  again.on_watch = [&](const v1::WatchJobRequest& request, FakeStream& stream) {
    seen = request;
    stream.Send(StateEvent(1025, v1::JOB_STATE_QUEUED));  // it numbers on beyond what the one before may have used
    stream.Send(SuccessEvent(1026, draco, Bytes(kUv)));
    stream.SendUv(0, Bytes(kUv));
    return Status();
  };
  EXPECT_EQ(call.Wait().uv.As<float>(), kUv);
  EXPECT_EQ(seen.name(), "jobs/1");
  EXPECT_EQ(seen.after_sequence(), 2);
  EXPECT_TRUE(seen.attach());
  EXPECT_THAT(sequences, ElementsAre(1, 2, 1025, 1026));
  EXPECT_THAT(skipped, ElementsAre(0, 0, 1022, 0));
}

// Listens, hangs up on everybody who says something, and knows the first byte that each has sent.
class Stranger {
 public:
  Stranger() : socket_(socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0)) {
    address_.sin_family = AF_INET;
    address_.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
    socklen_t size = sizeof address_;
    EXPECT_EQ(bind(socket_.get(), reinterpret_cast<const sockaddr*>(&address_), size), 0);
    EXPECT_EQ(getsockname(socket_.get(), reinterpret_cast<sockaddr*>(&address_), &size), 0);
    EXPECT_EQ(listen(socket_.get(), 16), 0);
    thread_ = std::thread([this] {
      std::vector<std::jthread> readers;  // one each: a peer may keep silent for as long as it likes
      while (true) {
        Descriptor peer(accept(socket_.get(), nullptr, nullptr));
        if (peer.get() < 0) return;
        readers.emplace_back([this, peer = std::move(peer)]() mutable {
          const Descriptor hung_up_at_the_end = std::move(peer);
          char byte = 0;
          if (recv(hung_up_at_the_end.get(), &byte, 1, 0) != 1) return;
          const std::lock_guard lock(mutex_);
          first_bytes_ += byte;
        });
      }
    });
  }
  ~Stranger() {
    shutdown(socket_.get(), SHUT_RDWR);
    thread_.join();
  }

  std::string target() const { return "127.0.0.1:" + std::to_string(ntohs(address_.sin_port)); }
  std::string first_bytes() {
    const std::lock_guard lock(mutex_);
    return first_bytes_;
  }

 private:
  const Descriptor socket_;
  sockaddr_in address_ = {};
  std::mutex mutex_;
  std::string first_bytes_;  // guarded by mutex_
  std::thread thread_;
};

TEST(LostServer, CallsInTheBackgroundDoNotTryTls) {
  constexpr char kHttp2 = 'P', kTls = 0x16;
  Stranger stranger;
  {
    Rpc rpc(stranger.target(), {});
    rpc.InBackground<v1::CancelJobRequest>(&v1::Planish::Stub::CancelJob, "jobs/1", TraceOf(""));
  }
  EXPECT_THAT(stranger.first_bytes(), AllOf(Contains(kHttp2), Not(Contains(kTls))));
  Rpc rpc(stranger.target(), {});
  EXPECT_EQ(ErrorOf([&] { rpc.Call(&v1::Planish::Stub::CancelJob, Named<v1::CancelJobRequest>("jobs/1")); }).code(),
            ErrorCode::kUnavailable);
  EXPECT_THAT(stranger.first_bytes(), Contains(kTls)) << "others do, to say what is wrong";
}

TEST(LostServer, BeforeTheFirstEventTheSameRequestIsMadeAgain) {
  FakeServer server;
  std::vector<std::string> request_ids;
  server.on_unwrap = [&](const v1::UnwrapRequest& request, FakeStream& stream) {
    request_ids.push_back(request.request_id());
    EXPECT_FALSE(request.spec().draco().empty());
    if (request_ids.size() == 1) return MakeStatus(kUnavailable, "Socket closed");
    if (request_ids.size() == 2) return MakeStatus(kUnavailable, "going down", "DRAINING", {}, 0.01);
    stream.Send(SuccessEvent(1, request.spec().draco(), Bytes(kUv)));
    stream.SendUv(0, Bytes(kUv));
    return Status();
  };
  EXPECT_EQ(Client(server.target(), Patient()).Unwrap({kPositions, kTriangles}).uv.As<float>(), kUv);
  EXPECT_THAT(request_ids, ElementsAre(request_ids[0], request_ids[0], request_ids[0]));
}

TEST(LostServer, MeshThatTheServerLostIsSentAgain) {
  FakeServer server;
  std::vector<std::string> request_ids;
  server.on_unwrap = [&](const v1::UnwrapRequest& request, FakeStream& stream) {
    request_ids.push_back(request.request_id());
    EXPECT_FALSE(request.spec().draco().empty());
    if (request_ids.size() == 1) {
      v1::JobEvent lost = StateEvent(1, v1::JOB_STATE_FAILED);
      *lost.mutable_job()->mutable_error() = MakeStatus(15, "the store was damaged", "MESH_LOST");
      stream.Send(lost);
      return Status();
    }
    stream.Send(SuccessEvent(1, request.spec().draco(), Bytes(kUv)));
    stream.SendUv(0, Bytes(kUv));
    return Status();
  };
  EXPECT_EQ(Client(server.target(), Patient()).Unwrap({kPositions, kTriangles}).uv.As<float>(), kUv);
  ASSERT_EQ(request_ids.size(), 2u);
  EXPECT_NE(request_ids[0], request_ids[1]);
}

TEST(LostServer, DetachedJobsAreWatchedWithoutAttaching) {
  FakeServer server;
  std::string draco;
  server.on_unwrap = [&](const v1::UnwrapRequest& request, FakeStream& stream) {
    draco = request.spec().draco();
    EXPECT_TRUE(request.detached());
    stream.Send(StateEvent(1, v1::JOB_STATE_QUEUED));
    return MakeStatus(kUnavailable, "Socket closed");
  };
  server.on_watch = [&](const v1::WatchJobRequest& request, FakeStream& stream) {
    EXPECT_FALSE(request.attach());
    stream.Send(SuccessEvent(2, draco, Bytes(kUv)));
    stream.SendUv(0, Bytes(kUv));
    return Status();
  };
  CallOptions call;
  call.detached = true;
  EXPECT_EQ(Client(server.target(), Patient()).Unwrap({kPositions, kTriangles}, {}, {}, call).uv.As<float>(), kUv);
}

TEST(LostServer, SafeCallsAreRepeated) {
  FakeServer server;
  std::map<std::string, int> calls;
  const auto twice_broken = [&](const std::string& name) {
    return ++calls[name] <= 2 ? MakeStatus(kUnavailable, "Socket closed") : Status();
  };
  server.on_job = [&](const std::string& method, const std::string&, v1::Job&) { return twice_broken(method); };
  server.on_list = [&](const v1::ListJobsRequest& request, v1::ListJobsResponse&) {
    EXPECT_EQ(request.filter(), "labels:night");
    return twice_broken("List");
  };
  server.on_estimate = [&](const v1::EstimateJobRequest&, v1::JobEstimate&) { return twice_broken("Estimate"); };
  server.on_capabilities = [&](v1::Capabilities&) { return twice_broken("Capabilities"); };
  server.on_create = [&](const v1::CreateJobRequest&, v1::Job&) { return twice_broken("Create"); };
  Client client(server.target(), Patient());
  client.GetJob("jobs/1");
  client.StopJob("jobs/1");
  client.CancelJob("jobs/1");
  client.DeleteJob("jobs/1");
  client.ListJobs(0, "labels:night");
  client.Estimate(1000);
  client.GetCapabilities();
  client.CreateJob({kPositions, kTriangles});
  EXPECT_EQ(calls.size(), 8u);
  for (const auto& [name, count] : calls) EXPECT_EQ(count, 3) << name;

  // Its first attempt got through, but not the answer.
  calls.clear();
  server.on_job = [&](const std::string& method, const std::string&, v1::Job&) {
    return ++calls[method] == 1 ? MakeStatus(kUnavailable, "Socket closed")
                                : MakeStatus(kNotFound, "no such job", "JOB_NOT_FOUND");
  };
  client.DeleteJob("jobs/1");
  EXPECT_EQ(ErrorOf([&] { client.DeleteJob("jobs/1"); }).reason(), "JOB_NOT_FOUND") << "the first attempt says so";

  ClientOptions impatient = Patient();
  impatient.retry_timeout = Seconds(0);
  calls.clear();
  EXPECT_EQ(ErrorOf([&] { Client(server.target(), impatient).GetJob("jobs/1"); }).code(), ErrorCode::kUnavailable);
  EXPECT_EQ(calls["Get"], 1);
}

TEST(LostServer, WaitsAsLongAsItIsAskedTo) {
  FakeServer server;
  int calls = 0;
  server.on_create = [&](const v1::CreateJobRequest&, v1::Job& job) {
    if (++calls == 1) return MakeStatus(kResourceExhausted, "no room for the mesh", "STORAGE_FULL", {}, 0.2);
    job.set_name("jobs/7");
    return Status();
  };
  const auto start = std::chrono::steady_clock::now();
  EXPECT_EQ(Client(server.target(), Patient()).CreateJob({kPositions, kTriangles}).name, "jobs/7");
  EXPECT_GE(std::chrono::steady_clock::now() - start, std::chrono::milliseconds(200));

  server.on_create = [&](const v1::CreateJobRequest&, v1::Job&) {
    return MakeStatus(kResourceExhausted, "too large for this server", "MEMORY_LIMIT",
                      {{"bytes", "9"}, {"limit", "8"}});
  };
  const Error error = ErrorOf([&] { Client(server.target(), Patient()).CreateJob({kPositions, kTriangles}); });
  EXPECT_EQ(error.reason(), "MEMORY_LIMIT") << "waiting would not help, and the server does not ask for it";
  EXPECT_EQ(error.metadata().at("limit"), "8");
}

// ---- stopping

TEST(StopCall, BringsWhatTheJobHas) {
  FakeServer server;
  std::promise<void> started;
  std::atomic<int> stops = 0;
  server.on_unwrap = [&](const v1::UnwrapRequest& request, FakeStream& stream) {
    stream.Send(StateEvent(1, v1::JOB_STATE_RUNNING));
    started.set_value();
    while (stops == 0 && !stream.IsCancelled()) std::this_thread::sleep_for(std::chrono::milliseconds(1));
    v1::JobEvent success = SuccessEvent(2, request.spec().draco(), Bytes(kUv));
    success.mutable_job()->set_stop_requested(true);
    success.mutable_job()->mutable_report()->add_warnings()->set_reason("STOPPED");
    stream.Send(success);
    stream.SendUv(0, Bytes(kUv));
    return Status();
  };
  server.on_job = [&](const std::string& method, const std::string& job, v1::Job&) {
    if (method == "Stop" && job == "jobs/1") ++stops;
    return Status();
  };
  Client client(server.target(), Patient());
  Call call = client.StartUnwrap({kPositions, kTriangles});
  started.get_future().wait();
  call.Stop();
  const UnwrapResult result = call.Wait();
  EXPECT_EQ(result.uv.As<float>(), kUv);
  EXPECT_EQ(result.report.warnings.at(0).reason, "STOPPED");
  EXPECT_EQ(stops, 1);
}

TEST(StopCall, BeforeTheJobIsAcceptedAndOverALostStream) {
  FakeServer server;
  std::promise<void> called, stopped;
  std::atomic<int> stops = 0;
  std::string draco;
  server.on_unwrap = [&](const v1::UnwrapRequest& request, FakeStream& stream) {
    draco = request.spec().draco();
    called.set_value();
    stopped.get_future().wait();
    stream.Send(StateEvent(1, v1::JOB_STATE_QUEUED));
    while (stops == 0) std::this_thread::sleep_for(std::chrono::milliseconds(1));
    return MakeStatus(kUnavailable, "Socket closed");
  };
  server.on_watch = [&](const v1::WatchJobRequest&, FakeStream& stream) {
    while (stops < 2) std::this_thread::sleep_for(std::chrono::milliseconds(1));  // the first may have been lost
    stream.Send(SuccessEvent(2, draco, Bytes(kUv)));
    stream.SendUv(0, Bytes(kUv));
    return Status();
  };
  server.on_job = [&](const std::string& method, const std::string&, v1::Job&) {
    if (method == "Stop") ++stops;
    return Status();
  };
  Client client(server.target(), Patient());
  Call call = client.StartUnwrap({kPositions, kTriangles});
  called.get_future().wait();
  call.Stop();
  stopped.set_value();
  EXPECT_EQ(call.Wait().uv.As<float>(), kUv);
}

// ---- uploads

// A server that takes uploads, and breaks their streams as the test says.
class UploadTest : public ::testing::Test {
 protected:
  UploadTest() {
    options_.inline_mesh_bytes = 0;
    server_.on_capabilities = [](v1::Capabilities& capabilities) {
      capabilities.set_upload_chunk_bytes(16);
      return Status();
    };
    server_.on_create_upload = [this](const v1::CreateUploadRequest& request, v1::Upload& upload) {
      upload_.set_name("uploads/" + std::to_string(++creates_));
      upload_.set_total_bytes(request.total_bytes());
      upload_.set_sha256(request.sha256());
      bytes_.clear();
      return Answer(upload);
    };
    server_.on_get_upload = [this](const std::string& name, v1::Upload& upload) {
      if (name != upload_.name()) return MakeStatus(kNotFound, "no such upload", "UPLOAD_NOT_FOUND");
      return Answer(upload);
    };
    server_.on_write_upload = [this](FakeUpload& call, v1::Upload& upload) {
      ++writes_;
      v1::WriteUploadRequest message;
      for (int i = 0; call.Next(message); ++i) {
        EXPECT_LE(message.data().size(), 16u);
        EXPECT_EQ(message.name(), i == 0 ? upload_.name() : "");
        if (before_message) {
          if (Status status = before_message(i); status.code() != 0) return status;
        }
        EXPECT_EQ(message.offset(), static_cast<std::int64_t>(bytes_.size()));
        bytes_ += message.data();
      }
      return Answer(upload);
    };
    server_.on_unwrap = [this](const v1::UnwrapRequest& request, FakeStream& stream) {
      EXPECT_TRUE(request.spec().draco().empty());
      if (request.spec().upload() != upload_.name()) return MakeStatus(kNotFound, "it expired", "UPLOAD_NOT_FOUND");
      EXPECT_EQ(Sha256(bytes_), upload_.sha256());
      stream.Send(SuccessEvent(1, bytes_, Bytes(kUv)));
      stream.SendUv(0, Bytes(kUv));
      return Status();
    };
  }

  Status Answer(v1::Upload& upload) {
    upload_.set_committed_bytes(static_cast<std::int64_t>(bytes_.size()));
    upload = upload_;
    return Status();
  }

  UnwrapResult Unwrap(const Callbacks& callbacks = {}, const CallOptions& call = {}) {
    return Client(server_.target(), options_).Unwrap({kPositions, kTriangles}, {}, callbacks, call);
  }

  std::function<Status(int message)> before_message;
  ClientOptions options_ = Patient();
  v1::Upload upload_;
  std::string bytes_;
  int creates_ = 0, writes_ = 0;
  FakeServer server_;
};

TEST_F(UploadTest, LargeMeshesTravelAhead) {
  std::vector<std::int64_t> sent;
  Callbacks callbacks;
  callbacks.on_upload = [&](std::int64_t bytes, std::int64_t total) {
    sent.push_back(bytes);
    EXPECT_EQ(total, upload_.total_bytes());
  };
  EXPECT_EQ(Unwrap(callbacks).uv.As<float>(), kUv);
  EXPECT_EQ(creates_, 1);
  EXPECT_EQ(writes_, 1);
  EXPECT_TRUE(std::is_sorted(sent.begin(), sent.end()));
  EXPECT_EQ(sent.back(), upload_.total_bytes());

  server_.on_create = [this](const v1::CreateJobRequest& request, v1::Job& job) {
    EXPECT_EQ(request.spec().upload(), upload_.name());
    job.set_name("jobs/8");
    return Status();
  };
  EXPECT_EQ(Client(server_.target(), options_).CreateJob({kPositions, kTriangles}).name, "jobs/8");
}

TEST_F(UploadTest, KnownBytesAreNotSent) {
  server_.on_create_upload = [this](const v1::CreateUploadRequest& request, v1::Upload& upload) {
    upload_.set_name("uploads/known");
    upload = upload_;
    upload.set_committed_bytes(request.total_bytes());
    return Status();
  };
  server_.on_unwrap = [](const v1::UnwrapRequest& request, FakeStream&) {
    EXPECT_EQ(request.spec().upload(), "uploads/known");
    return MakeStatus(3, "enough", "OPTIONS_INVALID");
  };
  EXPECT_EQ(ErrorOf([&] { Unwrap(); }).reason(), "OPTIONS_INVALID");
  EXPECT_EQ(writes_, 0);
}

TEST_F(UploadTest, ResumesWhereItBroke) {
  before_message = [this](int message) {
    if (writes_ <= 2 && message == 1) return MakeStatus(kUnavailable, "Socket closed");
    if (writes_ == 3) return MakeStatus(kAborted, "another call", "UPLOAD_BUSY");
    if (writes_ == 4) return MakeStatus(kOutOfRange, "elsewhere", "UPLOAD_OFFSET_MISMATCH");
    if (writes_ == 5) return MakeStatus(kResourceExhausted, "disk full", "STORAGE_FULL", {}, 0.05);
    return Status();
  };
  int pauses = 0;
  Callbacks callbacks;
  callbacks.on_reconnect = [&](const Error&, Seconds) { ++pauses; };
  EXPECT_EQ(Unwrap(callbacks).uv.As<float>(), kUv);
  EXPECT_EQ(creates_, 1) << "nothing was sent twice";
  EXPECT_EQ(writes_, 6);
  EXPECT_EQ(pauses, 5);
}

TEST_F(UploadTest, BeginsAgainWhenTheUploadIsGone) {
  before_message = [this](int message) {
    if (writes_ == 1 && message == 1) return MakeStatus(kNotFound, "it expired", "UPLOAD_NOT_FOUND");
    if (writes_ == 2 && message == 1) {
      upload_.set_name("uploads/another");  // the server was started anew
      return MakeStatus(kUnavailable, "Socket closed");
    }
    if (writes_ == 3) return MakeStatus(3, "damaged", "DIGEST_MISMATCH");
    return Status();
  };
  int unwraps = 0;
  const auto unwrap = server_.on_unwrap;
  server_.on_unwrap = [&, unwrap](const v1::UnwrapRequest& request, FakeStream& stream) {
    if (++unwraps == 1) upload_.set_name("uploads/none");  // it expired while the job had to wait for room
    return unwrap(request, stream);
  };
  EXPECT_EQ(Unwrap().uv.As<float>(), kUv);
  EXPECT_EQ(creates_, 5);
  EXPECT_EQ(unwraps, 2);
}

TEST_F(UploadTest, GivesUp) {
  options_.reattach_timeout = Seconds(0.3);
  before_message = [](int) { return MakeStatus(kUnavailable, "Socket closed"); };
  EXPECT_EQ(ErrorOf([&] { Unwrap(); }).reason(), "CONNECTION_LOST");
  before_message = [](int) { return MakeStatus(3, "damaged", "DIGEST_MISMATCH"); };
  const Error damaged = ErrorOf([&] { Unwrap(); });
  EXPECT_EQ(damaged.reason(), "DIGEST_MISMATCH");
  EXPECT_EQ(damaged.code(), ErrorCode::kInvalidArgument);
  server_.on_create_upload = [](const v1::CreateUploadRequest&, v1::Upload&) {
    return MakeStatus(kResourceExhausted, "too large", "MESH_TOO_LARGE", {{"bytes", "9"}, {"limit", "8"}});
  };
  EXPECT_EQ(ErrorOf([&] { Unwrap(); }).reason(), "MESH_TOO_LARGE");
}

TEST_F(UploadTest, TooLargeIsSaidBeforeAnythingIsSent) {
  server_.on_capabilities = [](v1::Capabilities& capabilities) {
    capabilities.set_max_mesh_bytes(20);
    return Status();
  };
  const Error error = ErrorOf([&] { Unwrap(); });
  EXPECT_EQ(error.code(), ErrorCode::kResourceExhausted);
  EXPECT_EQ(error.reason(), "MESH_TOO_LARGE");
  EXPECT_EQ(error.metadata().at("limit"), "20");
  EXPECT_GT(std::stoi(error.metadata().at("bytes")), 20);
  EXPECT_EQ(creates_, 0);
}

TEST_F(UploadTest, StoppedOnTheWay) {
  std::stop_source stop;
  CallOptions call;
  call.stop = stop.get_token();
  before_message = [&](int message) {
    if (message == 1) stop.request_stop();
    return message == 1 ? MakeStatus(kUnavailable, "Socket closed") : Status();
  };
  EXPECT_EQ(ErrorOf([&] { Unwrap({}, call); }).code(), ErrorCode::kCancelled);
  EXPECT_EQ(writes_, 1);
}

TEST_F(UploadTest, DeadlineOfTheCall) {
  CallOptions call;
  call.timeout = Seconds(0.3);
  before_message = [](int) { return MakeStatus(kUnavailable, "Socket closed"); };
  EXPECT_EQ(ErrorOf([&] { Unwrap({}, call); }).code(), ErrorCode::kDeadlineExceeded);
}

}  // namespace
}  // namespace planish
