// Waiting, results in pieces and jobs by the dozen, against a server that does what the test says.
#include <algorithm>
#include <atomic>
#include <mutex>
#include <set>
#include <string>
#include <thread>
#include <vector>

#include "client/cli/batch_job.h"
#include "gmock/gmock.h"
#include "gtest/gtest.h"
#include "planish/client.h"
#include "tests/client/fake_server.h"

namespace planish {
namespace {

using testing::FakeServer;
using testing::kPositions;
using testing::kTriangles;
using testing::MakeStatus;
using Status = google::rpc::Status;

class ShortCalls : public ::testing::Test {
 protected:
  FakeServer server_;
};

TEST_F(ShortCalls, WaitJobAsksUntilTheEndOrTheTimeout) {
  int calls = 0;
  double asked = 0;
  server_.on_wait = [&](const v1::WaitJobRequest& request, v1::Job& job) {
    asked = static_cast<double>(request.timeout().seconds()) + 1e-9 * request.timeout().nanos();
    job.set_name(request.name());
    job.set_state(++calls < 3 ? v1::JOB_STATE_STOPPING : v1::JOB_STATE_CANCELLED);
    job.set_cancel_requested(true);
    return Status();
  };
  Client client(server_.target());
  const Job job = client.WaitJob("jobs/7");
  EXPECT_EQ(job.state, JobState::kCancelled);
  EXPECT_TRUE(job.cancel_requested);
  EXPECT_EQ(calls, 3);
  EXPECT_GT(asked, 1) << "calls wait on the server";

  calls = -1'000'000;
  EXPECT_EQ(client.WaitJob("jobs/7", std::chrono::milliseconds(20)).state, JobState::kStopping) << "the timeout passed";
  EXPECT_LE(asked, 0.02);
}

TEST_F(ShortCalls, ReadResultPutsPiecesTogether) {
  const std::string uv = "0123456789";
  server_.on_read = [&](const v1::ReadResultRequest& request, v1::ReadResultResponse& response) {
    const auto offset = static_cast<std::size_t>(request.offset());
    response.set_data(
        uv.substr(std::min(offset, uv.size()), static_cast<std::size_t>(std::min(request.limit(), std::int64_t{3}))));
    return Status();
  };
  Client client(server_.target());
  EXPECT_EQ(client.ReadResult("jobs/7", 0, 10), uv);
  EXPECT_EQ(client.ReadResult("jobs/7", 2, 5), "23456");
  EXPECT_EQ(client.ReadResult("jobs/7", 8, 100), "89") << "they end before";
}

// A square of another size for each n.
std::vector<float> Square(int n) {
  std::vector<float> positions = kPositions;
  for (float& coordinate : positions) coordinate *= static_cast<float>(n + 1);
  return positions;
}

// Answers with a job of the request's id, and keeps what was asked.
class JobMaker {
 public:
  explicit JobMaker(FakeServer* server) {
    server->on_batch = [this](const v1::BatchCreateJobsRequest& request, v1::BatchCreateJobsResponse& response) {
      ++calls;
      for (const v1::CreateJobRequest& each : request.requests()) {
        auto* result = response.add_results();
        if (each.request_id() == "refused") {
          *result->mutable_error() = MakeStatus(8, "full", "QUEUE_FULL", {}, 0.5);
        } else if (each.spec().has_mesh_sha256() && each.request_id() == "lost") {
          *result->mutable_error() = MakeStatus(5, "gone", "MESH_NOT_FOUND");
        } else {
          result->mutable_job()->set_name("jobs/" + each.request_id());
        }
        by_digest += each.spec().has_mesh_sha256() ? 1 : 0;
        by_bytes += each.spec().has_draco() ? 1 : 0;
      }
      return Status();
    };
    server->on_find_missing = [this](const v1::FindMissingMeshesRequest& request,
                                     v1::FindMissingMeshesResponse& response) {
      for (const std::string& digest : request.sha256()) {
        if (all_missing) response.add_missing_sha256(digest);
      }
      return Status();
    };
    server->on_create = [this](const v1::CreateJobRequest& request, v1::Job& job) {
      ++single;
      EXPECT_TRUE(request.spec().has_draco());
      job.set_name("jobs/" + request.request_id());
      return Status();
    };
  }

  std::atomic<int> calls = 0, by_digest = 0, by_bytes = 0, single = 0;
  std::atomic<bool> all_missing = true;
};

TEST_F(ShortCalls, ManyJobsByOneCall) {
  JobMaker maker(&server_);
  Client client(server_.target());
  std::vector<std::vector<float>> positions;
  for (int n = 0; n < 4; ++n) positions.push_back(Square(n));
  const std::vector<std::uint32_t> wrong = {0, 1, 9};
  std::vector<NewJob> jobs;
  for (const auto& each : positions) jobs.push_back({{each, kTriangles}, {}, {}});
  jobs.push_back({{kPositions, wrong}, {}, {}});
  jobs[0].call.request_id = "a";
  jobs[1].call.request_id = "refused";
  jobs[2].call.request_id = "b";
  jobs[3].call.request_id = "lost";
  std::vector<Result<Job>> created = client.CreateJobs(jobs);
  ASSERT_EQ(created.size(), 5u);
  EXPECT_EQ(created[0]->name, "jobs/a");
  EXPECT_EQ(created[1].error().reason(), "QUEUE_FULL");
  EXPECT_EQ(created[1].error().retry_after(), Seconds(0.5));
  EXPECT_EQ(created[2]->name, "jobs/b");
  EXPECT_EQ(created[4].error().reason(), "MESH_INDEX_OUT_OF_RANGE") << "it went nowhere";
  EXPECT_EQ(maker.calls, 1);
  EXPECT_EQ(maker.by_bytes, 4);

  maker.all_missing = false;
  created = client.CreateJobs(jobs);
  EXPECT_EQ(maker.by_digest, 4) << "the server has them";
  EXPECT_EQ(maker.by_bytes, 4);
  EXPECT_EQ(created[3]->name, "jobs/lost") << "it had lost it by then: the mesh was sent";
  EXPECT_EQ(maker.single, 1);
}

TEST_F(ShortCalls, ThreadsOfABatchShareCalls) {
  JobMaker maker(&server_);
  ClientOptions options;
  options.retry_timeout = Seconds(0);
  Client client(server_.target(), options);
  cli::BatchQueue queue(&client);
  std::mutex mutex;
  std::set<std::string> names;
  int refused = 0;
  {
    std::vector<std::jthread> threads;
    for (int n = 0; n < 20; ++n) {
      threads.emplace_back([&, n] {
        const std::vector<float> positions = Square(n);
        NewJob job = {{positions, kTriangles}, {}, {}};
        job.call.request_id = n == 7 ? "refused" : std::to_string(n);
        try {
          const std::string name = queue.Create(job).name;
          const std::lock_guard lock(mutex);
          names.insert(name);
        } catch (const Error& error) {
          EXPECT_EQ(error.reason(), "QUEUE_FULL");
          const std::lock_guard lock(mutex);
          ++refused;
        }
      });
    }
  }
  EXPECT_EQ(names.size(), 19u);
  EXPECT_EQ(refused, 1);
  EXPECT_LE(maker.calls, 20);
  server_.Stop();
  EXPECT_THROW(queue.Create({{kPositions, kTriangles}, {}, {}}), Error) << "no server: everybody hears of it";
}

}  // namespace
}  // namespace planish
