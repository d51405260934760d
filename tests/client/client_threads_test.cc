// Calls that other threads watch and end while events arrive. The thread sanitizer runs this too.
#include <atomic>
#include <chrono>
#include <string>
#include <thread>
#include <vector>

#include "gmock/gmock.h"
#include "gtest/gtest.h"
#include "planish/client.h"
#include "tests/client/fake_server.h"

namespace planish {
namespace {

using testing::Bytes;
using testing::FakeServer;
using testing::FakeStream;

enum class Ending { kNone, kStop, kCancel };

class ClientThreads : public ::testing::TestWithParam<Ending> {
 protected:
  ~ClientThreads() override { server_.Stop(); }

  FakeServer server_;
};

TEST_P(ClientThreads, WatchAndEndACallAtAnyTime) {
  constexpr int kEvents = 40;
  server_.on_job = [](const std::string&, const std::string& job, v1::Job& answer) {
    answer.set_name(job);
    return google::rpc::Status();
  };
  server_.on_unwrap = [&](const v1::UnwrapRequest& request, FakeStream& stream) {
    stream.Send(testing::StateEvent(1, v1::JOB_STATE_QUEUED));
    for (int i = 2; i < kEvents && !stream.IsCancelled(); ++i) {
      stream.Send(testing::ProgressEvent(i, i, 0.5));
      std::this_thread::sleep_for(std::chrono::milliseconds(1));
    }
    const std::string uv = Bytes(testing::kUv);
    stream.Send(testing::SuccessEvent(kEvents, request.spec().draco(), uv));
    stream.SendUv(0, uv);
    return google::rpc::Status();
  };
  Client client(server_.target());
  for (int round = 0; round < 8; ++round) {
    std::atomic<int> events = 0;
    Callbacks callbacks;
    callbacks.on_event = [&](const Event&) { ++events; };
    Call call = client.StartUnwrap({testing::kPositions, testing::kTriangles}, {}, callbacks);
    std::vector<std::jthread> others;
    for (int k = 0; k < 2; ++k) {
      others.emplace_back([&, k] {
        while (!call.WaitFor(Seconds(0)) && events < 3 * round + k) {
          const std::string job = call.job();
          EXPECT_TRUE(job.empty() || job == "jobs/1") << job;
          std::this_thread::yield();
        }
        if (GetParam() == Ending::kStop) call.Stop();
        if (GetParam() == Ending::kCancel) call.Cancel();
      });
    }
    others.clear();
    const Result<UnwrapResult> result = call.Wait(std::nothrow);
    // A call that is cancelled late may have ended well.
    if (!result.ok()) {
      ASSERT_EQ(GetParam(), Ending::kCancel) << result.error().what();
      EXPECT_EQ(result.error().code(), ErrorCode::kCancelled);
    }
  }
}

INSTANTIATE_TEST_SUITE_P(Ending, ClientThreads, ::testing::Values(Ending::kNone, Ending::kStop, Ending::kCancel),
                         [](const auto& by) {
                           if (by.param == Ending::kNone) return "None";
                           return by.param == Ending::kStop ? "Stop" : "Cancel";
                         });

}  // namespace
}  // namespace planish
