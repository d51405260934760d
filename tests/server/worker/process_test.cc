// Workers in processes of their own: what they answer, and what becomes of the server when they die, hang, grow, or
// send what they should not.
#include <dirent.h>
#include <fcntl.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cerrno>
#include <condition_variable>
#include <cstdlib>
#include <deque>
#include <filesystem>
#include <map>
#include <mutex>

#include "absl/strings/match.h"
#include "absl/time/clock.h"
#include "core/base/error.h"
#include "core/base/sanitizers.h"
#include "core/draco/codec.h"
#include "gmock/gmock.h"
#include "google/rpc/error_details.pb.h"
#include "gtest/gtest.h"
#include "server/jobs/steady_clock.h"
#include "server/jobs/worker_pool.h"
#include "server/link/process_link.h"
#include "server/worker/work.h"
#include "tests/testing/files.h"
#include "tests/testing/meshes.h"

namespace planish {
namespace {

using ::testing::HasSubstr;
using ::testing::Pair;
using ::testing::UnorderedElementsAre;

constexpr std::int64_t kMiB = 1 << 20;

int OpenDescriptors() {
  DIR* const directory = opendir("/proc/self/fd");
  int count = 0;
  while (readdir(directory) != nullptr) ++count;
  closedir(directory);
  return count;
}

bool HasChildren() {
  return !(waitpid(-1, nullptr, WNOHANG) < 0 && errno == ECHILD);
}

google::rpc::ErrorInfo InfoOf(const worker::v1::WorkResult& result) {
  google::rpc::ErrorInfo info;
  if (result.status().details_size() > 0) result.status().details(0).UnpackTo(&info);
  return info;
}

// How a job ended.
struct Ending {
  std::optional<worker::v1::WorkResult> result;
  BlobPtr uv;
  std::optional<WorkerLoss> loss;
  int events = 0;
};

// Jobs of a test, which waits for each.
class TestSource : public JobSource {
 public:
  Ending Run(JobAssignment job) {
    std::unique_lock lock(mutex_);
    ending_ = {};
    obey_by_ = absl::InfiniteFuture();
    job.name = "jobs/" + std::to_string(++number_);
    name_ = job.name;
    jobs_.push_back(std::move(job));
    changed_.notify_all();
    changed_.wait(lock, [this] { return ending_.result.has_value() || ending_.loss.has_value(); });
    return std::exchange(ending_, {});
  }

  void Stop() {
    const std::lock_guard lock(mutex_);
    stopped_ = true;
    changed_.notify_all();
  }

  // Sends it at the first event of a job, and kills the worker that does not obey within `patience`.
  void CancelAtFirstEvent(absl::Duration patience) {
    const std::lock_guard lock(mutex_);
    cancel_patience_ = patience;
  }

  Turn TakeNext(absl::Duration patience, JobAssignment* assignment) override {
    std::unique_lock lock(mutex_);
    const bool woken =
        changed_.wait_for(lock, absl::ToChronoNanoseconds(patience), [this] { return stopped_ || !jobs_.empty(); });
    if (!woken) return Turn::kNothing;
    if (jobs_.empty()) return Turn::kOver;
    *assignment = std::move(jobs_.front());
    jobs_.pop_front();
    return Turn::kWork;
  }
  void SetLink(const std::string&, int, std::shared_ptr<WorkerLink> link) override {
    const std::lock_guard lock(mutex_);
    link_ = std::move(link);
  }
  void ReportProgress(const std::string&, int, v1::Progress) override {
    const std::lock_guard lock(mutex_);
    ++ending_.events;
    if (cancel_patience_ == absl::InfiniteDuration() || obey_by_ != absl::InfiniteFuture()) return;
    obey_by_ = SteadyNow() + cancel_patience_;
    worker::v1::ToWorker cancel;
    cancel.mutable_cancel();
    link_->Send(cancel);
  }
  void ReportResult(const std::string& name, int, worker::v1::WorkResult result, BlobPtr uv) override {
    const std::lock_guard lock(mutex_);
    EXPECT_EQ(name, name_);
    link_ = nullptr;
    ending_.result = std::move(result);
    ending_.uv = std::move(uv);
    changed_.notify_all();
  }
  void ReportLost(const std::string& name, int, WorkerLoss loss) override {
    const std::lock_guard lock(mutex_);
    EXPECT_EQ(name, name_);
    link_ = nullptr;
    ending_.loss = std::move(loss);
    changed_.notify_all();
  }
  absl::Time ObeyBy(const std::string&, int) override {
    const std::lock_guard lock(mutex_);
    return obey_by_;
  }

