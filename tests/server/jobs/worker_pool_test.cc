#include "server/jobs/worker_pool.h"

#include <atomic>
#include <condition_variable>
#include <deque>
#include <map>
#include <mutex>
#include <optional>

#include "core/base/error.h"
#include "gmock/gmock.h"
#include "gtest/gtest.h"
#include "server/jobs/steady_clock.h"
#include "server/link/in_process_link.h"
#include "tests/testing/fake_workers.h"

namespace planish {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;

// Jobs "0", "1", ... and what became of each. Obedience is asked for at will.
class Jobs : public JobSource {
 public:
  struct Fate {
    int progress = 0;
    bool has_result = false;
    int code = 0;
    std::string uv;
    std::optional<WorkerLoss> loss;

    bool ended() const { return has_result || loss.has_value(); }
  };

  explicit Jobs(int count) : count_(count), fates_(static_cast<std::size_t>(count)) {}

  void WaitForAll() {
    std::unique_lock lock(mutex_);
    changed_.wait(lock, [this] {
      for (const Fate& fate : fates_) {
        if (!fate.ended()) return false;
      }
      return true;
    });
  }

  void WaitForProgress(int job) {
    std::unique_lock lock(mutex_);
    changed_.wait(lock, [&] { return fates_[static_cast<std::size_t>(job)].progress > 0; });
  }

  void SetObeyBy(absl::Time time) { obey_by_ = time; }

  Fate fate(int job) {
    const std::lock_guard lock(mutex_);
    return fates_[static_cast<std::size_t>(job)];
  }
  int taken() {
    const std::lock_guard lock(mutex_);
    return taken_;
  }
  std::shared_ptr<WorkerLink> link() {
    const std::lock_guard lock(mutex_);
    return link_;
  }

  Turn TakeNext(absl::Duration, JobAssignment* assignment) override {
    std::unique_lock lock(mutex_);
    if (taken_ == count_) return Turn::kOver;
    JobAssignment& job = *assignment;
    job.name = std::to_string(taken_++);
    job.attempt = 7;
    job.request.set_job(job.name);
    job.request.set_max_triangles(1);
    job.blobs = {*Blob::Copy("mesh")};
    changed_.notify_all();
    return Turn::kWork;
  }
  void SetLink(const std::string&, int attempt, std::shared_ptr<WorkerLink> link) override {
    EXPECT_EQ(attempt, 7);
    const std::lock_guard lock(mutex_);
    link_ = std::move(link);
  }
  void ReportProgress(const std::string& name, int, v1::Progress progress) override {
    const std::lock_guard lock(mutex_);
    Fate& fate = Find(name);
    EXPECT_EQ(progress.newton_iteration(), fate.progress + 1);
    fate.progress = progress.newton_iteration();
    changed_.notify_all();
  }
  void ReportResult(const std::string& name, int attempt, worker::v1::WorkResult result, BlobPtr uv) override {
    EXPECT_EQ(attempt, 7);
    const std::lock_guard lock(mutex_);
    Fate& fate = Find(name);
    EXPECT_FALSE(fate.ended());
    fate.has_result = true;
    fate.code = result.status().code();
    if (uv != nullptr) fate.uv = uv->bytes();
    link_ = nullptr;
    changed_.notify_all();
  }
  void ReportLost(const std::string& name, int attempt, WorkerLoss loss) override {
    EXPECT_EQ(attempt, 7);
    const std::lock_guard lock(mutex_);
    Fate& fate = Find(name);
    EXPECT_FALSE(fate.ended());
    fate.loss = std::move(loss);
    link_ = nullptr;
    changed_.notify_all();
  }
  absl::Time ObeyBy(const std::string&, int attempt) override {
    EXPECT_EQ(attempt, 7);
    return obey_by_;
  }

 private:
  Fate& Find(const std::string& name) { return fates_[static_cast<std::size_t>(std::stoi(name))]; }

  const int count_;
  std::atomic<absl::Time> obey_by_ = absl::InfiniteFuture();
  std::mutex mutex_;
  std::condition_variable changed_;
  // Guarded by mutex_.
  std::vector<Fate> fates_;
  int taken_ = 0;
  std::shared_ptr<WorkerLink> link_;
};

// Options that note the ends of workers.
class Ends {
 public:
  WorkerPoolOptions Options(int workers = 1) {
    WorkerPoolOptions options;
    options.workers = workers;
    options.look_interval = absl::Milliseconds(5);
    options.retry_min = absl::Milliseconds(1);
    options.on_worker_end = [this](const WorkerEnd& end) {
      const std::lock_guard lock(mutex_);
      causes_.push_back(NameOf(end.cause));
      jobs_.push_back(end.job);
    };
    return options;
  }
  std::vector<std::string> causes() {
    const std::lock_guard lock(mutex_);
    return causes_;
  }
  std::vector<std::string> jobs() {
    const std::lock_guard lock(mutex_);
    return jobs_;
  }

