// Several planishd over one PostgreSQL, behind HAProxy.
#pragma once

#include <unistd.h>

#include <csignal>
#include <cstdint>
#include <fstream>
#include <map>
#include <memory>
#include <mutex>
#include <string>
#include <vector>

#include "gtest/gtest.h"
#include "planish/client.h"
#include "tests/server/store/postgres_server.h"
#include "tests/testing/daemon.h"
#include "tests/testing/files.h"
#include "tests/testing/meshes.h"
#include "tests/testing/process.h"

namespace planish {

inline constexpr char kHaproxy[] = "/usr/sbin/haproxy";

// Seconds that a worker which is gone keeps its job.
inline constexpr char kLease[] = "--lease=2";

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
    flags.insert(flags.end(), blobs_.begin(), blobs_.end());
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
    options.reattach_timeout = Seconds(60);
    return Client("unix:" + SocketOf(name), options);
  }

  // With a mesh of 45,000 triangles: minutes of work.
  static UnwrapOptions Slowly() {
    UnwrapOptions options;
    options.solver.method = Solver::kMinres;
    options.solver.system = System::kFull;
    options.solver.preconditioner = Preconditioner::kNone;
    return options;
  }

  TempDir dir_;
  std::string url_;
  std::vector<std::string> blobs_;      // flags that say where blobs are
  const Arrays quick_{40}, slow_{200};  // the slow one still runs when a test has killed what it kills
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

}  // namespace planish
