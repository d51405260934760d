// Calls of one tenant that take long, and those of others meanwhile: over a socket.
#include <atomic>
#include <condition_variable>
#include <memory>
#include <mutex>
#include <string>
#include <thread>
#include <vector>

#include "gmock/gmock.h"
#include "gtest/gtest.h"
#include "tests/server/rpc/rpc_test_server.h"

namespace planish {
namespace {

// Of jobs that hold up the thread that creates them.
constexpr double kSlowTolerance = 7;

// Metadata "tenant" says who calls.
class NamedCallerSource : public CallerSource {
 public:
  absl::StatusOr<Caller> Identify(const grpc::CallbackServerContext& context) const override {
    const auto found = context.client_metadata().find("tenant");
    const std::string tenant(found->second.data(), found->second.size());
    return Caller{tenant, "token", Rights::All(), ""};
  }
};

// Where slow calls wait until the test lets them go on.
class Gate {
 public:
  void Pass() {
    std::unique_lock lock(mutex_);
    ++waiting_;
    changed_.notify_all();
    changed_.wait(lock, [this] { return open_; });
  }
  void WaitFor(int waiting) {
    std::unique_lock lock(mutex_);
    changed_.wait(lock, [&] { return waiting_ >= waiting; });
  }
  void Open() {
    const std::lock_guard lock(mutex_);
    open_ = true;
    changed_.notify_all();
  }

 private:
  std::mutex mutex_;
  std::condition_variable changed_;
  int waiting_ = 0;
  bool open_ = false;
};

class FairCallsTest : public ::testing::Test {
 protected:
  FairCallsTest()
      : gate_(std::make_shared<Gate>()),
        server_(WaitForCancel(), Options(gate_), {}, 1e9, std::make_unique<NamedCallerSource>()),
        stub_(server_.stub()) {}

  ~FairCallsTest() override { gate_->Open(); }

  static JobManagerOptions Options(const std::shared_ptr<Gate>& gate) {
    JobManagerOptions options;
    options.limits.queue_capacity = 10'000;
    options.queue_total = 10'000;
    options.validate_options = [gate](const v1::UnwrapOptions& unwrap) {
      if (unwrap.tolerance() == kSlowTolerance) gate->Pass();
      return absl::OkStatus();
    };
    return options;
  }

  static std::unique_ptr<grpc::ClientContext> As(const std::string& tenant) {
    auto context = std::make_unique<grpc::ClientContext>();
    context->AddMetadata("tenant", tenant);
    context->set_deadline(std::chrono::system_clock::now() + std::chrono::seconds(60));
    return context;
  }

  static v1::CreateJobRequest Mesh(int number, bool is_slow = false) {
    v1::CreateJobRequest request;
    request.mutable_spec()->set_draco("mesh" + std::to_string(number));
    if (is_slow) request.mutable_spec()->mutable_options()->set_tolerance(kSlowTolerance);
    return request;
  }

  static v1::BatchCreateJobsRequest Batch(int count, bool is_slow) {
    v1::BatchCreateJobsRequest batch;
    for (int i = 0; i < count; ++i) *batch.add_requests() = Mesh(i, is_slow && i == 0);
    return batch;
  }

  int CountJobs(const std::string& tenant) {
    v1::ListJobsRequest request;
    request.set_page_size(1000);
    request.set_filter("tenant=\"" + tenant + "\"");
    v1::ListJobsResponse response;
    const grpc::Status status = stub_.ListJobs(As(tenant).get(), request, &response);
    EXPECT_TRUE(status.ok()) << status.error_message();
    return response.jobs_size();
  }

