#include "server/jobs/worker_pool.h"

#include <atomic>
#include <thread>

#include "core/base/error.h"
#include "gmock/gmock.h"
#include "google/rpc/error_details.pb.h"
#include "gtest/gtest.h"
#include "tests/server/testing/event_reader.h"
#include "tests/server/testing/fake_workers.h"

namespace planish {
namespace {

using ::testing::HasSubstr;

class Pool {
 public:
  Pool(WorkerFactory factory, int workers)
      : manager_(Options(workers), NewMemoryJobStore()),
        pool_(std::make_unique<WorkerPool>(&manager_, std::move(factory), workers)) {}
  ~Pool() {
    manager_.CancelAll();
    manager_.Stop();
  }

  JobManager& manager() { return manager_; }

  AcceptedJob Create() {
    JobRequest request;
    request.draco = "mesh";
    return *manager_.Create(std::move(request));
  }

 private:
  static JobManagerOptions Options(int workers) {
    JobManagerOptions options;
    options.workers = workers;
    return options;
  }

  JobManager manager_;
  std::unique_ptr<WorkerPool> pool_;
};

TEST(WorkerPool, TenJobsOnTwoWorkers) {
  constexpr int kIterations = 50;
  std::atomic<int> at_work = 0;
  std::atomic<int> most = 0;
  const WorkerScript succeed = Succeed(kIterations, "uv");
  Pool pool(ScriptedWorkers([&](ServerLink& server, const worker::v1::WorkRequest& request) {
              const int now = ++at_work;
              for (int seen = most; seen < now && !most.compare_exchange_weak(seen, now);) {
              }
              succeed(server, request);
              --at_work;
            }),
            2);
  std::vector<std::thread> callers;
  for (int i = 0; i < 10; ++i) {
    callers.emplace_back([&pool] {
      const AcceptedJob accepted = pool.Create();
      const std::vector<v1::JobEvent> events = Follow(*accepted.events);
      ASSERT_EQ(events.size(), 3u + kIterations);
      for (std::size_t e = 0; e < events.size(); ++e) {
        EXPECT_EQ(events[e].sequence(), static_cast<std::int64_t>(e) + 1);
        EXPECT_EQ(events[e].skipped(), 0);
      }
      for (int iteration = 1; iteration <= kIterations; ++iteration) {
        EXPECT_EQ(events[static_cast<std::size_t>(iteration) + 1].progress().newton_iteration(), iteration);
      }
      EXPECT_EQ(events.back().job().state(), v1::JOB_STATE_SUCCEEDED);
    });
  }
  for (std::thread& caller : callers) caller.join();
  EXPECT_LE(most, 2);
}

TEST(WorkerPool, WorkerThatDiesFailsItsJobOnly) {
  std::atomic<int> count = 0;
  const WorkerScript succeed = Succeed(1, "uv");
  Pool pool(ScriptedWorkers([&](ServerLink& server, const worker::v1::WorkRequest& request) {
              if (++count == 1) return;
              succeed(server, request);
            }),
            1);
  const AcceptedJob first = pool.Create();
  const AcceptedJob second = pool.Create();
  const v1::Job failed = Follow(*first.events).back().job();
  EXPECT_EQ(failed.state(), v1::JOB_STATE_FAILED);
  EXPECT_THAT(failed.error().message(), HasSubstr("without a result"));
  google::rpc::ErrorInfo info;
  ASSERT_TRUE(failed.error().details(0).UnpackTo(&info));
  EXPECT_EQ(info.reason(), "INTERNAL");
  EXPECT_EQ(Follow(*second.events).back().job().state(), v1::JOB_STATE_SUCCEEDED);
}

TEST(WorkerPool, WorkerThatCannotStartFailsItsJob) {
  Pool pool([]() -> absl::StatusOr<std::shared_ptr<WorkerLink>> { return InternalError("no more processes"); }, 1);
  const v1::Job job = Follow(*pool.Create().events).back().job();
  EXPECT_EQ(job.state(), v1::JOB_STATE_FAILED);
  EXPECT_THAT(job.error().message(), HasSubstr("no more processes"));
}

TEST(WorkerPool, CancelFreesTheWorker) {
  std::atomic<int> count = 0;
  const WorkerScript succeed = Succeed(1, "uv");
  Pool pool(ScriptedWorkers([&](ServerLink& server, const worker::v1::WorkRequest& request) {
              (++count == 1 ? WaitForCancel() : succeed)(server, request);
            }),
            1);
  const AcceptedJob first = pool.Create();
  const AcceptedJob second = pool.Create();
  WaitForEvent(*first.events, 3);
  EXPECT_EQ(pool.manager().Cancel(first.job.name())->state(), v1::JOB_STATE_STOPPING);
  EXPECT_EQ(Follow(*first.events).back().job().state(), v1::JOB_STATE_CANCELLED);
  EXPECT_EQ(Follow(*second.events).back().job().state(), v1::JOB_STATE_SUCCEEDED);
}

TEST(WorkerPool, ShutdownEndsEveryJob) {
  std::vector<AcceptedJob> jobs;
  {
    Pool pool(ScriptedWorkers(WaitForCancel()), 2);
    for (int i = 0; i < 5; ++i) jobs.push_back(pool.Create());
  }
  for (const AcceptedJob& job : jobs) EXPECT_EQ(Follow(*job.events).back().job().state(), v1::JOB_STATE_CANCELLED);
}

TEST(WorkerPool, WorkerThatIsGivenUpFailsItsJob) {
  Gate gate;
  Pool pool(ScriptedWorkers([&gate](ServerLink& server, const worker::v1::WorkRequest&) {
              server.Send(ProgressMessage(1));
              gate.Wait();
            }),
            1);
  const AcceptedJob accepted = pool.Create();
  WaitForEvent(*accepted.events, 3);
  pool.manager().CloseLinks();
  EXPECT_EQ(Follow(*accepted.events).back().job().state(), v1::JOB_STATE_FAILED);
  gate.Open();
}

}  // namespace
}  // namespace planish
