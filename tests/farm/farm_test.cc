// Several planishd over one PostgreSQL, behind HAProxy: what dies, and what callers see of it.
#include <unistd.h>

#include <csignal>
#include <cstdint>
#include <fstream>
#include <map>
#include <memory>
#include <mutex>
#include <string>
#include <vector>

#include "core/base/sanitizers.h"
#include "gmock/gmock.h"
#include "gtest/gtest.h"
#include "planish/client.h"
#include "tests/server/store/postgres_server.h"
#include "tests/testing/daemon.h"
#include "tests/testing/files.h"
#include "tests/testing/meshes.h"
#include "tests/testing/process.h"

namespace planish {
namespace {

using ::testing::HasSubstr;

constexpr char kHaproxy[] = "/usr/sbin/haproxy";

// Seconds that a worker which is gone keeps its job.
constexpr char kLease[] = "--lease=2";

// A bump over a grid of n x n squares.
struct Arrays {
  explicit Arrays(int n) {
    const Mesh mesh = Bump(n);
    for (const Vec3& point : mesh.positions) positions.insert(positions.end(), {point[0], point[1], point[2]});
    for (const Face& face : mesh.faces) {
      for (const auto vertex : face) triangles.push_back(static_cast<std::uint32_t>(vertex));
    }
  }
  MeshView View() const { return MeshView(positions, triangles); }

  std::vector<double> positions;
  std::vector<std::uint32_t> triangles;
};

class FarmTest : public ::testing::Test {
 protected:
  static void SetUpTestSuite() { postgres_ = std::make_unique<PostgresServer>(); }
  static void TearDownTestSuite() { postgres_ = nullptr; }

  FarmTest() : url_(postgres_->NewDatabase()) {}

  std::string SocketOf(const std::string& name) const { return dir_.Path(name + ".sock"); }

  // Also in the place of one that ended.
  Daemon& StartFront(const std::string& name) {
    return Start(name, {"--role=front", "--listen=unix:" + SocketOf(name)});
  }
  Daemon& StartWorker(const std::string& name, int workers = 1) {
    return Start(name, {"--role=worker", "--workers=" + std::to_string(workers), "--threads=1"});
  }
  Daemon& Start(const std::string& name, std::vector<std::string> flags) {
    flags.insert(flags.end(), {"--store=" + url_, kLease, "--reattach-grace=20"});
    std::unique_ptr<Daemon>& daemon = daemons_[name];
    daemon = std::make_unique<Daemon>(std::move(flags), true);
    EXPECT_TRUE(daemon->WaitReady()) << name << ": " << daemon->Output();
    return *daemon;
  }

  // One address for the fronts: calls go to any that is there. False where there is no HAProxy.
  bool StartProxy(const std::vector<std::string>& fronts) {
    if (access(kHaproxy, X_OK) != 0) return false;
    std::ofstream file(dir_.Path("haproxy.cfg"));
    file << "global\n  maxconn 200\ndefaults\n  mode http\n  timeout connect 2s\n  timeout client 1h\n"
         << "  timeout server 1h\n  option redispatch\n  retry-on conn-failure\n  retries 3\n"
         << "frontend all\n  bind unix@" << SocketOf("proxy") << " proto h2\n  default_backend fronts\n"
         << "backend fronts\n  balance roundrobin\n";
    for (const std::string& front : fronts) {
      file << "  server " << front << " unix@" << SocketOf(front) << " proto h2 check inter 200ms fall 1 rise 1\n";
    }
    file.close();
    proxy_ = std::make_unique<Process>(std::vector<std::string>{kHaproxy, "-db", "-f", dir_.Path("haproxy.cfg")});
    return WaitUntil([&] { return access(SocketOf("proxy").c_str(), F_OK) == 0; });
  }

  Client ClientOf(const std::string& name) const {
    ClientOptions options;
    options.reattach_seconds = 60;
    return Client("unix:" + SocketOf(name), options);
  }

  // With a mesh of 45,000 triangles: minutes of work.
  static UnwrapOptions Slowly() {
    UnwrapOptions options;
    options.solver = Solver::kMinres;
    options.system = System::kFull;
    options.preconditioner = Preconditioner::kNone;
    return options;
  }