 private:
  std::mutex mutex_;
  std::vector<std::string> causes_, jobs_;
};

// Waits until the link is closed: a worker that hears nothing else.
void BeDeaf(ServerLink& server) {
  while (server.Receive().has_value()) {
  }
}

TEST(WorkerPool, ManyJobsOnTwoWorkers) {
  constexpr int kJobs = 20, kIterations = 50;
  std::atomic<int> at_work = 0, most = 0;
  const WorkerScript succeed = Succeed(kIterations, "uv");
  Jobs jobs(kJobs);
  Ends ends;
  {
    const WorkerPool pool(&jobs, ScriptedWorkers([&](ServerLink& server, const ServerLink::Received& job) {
      const int now = ++at_work;
      for (int seen = most; seen < now && !most.compare_exchange_weak(seen, now);) {
      }
      const bool lives = succeed(server, job);
      --at_work;
      return lives;
    }),
                          ends.Options(2));
    jobs.WaitForAll();
  }
  for (int i = 0; i < kJobs; ++i) {
    EXPECT_EQ(jobs.fate(i).progress, kIterations);
    EXPECT_EQ(jobs.fate(i).uv, "uv");
  }
  EXPECT_LE(most, 2);
  EXPECT_THAT(ends.causes(), ElementsAre("shutdown", "shutdown")) << "one worker for many jobs";
}

TEST(WorkerPool, WorkerThatDiesLosesItsJobOnly) {
  const WorkerScript succeed = Succeed(1, "uv");
  Jobs jobs(3);
  Ends ends;
  {
    const WorkerPool pool(&jobs, ScriptedWorkers([&](ServerLink& server, const ServerLink::Received& job) {
      return job.message.request().job() != "1" && succeed(server, job);
    }),
                          ends.Options());
    jobs.WaitForAll();
  }
  EXPECT_EQ(jobs.fate(0).uv, "uv");
  EXPECT_EQ(jobs.fate(1).loss->reason, "WORKER_CRASHED");
  EXPECT_EQ(jobs.fate(2).uv, "uv");
  EXPECT_THAT(ends.causes(), ElementsAre("crashed", "shutdown"));
  EXPECT_THAT(ends.jobs(), ElementsAre("1", ""));
}

TEST(WorkerPool, WorkerThatCannotStartCostsNoJob) {
  Jobs jobs(1);
  Ends ends;
  std::vector<absl::Duration> retries;
  int starts = 0;
  WorkerPoolOptions options = ends.Options();
  options.retry_max = absl::Milliseconds(3);
  options.on_start_failed = [&](const absl::Status& status, absl::Duration retry_in) {
    EXPECT_EQ(jobs.taken(), 0) << "no job is taken before there is a worker for it";
    EXPECT_THAT(std::string(status.message()), HasSubstr("no more processes"));
    retries.push_back(retry_in);
  };
  {
    const WorkerPool pool(
        &jobs,
        [&]() -> absl::StatusOr<std::shared_ptr<WorkerLink>> {
          if (++starts <= 4) return InternalError("no more processes");
          return ScriptedWorkers(Succeed(1, "uv"))();
        },
        options);
    jobs.WaitForAll();
  }
  EXPECT_EQ(jobs.fate(0).uv, "uv");
  EXPECT_THAT(retries,
              ElementsAre(absl::Milliseconds(1), absl::Milliseconds(2), absl::Milliseconds(3), absl::Milliseconds(3)));
}

TEST(WorkerPool, WorkerThatDoesNotGetReadyIsNotUsed) {
  Jobs jobs(1);
  Ends ends;
  WorkerPoolOptions options = ends.Options();
  options.start_limit = absl::Milliseconds(20);
  std::vector<std::string> errors;
  options.on_start_failed = [&](const absl::Status& status, absl::Duration) { errors.emplace_back(status.message()); };
  int starts = 0;
  {
    const WorkerPool pool(
        &jobs,
        [&] {
          ++starts;
          if (starts == 1) return StartInProcessWorker(BeDeaf);
          if (starts == 2) return StartInProcessWorker([](ServerLink&) {});
          if (starts == 3) return StartInProcessWorker([](ServerLink& server) { server.Send(ProgressMessage(1)); });
          return ScriptedWorkers(Succeed(1, "uv"))();
        },
        options);
    jobs.WaitForAll();
  }
  EXPECT_THAT(errors, ElementsAre(HasSubstr("did not become ready"), HasSubstr("ended right after"),
                                  HasSubstr("before it was idle")));
  EXPECT_EQ(jobs.fate(0).uv, "uv");
}

TEST(WorkerPool, NobodyWaitsForAWorkerWhenThePoolEnds) {
  Jobs jobs(0);
  Ends ends;
  Gate failed;
  WorkerPoolOptions options = ends.Options();
  options.retry_min = options.retry_max = absl::Hours(1);
  options.on_start_failed = [&](const absl::Status&, absl::Duration) { failed.Open(); };
  const WorkerPool pool(
      &jobs, []() -> absl::StatusOr<std::shared_ptr<WorkerLink>> { return InternalError("no"); }, options);
  failed.Wait();
}

TEST(WorkerPool, SilenceKills) {
  Jobs jobs(2);
  Ends ends;
  WorkerPoolOptions options = ends.Options();
  options.silence_limit = absl::Milliseconds(30);
  const WorkerScript succeed = Succeed(1, "uv");
  {
    const WorkerPool pool(&jobs, ScriptedWorkers([&](ServerLink& server, const ServerLink::Received& job) {
      if (job.message.request().job() != "0") return succeed(server, job);
      server.Send(ProgressMessage(1));
      BeDeaf(server);
      return false;
    }),
                          options);
    jobs.WaitForAll();
  }
  EXPECT_EQ(jobs.fate(0).loss->reason, "WORKER_HUNG");
  EXPECT_EQ(jobs.fate(0).loss->metadata.at("stage"), "SOLVE");
  EXPECT_GE(std::stod(jobs.fate(0).loss->metadata.at("seconds")), 0.03);
  EXPECT_THAT(jobs.fate(0).loss->message, HasSubstr("nothing was heard"));
  EXPECT_EQ(jobs.fate(1).uv, "uv");
  EXPECT_THAT(ends.causes(), ElementsAre("hung", "shutdown"));
}

TEST(WorkerPool, DecodingTooLongKillsHoweverMuchIsSaid) {
  Jobs jobs(1);
  Ends ends;
  WorkerPoolOptions options = ends.Options();
  options.decode_limit = absl::Milliseconds(30);
  {
    const WorkerPool pool(&jobs, ScriptedWorkers([&](ServerLink& server, const ServerLink::Received&) {
      for (int i = 1; ends.causes().empty(); ++i) {
        worker::v1::FromWorker message = ProgressMessage(i);
        message.mutable_event()->mutable_progress()->set_stage(v1::STAGE_DECODE);
        server.Send(message);
      }
      return false;
    }),
                          options);
    jobs.WaitForAll();
  }
  EXPECT_EQ(jobs.fate(0).loss->reason, "WORKER_HUNG");
  EXPECT_EQ(jobs.fate(0).loss->metadata.at("stage"), "DECODE");
}

TEST(WorkerPool, JobsHaveALimitOfTheirOwn) {
  Jobs jobs(1);
  Ends ends;
  WorkerPoolOptions options = ends.Options();
  options.job_limit = absl::Milliseconds(30);
  {
    const WorkerPool pool(&jobs, ScriptedWorkers([&](ServerLink& server, const ServerLink::Received&) {
      for (int i = 1; ends.causes().empty(); ++i) server.Send(ProgressMessage(i));
      return false;
    }),
                          options);
    jobs.WaitForAll();
  }
  EXPECT_THAT(jobs.fate(0).loss->message, HasSubstr("the job took too long"));
}

TEST(WorkerPool, WhoDoesNotObeyInTimeIsKilled) {
  Jobs jobs(2);
  Ends ends;
  const WorkerScript succeed = Succeed(1, "uv");
  {
    const WorkerPool pool(&jobs, ScriptedWorkers([&](ServerLink& server, const ServerLink::Received& job) {
      if (job.message.request().job() != "0") return succeed(server, job);
      server.Send(ProgressMessage(1));
      BeDeaf(server);
      return false;
    }),
                          ends.Options());
    jobs.WaitForProgress(0);
    EXPECT_FALSE(jobs.fate(0).ended());
    jobs.SetObeyBy(SteadyNow() + absl::Milliseconds(10));
    jobs.WaitForAll();
  }
  EXPECT_THAT(jobs.fate(0).loss->message, HasSubstr("told to"));
  EXPECT_THAT(ends.causes(), ::testing::Contains("disobedient"));
}

TEST(WorkerPool, LinkThatTheServerGivesUpLosesTheJob) {
  Jobs jobs(1);
  Ends ends;
  {
    const WorkerPool pool(&jobs, ScriptedWorkers([](ServerLink& server, const ServerLink::Received&) {
      server.Send(ProgressMessage(1));
      BeDeaf(server);
      return false;
    }),
                          ends.Options());
    jobs.WaitForProgress(0);
    jobs.link()->Close();
    jobs.WaitForAll();
  }
  EXPECT_EQ(jobs.fate(0).loss->reason, "WORKER_HUNG");
}

TEST(WorkerPool, WorkersAreReplacedAfterSomeJobs) {
  Jobs jobs(7);
  Ends ends;
  WorkerPoolOptions options = ends.Options();
  options.recycle_after = 3;
  {
    const WorkerPool pool(&jobs, ScriptedWorkers(Succeed(1, "uv")), options);
    jobs.WaitForAll();
  }
  EXPECT_THAT(ends.causes(), ElementsAre("recycled", "recycled", "shutdown"));
}

TEST(WorkerPool, WorkersThatGrowOrRanOutOfMemoryAreReplaced) {
  Jobs jobs(3);
  Ends ends;
  {
    const WorkerPool pool(
        &jobs,
        [] {
          return StartInProcessWorker([](ServerLink& server) {
            worker::v1::FromWorker idle = IdleMessage();
            server.Send(idle);
            while (const auto received = server.Receive()) {
              if (!received->message.has_request()) continue;
              const bool runs_out = received->message.request().job() == "0";
              server.Send(runs_out ? FailureMessage(absl::ResourceExhaustedError("memory")) : SuccessMessage(""));
              if (!runs_out) idle.mutable_idle()->set_held_bytes(std::int64_t{1} << 40);
              server.Send(idle);
            }
          });
        },
        ends.Options());
    jobs.WaitForAll();
  }
  EXPECT_EQ(jobs.fate(0).code, static_cast<int>(absl::StatusCode::kResourceExhausted));
  EXPECT_THAT(ends.causes(), ElementsAre("grown", "grown", "grown", "shutdown"));
}

TEST(WorkerPool, WorkersThatBreakTheProtocolAreReplaced) {
  Jobs jobs(3);
  Ends ends;
  {
    const WorkerPool pool(&jobs, ScriptedWorkers([](ServerLink& server, const ServerLink::Received& job) {
      if (job.message.request().job() == "0") {
        server.Send(IdleMessage());
      } else if (job.message.request().job() == "1") {
        const std::string uv(49, 'x');  // of one triangle: 48 at most
        server.Send(SuccessMessage(uv), *Blob::Copy(uv));
      } else {
        server.Send(SuccessMessage(""));
        server.Send(ProgressMessage(1));
      }
      return true;
    }),
                          ends.Options());
    jobs.WaitForAll();
  }
  EXPECT_THAT(jobs.fate(0).loss->message, HasSubstr("idle during a job"));
  EXPECT_EQ(jobs.fate(0).loss->reason, "INTERNAL");
  EXPECT_THAT(jobs.fate(1).loss->message, HasSubstr("more triangles"));
  EXPECT_TRUE(jobs.fate(2).has_result);
  EXPECT_THAT(ends.causes(), ElementsAre("crashed", "crashed", "crashed", "shutdown"));
}

TEST(WorkerPool, WorkerThatDiedWhileIdleCostsNoJob) {
  Jobs jobs(2);
  Ends ends;
  std::atomic<int> starts = 0;
  {
    const WorkerPool pool(
        &jobs,
        [&]() -> absl::StatusOr<std::shared_ptr<WorkerLink>> {
          if (++starts > 1) return ScriptedWorkers(Succeed(1, "uv"))();
          return StartInProcessWorker([](ServerLink& server) { server.Send(IdleMessage()); });
        },
        ends.Options());
    jobs.WaitForAll();
  }
  // Either it was seen to be dead before it got the job, or it got it and the job is lost: never both.
  EXPECT_EQ(jobs.fate(1).uv, "uv");
  EXPECT_EQ(ends.causes().front(), "crashed");
  EXPECT_EQ(jobs.fate(0).loss.has_value(), ends.jobs().front() == "0");
}

}  // namespace
}  // namespace planish