 private:
  std::mutex mutex_;
  std::condition_variable changed_;
  // Guarded by mutex_.
  std::deque<JobAssignment> jobs_;
  std::string name_;
  int number_ = 0;
  bool stopped_ = false;
  std::shared_ptr<WorkerLink> link_;
  Ending ending_;
  absl::Duration cancel_patience_ = absl::InfiniteDuration();
  absl::Time obey_by_ = absl::InfiniteFuture();
};

JobAssignment AssignmentOf(const Mesh& mesh, const std::string& failpoint = "") {
  JobAssignment job;
  job.request.set_failpoint(failpoint);
  job.blobs = {*Blob::Copy(*EncodeDraco(mesh))};
  return job;
}

std::string InProcess(const JobAssignment& job) {
  return std::string(DoWork(job.request, job.blobs, {}).uv->bytes());
}

// One worker process, whose jobs may fail on demand.
class WorkerProcess : public ::testing::Test {
 protected:
  WorkerProcess() {
    descriptors_ = OpenDescriptors();
    process_.failpoints = true;
    options_.decode_limit = options_.silence_limit = absl::Seconds(100);
    options_.look_interval = absl::Milliseconds(20);
    options_.on_worker_ready = [this](const worker::v1::WorkerIdle& idle) {
      const std::lock_guard lock(mutex_);
      ++starts_;
      idle_ = idle;
    };
    options_.on_worker_end = [this](const WorkerEnd& end) {
      const std::lock_guard lock(mutex_);
      ++ends_[NameOf(end.cause)];
    };
    options_.on_start_failed = [this](const absl::Status& status, absl::Duration) {
      const std::lock_guard lock(mutex_);
      start_error_ = std::string(status.message());
      if (stop_when_start_fails_) source_.Stop();
    };
  }

  // For hangs on purpose.
  void BeImpatient() {
    options_.decode_limit = absl::Milliseconds(kSanitized ? 3000 : 700);
    options_.silence_limit = absl::Milliseconds(kSanitized ? 4000 : 1000);
  }

  void TearDown() override {
    StopPool();
    EXPECT_FALSE(HasChildren()) << "a process that nobody waited for";
    EXPECT_EQ(OpenDescriptors(), descriptors_);
  }

  void StartPool() {
    pool_ = std::make_unique<WorkerPool>(
        &source_, [process = process_] { return StartProcessWorker(process); }, options_);
  }

  void StopPool() {
    source_.Stop();
    pool_ = nullptr;
  }

  Ending Run(const JobAssignment& job) {
    if (pool_ == nullptr) StartPool();
    return source_.Run(job);
  }

  void ExpectSuccess(const JobAssignment& job) {
    const Ending ending = Run(job);
    ASSERT_TRUE(ending.result.has_value()) << ending.loss->message;
    ASSERT_EQ(ending.result->status().code(), 0) << ending.result->status().message();
    EXPECT_EQ(ending.uv->bytes(), InProcess(job));
  }

  std::map<std::string, int> ends() {
    const std::lock_guard lock(mutex_);
    return ends_;
  }

  WorkerProcessOptions process_;
  WorkerPoolOptions options_;
  TestSource source_;
  std::unique_ptr<WorkerPool> pool_;
  int descriptors_ = 0;