  TempDir dir_;
  std::string url_;
  const Arrays quick_{40}, slow_{150};
  std::map<std::string, std::unique_ptr<Daemon>> daemons_;
  std::unique_ptr<Process> proxy_;
  static inline std::unique_ptr<PostgresServer> postgres_;
};

// What a caller hears of one job. Thread-safe.
class Heard {
 public:
  Callbacks Listen() {
    Callbacks callbacks;
    callbacks.on_event = [this](const Event& event) {
      const std::lock_guard lock(mutex_);
      in_order_ &= event.sequence > last_;
      skipped_ += event.skipped;
      last_ = event.sequence;
      times_.push_back(Now());
      if (event.job.has_value() && event.job->end_time.has_value()) ++ends_;
    };
    return callbacks;
  }
  // Events so far; whether none came twice; how many were left out; terminal states among them.
  std::size_t count() const {
    const std::lock_guard lock(mutex_);
    return times_.size();
  }
  bool in_order() const {
    const std::lock_guard lock(mutex_);
    return in_order_;
  }
  std::int64_t skipped() const {
    const std::lock_guard lock(mutex_);
    return skipped_;
  }
  int ends() const {
    const std::lock_guard lock(mutex_);
    return ends_;
  }
  // From `time` to the first event after it.
  double Silence(double time) const {
    const std::lock_guard lock(mutex_);
    for (const double heard : times_) {
      if (heard > time) return heard - time;
    }
    return 1e9;
  }