  const std::shared_ptr<Gate> gate_;
  RpcTestServer server_;
  v1::Planish::Stub& stub_;
};

TEST_F(FairCallsTest, BatchesHoldUpNobodyElse) {
  v1::Job kept;
  ASSERT_TRUE(stub_.CreateJob(As("bob").get(), Mesh(1), &kept).ok());
  std::vector<std::thread> batches;
  for (int i = 0; i < 12; ++i) {
    batches.emplace_back([this] {
      v1::BatchCreateJobsResponse response;
      EXPECT_TRUE(stub_.BatchCreateJobs(As("ann").get(), Batch(3, /*is_slow=*/true), &response).ok());
    });
  }
  gate_->WaitFor(2);
  v1::Capabilities capabilities;
  EXPECT_TRUE(stub_.GetCapabilities(As("bob").get(), {}, &capabilities).ok());
  v1::GetJobRequest get;
  get.set_name(kept.name());
  v1::Job job;
  EXPECT_TRUE(stub_.GetJob(As("bob").get(), get, &job).ok());
  EXPECT_EQ(CountJobs("bob"), 1);
  EXPECT_TRUE(stub_.CreateJob(As("bob").get(), Mesh(2), &job).ok());
  // Not even the same tenant's own reads wait for them.
  EXPECT_EQ(CountJobs("ann"), 0);
  gate_->Open();
  for (std::thread& batch : batches) batch.join();
}

TEST_F(FairCallsTest, ABatchTakesFewCommits) {
  v1::Job first;  // keeps the worker busy
  ASSERT_TRUE(stub_.CreateJob(As("ann").get(), Mesh(10'000), &first).ok());
  v1::WatchJobRequest watch;
  watch.set_name(first.name());
  const auto context = As("ann");
  const auto reader = stub_.WatchJob(context.get(), watch);
  v1::WatchJobResponse event;
  while (reader->Read(&event) && event.event().job().state() != v1::JOB_STATE_RUNNING) {
  }
  server_.fault().commits = 0;
  v1::BatchCreateJobsResponse response;
  ASSERT_TRUE(stub_.BatchCreateJobs(As("ann").get(), Batch(1000, /*is_slow=*/false), &response).ok());
  EXPECT_LT(std::atomic_ref(server_.fault().commits).load(), 100);
  ASSERT_EQ(response.results_size(), 1000);
  for (const auto& result : response.results()) ASSERT_TRUE(result.has_job()) << result.error().message();
  context->TryCancel();
}

TEST_F(FairCallsTest, CancelledCallsAreSkipped) {
  constexpr int kSlow = 8, kCancelled = 10;  // more slow ones than there are threads
  std::vector<std::thread> calls;
  for (int i = 0; i < kSlow; ++i) {
    calls.emplace_back([this, i] {
      v1::Job job;
      EXPECT_TRUE(stub_.CreateJob(As("ann").get(), Mesh(i, /*is_slow=*/true), &job).ok());
    });
  }
  gate_->WaitFor(2);
  std::vector<std::unique_ptr<grpc::ClientContext>> contexts;
  for (int i = 0; i < kCancelled; ++i) {
    contexts.push_back(As("ann"));
    calls.emplace_back([this, i, context = contexts.back().get()] {
      v1::Job job;
      EXPECT_EQ(stub_.CreateJob(context, Mesh(100 + i), &job).error_code(), grpc::StatusCode::CANCELLED);
    });
  }
  // Calls of one connection arrive in the order in which they were made.
  v1::Capabilities capabilities;
  for (int i = 0; i < 10; ++i) ASSERT_TRUE(stub_.GetCapabilities(As("ann").get(), {}, &capabilities).ok());
  for (const auto& context : contexts) context->TryCancel();
  for (int i = kSlow; i < kSlow + kCancelled; ++i) calls[static_cast<std::size_t>(i)].join();
  for (int i = 0; i < 10; ++i) ASSERT_TRUE(stub_.GetCapabilities(As("ann").get(), {}, &capabilities).ok());
  gate_->Open();
  for (int i = 0; i < kSlow; ++i) calls[static_cast<std::size_t>(i)].join();
  // Behind all of them, as one tenant's calls begin in their order.
  v1::Job last;
  ASSERT_TRUE(stub_.CreateJob(As("ann").get(), Mesh(1000), &last).ok());
  EXPECT_EQ(CountJobs("ann"), kSlow + 1);
}

TEST_F(FairCallsTest, ABatchEndsWhenItIsCancelled) {
  const auto context = As("ann");
  std::thread call([&] {
    v1::BatchCreateJobsResponse response;
    EXPECT_EQ(stub_.BatchCreateJobs(context.get(), Batch(900, /*is_slow=*/true), &response).error_code(),
              grpc::StatusCode::CANCELLED);
  });
  gate_->WaitFor(1);
  context->TryCancel();
  call.join();
  v1::Capabilities capabilities;
  for (int i = 0; i < 10; ++i) ASSERT_TRUE(stub_.GetCapabilities(As("ann").get(), {}, &capabilities).ok());
  gate_->Open();
  server_.rpc().Shutdown(absl::InfiniteFuture());  // waits for the call
  v1::ListJobsRequest list;
  list.set_page_size(1000);
  EXPECT_LT(server_.manager().List({"ann", "token", Rights::All(), ""}, list)->jobs.size(), 200);
}

}  // namespace
}  // namespace planish