  std::mutex mutex_;
  // Guarded by mutex_.
  int starts_ = 0;
  worker::v1::WorkerIdle idle_;
  std::map<std::string, int> ends_;
  std::string start_error_;
  bool stop_when_start_fails_ = false;
};

TEST_F(WorkerProcess, GivesTheSameBytesAsThisProcessJobAfterJob) {
  for (const int n : {12, 5, 22, 40, 12}) {
    JobAssignment job = AssignmentOf(Bump(n));
    job.request.set_max_threads(2);
    ExpectSuccess(job);
  }
  for (const v1::Solver solver : {v1::SOLVER_UZAWA, v1::SOLVER_MINRES, v1::SOLVER_DIRECT}) {
    JobAssignment job = AssignmentOf(Bump(30));
    job.request.mutable_options()->set_solver(solver);
    job.request.mutable_options()->set_precision(v1::PRECISION_DOUBLE);
    ExpectSuccess(job);
  }
  const std::lock_guard lock(mutex_);
  EXPECT_EQ(starts_, 1) << "one process for all";
}

TEST_F(WorkerProcess, ReportsThePeakOfEachJob) {
  const auto peak = [&](int n) { return Run(AssignmentOf(Bump(n))).result->report().peak_memory_bytes(); };
  const std::int64_t small = peak(4), large = peak(150), small_again = peak(4);
  EXPECT_GT(large, small + 20 * kMiB);
  // The heap of the address sanitizer keeps what was freed last, up to 256 MB of it.
  if (!kSanitized) {
    EXPECT_GT(large, small_again + 20 * kMiB);
  }
}

TEST_F(WorkerProcess, MayDoNothingButItsWork) {
  if (kSanitized) GTEST_SKIP() << "no sandbox with sanitizers";
  setenv("PLANISHD_TOKEN", "secret", 1);
  process_.sandbox = SandboxMode::kRequire;
  const Ending ending = Run(AssignmentOf(Bump(4), "solve=probe"));
  ASSERT_TRUE(ending.result.has_value()) << ending.loss->message;
  const google::rpc::ErrorInfo info = InfoOf(*ending.result);
  EXPECT_EQ(info.reason(), "PROBE");
  EXPECT_THAT(info.metadata(),
              UnorderedElementsAre(Pair("open", "EPERM"), Pair("create", "EPERM"), Pair("socket", "EPERM"),
                                   Pair("unix_socket", "EPERM"), Pair("execve", "EPERM"), Pair("fork", "EPERM"),
                                   Pair("fcntl", "EPERM"), Pair("environment", "0"), Pair("kill", "EPERM"),
                                   Pair("ptrace", "EPERM"), Pair("executable_memory", "EPERM"),
                                   Pair("thread", "allowed"), Pair("core_limit", "0"), Pair("descriptor_limit", "64"),
                                   Pair("no_new_privileges", "EPERM")));
  unsetenv("PLANISHD_TOKEN");
  const std::lock_guard lock(mutex_);
  EXPECT_TRUE(idle_.sandboxed());
}

// Issue 26: workers inherited the server's whole environment, tokens included.
TEST(WorkerEnvironment, HasWhatLibrariesNeedAndNoSecrets) {
  for (const char* name : {"LD_LIBRARY_PATH", "OMP_NUM_THREADS", "LC_ALL", "GLIBC_TUNABLES", "ASAN_OPTIONS"}) {
    EXPECT_TRUE(IsForWorkers(name)) << name;
  }
  for (const char* name : {"PLANISHD_TOKEN", "PLANISH_TOKEN", "AWS_SECRET_ACCESS_KEY", "PGPASSWORD", "HOME", ""}) {
    EXPECT_FALSE(IsForWorkers(name)) << name;
  }
}

TEST_F(WorkerProcess, WithoutASandboxTheProbeFindsDoorsOpen) {
  process_.sandbox = SandboxMode::kOff;
  const google::rpc::ErrorInfo info = InfoOf(*Run(AssignmentOf(Bump(4), "start=probe")).result);
  EXPECT_EQ(info.metadata().at("open"), "allowed");
  EXPECT_EQ(info.metadata().at("execve"), "allowed");
  EXPECT_EQ(info.metadata().at("fcntl"), "allowed");
  EXPECT_EQ(info.metadata().at("no_new_privileges"), "1");
  EXPECT_EQ(info.metadata().at("core_limit"), "0");
  const std::lock_guard lock(mutex_);
  EXPECT_FALSE(idle_.sandboxed());
  EXPECT_EQ(idle_.sandbox_error(), "") << "nobody asked for one";
}

TEST_F(WorkerProcess, MemoryLimitEndsOneJobByName) {
  if (kSanitized) GTEST_SKIP() << "no memory limit with sanitizers";
  JobAssignment job = AssignmentOf(Bump(120));  // 28,800 triangles, which take about 24 MiB
  // Wherever it strikes: in the decoder, in the first stages, in the solver.
  for (const std::int64_t mib : {1, 2, 3, 5, 8}) {
    job.request.set_max_threads(mib == 1 ? 2 : 1);
    job.request.set_memory_bytes(mib * kMiB);
    const Ending ending = Run(job);
    ASSERT_TRUE(ending.result.has_value()) << mib << " MiB: " << ending.loss->message;
    EXPECT_EQ(InfoOf(*ending.result).reason(), "OUT_OF_MEMORY") << mib << " MiB: " << ending.result->status().message();
  }
  job.request.set_max_threads(1);
  job.request.set_memory_bytes(100 * kMiB);
  ExpectSuccess(job);
}

// Free memory at the end of the heap, which earlier jobs left there, neither adds to the next job's limit nor counts
// towards it.
TEST_F(WorkerProcess, MemoryLimitIsThatOfTheJobWhateverRanBefore) {
  if (kSanitized) GTEST_SKIP() << "no memory limit with sanitizers";
  const auto run = [this](const Mesh& mesh, std::int64_t mib) {
    JobAssignment job = AssignmentOf(mesh);
    job.request.set_max_threads(1);
    job.request.set_expected_bytes(mib * kMiB);
    job.request.set_memory_bytes(mib * kMiB);
    return Run(job);
  };
  for (int again = 0; again < 3; ++again) {
    ASSERT_TRUE(run(Bump(120), 100).result->has_report());
    const Ending small = run(Bump(8), 8);
    ASSERT_TRUE(small.result.has_value()) << small.loss->message;
    EXPECT_TRUE(small.result->has_report()) << small.result->status().message();
  }
  {
    const std::lock_guard lock(mutex_);
    EXPECT_EQ(starts_, 1) << "all in one process";
  }
  const Ending starved = run(Bump(300), 40);  // 180,000 triangles, which take about 140 MiB
  ASSERT_TRUE(starved.result.has_value()) << starved.loss->message;
  EXPECT_EQ(InfoOf(*starved.result).reason(), "OUT_OF_MEMORY") << starved.result->status().message();
}

TEST_F(WorkerProcess, MemoryThatRunsOutOnAnotherThreadHasTheSameName) {
  if (kSanitized) GTEST_SKIP() << "no memory limit with sanitizers";
  JobAssignment job = AssignmentOf(Bump(8), "solve=oom-thread");
  job.request.set_memory_bytes(100 * kMiB);
  const Ending ending = Run(job);
  ASSERT_TRUE(ending.result.has_value()) << ending.loss->message;
  EXPECT_EQ(InfoOf(*ending.result).reason(), "OUT_OF_MEMORY");
  ExpectSuccess(AssignmentOf(Bump(8)));
}

TEST_F(WorkerProcess, DeafToCancellationIsKilledWhenPatienceEnds) {
  source_.CancelAtFirstEvent(absl::Milliseconds(200));
  const Ending ending = Run(AssignmentOf(Bump(8), "decode=hang"));
  ASSERT_TRUE(ending.loss.has_value());
  EXPECT_EQ(ending.loss->reason, "WORKER_HUNG");
  EXPECT_THAT(ending.loss->message, HasSubstr("told to"));
  EXPECT_EQ(ends()["disobedient"], 1);
}

TEST_F(WorkerProcess, CancelledJobCostsNoWorker) {
  source_.CancelAtFirstEvent(absl::Seconds(20));
  const Ending ending = Run(AssignmentOf(Bump(120)));
  ASSERT_TRUE(ending.result.has_value()) << ending.loss->message;
  EXPECT_EQ(ending.result->status().code(), static_cast<int>(absl::StatusCode::kCancelled));
  source_.CancelAtFirstEvent(absl::InfiniteDuration());
  ExpectSuccess(AssignmentOf(Bump(8)));
  EXPECT_EQ(ends().size(), 0u);
}

TEST_F(WorkerProcess, RecycledAfterSomeJobs) {
  options_.recycle_after = 2;
  for (int i = 0; i < 5; ++i) ExpectSuccess(AssignmentOf(Bump(4)));
  EXPECT_EQ(ends()["recycled"], 2);
  const std::lock_guard lock(mutex_);
  EXPECT_EQ(starts_, 3);
}

TEST_F(WorkerProcess, RecycledWhenItHasGrown) {
  options_.recycle_bytes = 1;
  ExpectSuccess(AssignmentOf(Bump(4)));
  ExpectSuccess(AssignmentOf(Bump(4)));
  EXPECT_GE(ends()["grown"], 1);
}

TEST_F(WorkerProcess, ThatCannotStartIsTriedAgainAndSaysWhy) {
  process_.program = "/nonexistent";
  options_.retry_min = absl::Milliseconds(1);
  stop_when_start_fails_ = true;
  StartPool();
  StopPool();
  const std::lock_guard lock(mutex_);
  EXPECT_THAT(start_error_, HasSubstr("/nonexistent"));
}

TEST_F(WorkerProcess, ThatEndsAtOnceSaysHow) {
  process_.program = "/bin/false";
  stop_when_start_fails_ = true;
  StartPool();
  StopPool();
  const std::lock_guard lock(mutex_);
  EXPECT_THAT(start_error_, HasSubstr("exited with code 1"));
}

// A worker's program that is a shell script.
std::string Script(const TempDir& directory, const std::string& body) {
  const std::string path = directory.Path("worker");
  PutFile(path, "#!/bin/sh\n" + body);
  std::filesystem::permissions(path, std::filesystem::perms::owner_all);
  return path;
}

// Issue 26: nobody learned why workers did not start, and callers waited for ever.
TEST_F(WorkerProcess, LastWordsOfWorkersThatNeverGetReady) {
  const TempDir directory;
  process_.program = Script(directory, "echo 'worker: cannot load libdraco.so' >&2\nexit 127\n");
  options_.retry_min = absl::Milliseconds(1);
  options_.first_starts = 1;  // the pool ends at once
  std::vector<std::string> said;
  options_.on_none_ready = [&](const absl::Status& status) {
    said.emplace_back(status.message());
    source_.Stop();
  };
  StartPool();
  StopPool();
  ASSERT_EQ(said.size(), 1u);
  EXPECT_THAT(said[0], ::testing::AllOf(HasSubstr("exited with code 127"), HasSubstr("cannot load libdraco.so")));
}

TEST_F(WorkerProcess, LastWordsOfWorkersThatHangAtTheStart) {
  const TempDir directory;
  process_.program = Script(directory, "echo 'I wait' >&2\nexec sleep 1000\n");
  options_.first_limit = absl::Milliseconds(500);
  std::vector<std::string> said;
  options_.on_none_ready = [&](const absl::Status& status) {
    said.emplace_back(status.message());
    source_.Stop();
  };
  StartPool();
  StopPool();
  ASSERT_EQ(said.size(), 1u);
  EXPECT_THAT(said[0], ::testing::AllOf(HasSubstr("did not become ready"), HasSubstr("I wait")));
}

TEST_F(WorkerProcess, SpeaksWhereItIsTold) {
  int ends[2];
  ASSERT_EQ(pipe2(ends, O_CLOEXEC), 0);
  process_.program = "/bin/ls";  // does not know the flags of workers, and says so
  process_.stderr_fd = ends[1];
  stop_when_start_fails_ = true;
  StartPool();
  StopPool();
  close(ends[1]);
  char said[256] = {};
  EXPECT_GT(read(ends[0], said, sizeof said - 1), 0);
  EXPECT_THAT(said, HasSubstr("--worker-fd"));
  close(ends[0]);
}

// Every fault at every point: the job is lost or fails with the fault's name, and the next one succeeds.
struct Fault {
  const char* action;
  const char* reason;  // of the loss; OUT_OF_MEMORY: of the result
  const char* key;
  const char* value;
};

void PrintTo(const Fault& fault, std::ostream* out) {
  *out << fault.action;
}

class WorkerFault : public WorkerProcess, public ::testing::WithParamInterface<Fault> {};

TEST_P(WorkerFault, CostsOneJob) {
  const Fault& fault = GetParam();
  if (kSanitized && std::string(fault.action) == "oom") GTEST_SKIP() << "no memory limit with sanitizers";
  if (std::string(fault.reason) == "WORKER_HUNG") BeImpatient();
  const bool asan_catches = kSanitized && std::string(fault.action) == "segv";
  for (const std::string point : {"start", "decode", "solve", "encode", "result"}) {
    JobAssignment job = AssignmentOf(Bump(8), point + "=" + fault.action);
    job.request.set_memory_bytes(200 * kMiB);
    const Ending ending = Run(job);
    SCOPED_TRACE(point);
    if (std::string(fault.reason) == "OUT_OF_MEMORY") {
      ASSERT_TRUE(ending.result.has_value()) << ending.loss->message;
      EXPECT_EQ(InfoOf(*ending.result).reason(), "OUT_OF_MEMORY");
    } else {
      ASSERT_TRUE(ending.loss.has_value());
      EXPECT_EQ(ending.loss->reason, fault.reason) << ending.loss->message;
      if (fault.key != nullptr && !asan_catches) {
        ASSERT_EQ(ending.loss->metadata.count(fault.key), 1u) << ending.loss->message;
        EXPECT_EQ(ending.loss->metadata.at(fault.key), fault.value) << ending.loss->message;
      }
    }
    ExpectSuccess(AssignmentOf(Bump(8)));
  }
}

INSTANTIATE_TEST_SUITE_P(All, WorkerFault,
                         ::testing::Values(Fault{"abort", "WORKER_CRASHED", "signal", "SIGABRT"},
                                           Fault{"segv", "WORKER_CRASHED", "signal", "SIGSEGV"},
                                           Fault{"exit", "WORKER_CRASHED", "exit_code", "42"},
                                           Fault{"hang", "WORKER_HUNG", nullptr, nullptr},
                                           Fault{"spin", "WORKER_HUNG", nullptr, nullptr},
                                           Fault{"oom", "OUT_OF_MEMORY", nullptr, nullptr},
                                           Fault{"garbage", "INTERNAL", nullptr, nullptr},
                                           Fault{"mute", "WORKER_CRASHED", "exit_code", "0"}),
                         [](const auto& param) { return std::string(param.param.action); });

TEST_F(WorkerProcess, HangsAreNamedByStage) {
  BeImpatient();
  for (const auto& [point, stage] :
       std::map<std::string, std::string>{{"start", "START"}, {"decode", "DECODE"}, {"encode", "ENCODE"}}) {
    const Ending ending = Run(AssignmentOf(Bump(8), point + "=hang"));
    ASSERT_TRUE(ending.loss.has_value());
    EXPECT_EQ(ending.loss->metadata.at("stage"), stage);
    EXPECT_GE(std::stod(ending.loss->metadata.at("seconds")), 0.5);
  }
  EXPECT_EQ(ends()["hung"], 3);
}

TEST_F(WorkerProcess, FaultsBetweenJobsCostNone) {
  options_.start_limit = absl::Seconds(kSanitized ? 20 : 3);
  for (const char* action : {"abort", "exit", "hang", "garbage", "mute"}) {
    const Ending ending = Run(AssignmentOf(Bump(8), std::string("idle=") + action));
    ASSERT_TRUE(ending.result.has_value()) << action;
    EXPECT_EQ(ending.result->status().code(), 0);
    ExpectSuccess(AssignmentOf(Bump(8)));
  }
  EXPECT_EQ(ends()["crashed"], 4);
  EXPECT_EQ(ends()["hung"], 1);
}

TEST_F(WorkerProcess, WithoutTheSwitchFailpointsAreIgnored) {
  process_.failpoints = false;
  ExpectSuccess(AssignmentOf(Bump(8), "solve=abort"));
}

}  // namespace
}  // namespace planish