 private:
  mutable std::mutex mutex_;
  std::int64_t last_ = 0, skipped_ = 0;
  bool in_order_ = true;
  int ends_ = 0;
  std::vector<double> times_;
};

TEST_F(FarmTest, AJobOfOneFrontIsSeenAtAnother) {
  StartWorker("w");
  StartFront("a");
  StartFront("b");
  Client a = ClientOf("a"), b = ClientOf("b");
  const Job job = a.CreateJob(quick_.View());
  Heard heard;
  const UnwrapResult result = b.AttachResult(job.name, quick_.View(), heard.Listen());
  EXPECT_TRUE(heard.in_order());
  EXPECT_EQ(heard.skipped(), 0);
  EXPECT_EQ(heard.ends(), 1);
  EXPECT_EQ(result.uv.AsDouble().size(), 2 * quick_.triangles.size());
  // The result is the farm's.
  Heard again;
  EXPECT_EQ(a.Unwrap(quick_.View(), {}, again.Listen()).uv.AsDouble(), result.uv.AsDouble());
  EXPECT_EQ(b.ListJobs().size(), 2u);
  EXPECT_EQ(b.GetCapabilities().workers, 1) << "of all servers";
}

TEST_F(FarmTest, JobsOfTwoFrontsShareTheirWork) {
  StartFront("a");
  StartFront("b");
  Client a = ClientOf("a"), b = ClientOf("b");
  const Job first = a.CreateJob(quick_.View()), second = b.CreateJob(quick_.View());
  EXPECT_EQ(second.result_of, first.name);
  StartWorker("w");
  EXPECT_EQ(a.WaitJob(second.name, 60).state, JobState::kSucceeded);
  EXPECT_EQ(b.WaitJob(first.name, 60).state, JobState::kSucceeded);
}

TEST_F(FarmTest, AFrontThatIsKilledCostsItsCallersASecondOrTwo) {
  StartFront("a");
  StartFront("b");
  if (!StartProxy({"a", "b"})) GTEST_SKIP() << "there is no " << kHaproxy;
  StartWorker("w");
  Client client = ClientOf("proxy");
  Heard heard;
  Call call = client.StartUnwrap(slow_.View(), Slowly(), heard.Listen());
  ASSERT_TRUE(WaitUntil([&] { return heard.count() > 3; }));
  // The log of the front that has the call says so.
  const std::string has = daemons_["a"]->Output().find(call.job()) != std::string::npos ? "a" : "b";
  const double killed = Now();
  daemons_[has]->Signal(SIGKILL);
  daemons_[has]->Wait();
  EXPECT_TRUE(WaitUntil([&] { return heard.Silence(killed) < 1e9; }));
  EXPECT_LT(heard.Silence(killed), kSanitized ? 10 : 2);
  call.Stop();
  const UnwrapResult result = call.Wait();
  EXPECT_TRUE(heard.in_order());
  EXPECT_EQ(heard.skipped(), 0);
  EXPECT_EQ(heard.ends(), 1);
  EXPECT_EQ(result.uv.AsDouble().size(), 2 * slow_.triangles.size());
}

TEST_F(FarmTest, AWorkerThatDiesOrSleepsLosesItsJobToAnother) {
  StartFront("a");
  Daemon& first = StartWorker("first");
  Client client = ClientOf("a");
  Heard heard;
  Call call = client.StartUnwrap(slow_.View(), Slowly(), heard.Listen());
  ASSERT_TRUE(WaitUntil([&] { return heard.count() > 3; }));
  first.Signal(SIGKILL);
  StartWorker("second");
  ASSERT_TRUE(WaitUntil([&] { return client.GetJob(call.job()).attempts == 2; }));
  // It does not renew its lease, and when it goes on somebody else has the job.
  daemons_["second"]->Signal(SIGSTOP);
  StartWorker("third");
  ASSERT_TRUE(WaitUntil([&] { return client.GetJob(call.job()).attempts == 3; }));
  daemons_["second"]->Signal(SIGCONT);
  const std::size_t before = heard.count();
  ASSERT_TRUE(WaitUntil([&] { return heard.count() > before + 5; })) << "the third one goes on with it";
  EXPECT_EQ(client.GetJob(call.job()).attempts, 3);
  call.Stop();
  call.Wait();
  EXPECT_TRUE(heard.in_order()) << "numbers that a lost attempt may have told are left out";
  EXPECT_EQ(heard.ends(), 1);
  EXPECT_EQ(client.GetJob(call.job()).state, JobState::kSucceeded);
}

TEST_F(FarmTest, NothingIsLostWithTheDatabasesProcesses) {
  StartFront("a");
  StartWorker("w", 2);
  Client client = ClientOf("a");
  Heard heard;
  Call running = client.StartUnwrap(slow_.View(), Slowly(), heard.Listen());
  ASSERT_TRUE(WaitUntil([&] { return heard.count() > 3; }));
  std::vector<std::string> jobs;
  CallOptions fresh;
  fresh.scheduling.fresh = true;
  for (int i = 0; i < 8; ++i) jobs.push_back(client.CreateJob(quick_.View(), {}, fresh).name);
  postgres_->Crash();
  usleep(300'000);
  postgres_->Start();
  for (const std::string& job : jobs) EXPECT_EQ(client.WaitJob(job, 60).state, JobState::kSucceeded) << job;
  running.Stop();
  running.Wait();
  EXPECT_TRUE(heard.in_order());
  EXPECT_EQ(heard.skipped(), 0);
  EXPECT_EQ(heard.ends(), 1);
}

TEST_F(FarmTest, AServerThatEndsInOrderLeavesItsJobToAnother) {
  StartFront("a");
  StartWorker("first");
  Client client = ClientOf("a");
  Heard heard;
  Call call = client.StartUnwrap(slow_.View(), Slowly(), heard.Listen());
  ASSERT_TRUE(WaitUntil([&] { return heard.count() > 3; }));
  StartWorker("second");
  daemons_["first"]->CloseSupervisor();
  EXPECT_EQ(daemons_["first"]->Wait(), 0) << daemons_["first"]->Output();
  ASSERT_TRUE(WaitUntil([&] { return client.GetJob(call.job()).state == JobState::kRunning; }));
  // So does a front: its callers go on at the next one.
  const double begin = Now();
  daemons_["a"]->CloseSupervisor();
  EXPECT_EQ(daemons_["a"]->Wait(), 0) << daemons_["a"]->Output();
  StartFront("a");
  EXPECT_TRUE(WaitUntil([&] { return heard.Silence(begin) < 1e9; }));
  call.Stop();
  call.Wait();
  EXPECT_TRUE(heard.in_order());
  EXPECT_EQ(heard.skipped(), 0);
  EXPECT_EQ(heard.ends(), 1);
}

// A standby takes over; the old primary, which would still take writes, is not used when it is back.
TEST_F(FarmTest, AStandbyThatIsPromotedGoesOn) {
  PostgresServer standby(*postgres_);
  const std::string database = url_.substr(0, url_.find('?'));
  url_ = database + "?host=" + postgres_->host() + "," + standby.host() + "&target_session_attrs=read-write";
  StartFront("a");
  StartWorker("w");
  Client client = ClientOf("a");
  Heard heard;
  Call call = client.StartUnwrap(slow_.View(), Slowly(), heard.Listen());
  ASSERT_TRUE(WaitUntil([&] { return heard.count() > 3; }));
  EXPECT_THAT(daemons_["a"]->Output(), HasSubstr("asynchronous")) << "it warns of what may be lost";
  usleep(500'000);  // the standby has it all by then
  postgres_->Crash();
  standby.Promote();
  const double promoted = Now();
  ASSERT_TRUE(WaitUntil([&] { return heard.Silence(promoted) < 1e9; }));
  postgres_->Start();
  CallOptions fresh;
  fresh.scheduling.fresh = true;
  for (int i = 0; i < 5; ++i)
    EXPECT_EQ(client.Unwrap(quick_.View(), {}, {}, fresh).uv.AsDouble().size(), 2 * quick_.triangles.size());
  call.Stop();
  call.Wait();
  EXPECT_EQ(heard.ends(), 1);
  // All of it is at the new one.
  url_ = database + "?host=" + standby.host();
  StartFront("b");
  EXPECT_EQ(ClientOf("b").ListJobs().size(), 6u);
  url_ = database + "?host=" + postgres_->host();
  StartFront("c");
  EXPECT_LE(ClientOf("c").ListJobs().size(), 1u);
}

// What deploy/FARM.md says of backups: a copy by pg_dump is a farm with all results.
TEST_F(FarmTest, ABackupIsAFarm) {
  StartWorker("w");
  StartFront("a");
  const UnwrapResult result = ClientOf("a").Unwrap(quick_.View());
  url_ = postgres_->Copy(url_);
  StartFront("b");
  EXPECT_EQ(ClientOf("b").AttachResult(result.job, quick_.View()).uv.AsDouble(), result.uv.AsDouble());
}

}  // namespace
}  // namespace planish
