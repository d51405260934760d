#include "tests/faults/chaos.h"

#include <signal.h>

#include <algorithm>
#include <atomic>
#include <chrono>
#include <cmath>
#include <mutex>
#include <optional>
#include <random>
#include <thread>
#include <utility>

#include "client/src/rpc.h"
#include "planish/client.h"
#include "tests/testing/meshes.h"
#include "tests/testing/process.h"

namespace planish {
namespace {

void Sleep(double seconds) {
  std::this_thread::sleep_for(std::chrono::duration<double>(seconds));
}

struct Surface {
  std::vector<float> positions;
  std::vector<std::uint32_t> triangles;
};

// A bumpy square, no two alike unless `height` is.
Surface BumpySquare(int n, double height) {
  const Mesh mesh =
      Grid(n, [height](double u, double v) { return Vec3(u, v, height * std::sin(3 * u) * std::cos(2 * v)); });
  Surface surface;
  for (const Vec3& p : mesh.positions) {
    for (const double c : p) surface.positions.push_back(static_cast<float>(c));
  }
  for (const Face& face : mesh.faces) surface.triangles.insert(surface.triangles.end(), face.begin(), face.end());
  return surface;
}

int FlippedTriangles(const Uv& uv) {
  int flipped = 0;
  for (std::size_t f = 0; f + 6 <= uv.size(); f += 6) {
    const double x1 = uv[f + 2] - uv[f], y1 = uv[f + 3] - uv[f + 1];
    const double x2 = uv[f + 4] - uv[f], y2 = uv[f + 5] - uv[f + 1];
    flipped += x1 * y2 - x2 * y1 <= 0 ? 1 : 0;
  }
  return flipped;
}

class Chaos {
 public:
  Chaos(const ChaosOptions& options, DurableServer& server)
      : options_(options), server_(server), random_(options.seed) {}

  ChaosReport Run() {
    const double start = Now();
    WarmUp();
    report_.descriptors_before = server_.Descriptors();
    std::thread killer([this] { KillAtRandom(); });
    std::vector<std::thread> callers;
    for (int i = 0; i < options_.callers; ++i) callers.emplace_back([this] { Call(); });
    for (std::thread& caller : callers) caller.join();
    calls_over_ = true;
    killer.join();
    CheckTheEnds();
    CheckLeaks();
    report_.seconds = Now() - start;
    return std::move(report_);
  }

 private:
  double Uniform(double low, double high) {
    const std::lock_guard lock(mutex_);
    return std::uniform_real_distribution(low, high)(random_);
  }

  void Wrong(const std::string& what) {
    const std::lock_guard lock(mutex_);
    report_.wrong.push_back(what);
  }

  ClientOptions PatientOptions() const {
    ClientOptions options;
    options.reattach_timeout = Seconds(120);
    options.retry_timeout = Seconds(120);
    options.queue_full_timeout = Seconds(600);
    return options;
  }

  void WarmUp() {
    Client client(server_.target(), PatientOptions());
    const Surface surface = BumpySquare(4, 0);
    client.Unwrap({surface.positions, surface.triangles});
  }

  void Call() {
    Client client(server_.target(), PatientOptions());
    for (int job = next_++; job < options_.jobs; job = next_++) {
      const double kind = Uniform(0, 1);
      try {
        if (kind < options_.malformed) {
          SendMalformed(client);
        } else {
          Unwrap(client, kind < options_.malformed + options_.cancelled);
        }
      } catch (const std::exception& error) {
        Wrong(std::string("a call ended with: ") + error.what());
      }
    }
  }

  void Unwrap(Client& client, bool cancel) {
    // Every tenth mesh is one of three that others send too.
    const bool shared = Uniform(0, 1) < 0.1;
    const int n = shared ? 12 : static_cast<int>(Uniform(2, options_.largest_grid));
    const Surface surface = BumpySquare(n, shared ? std::floor(Uniform(0, 3)) : Uniform(0, 1));
    std::string name;
    bool ended = false;
    Callbacks callbacks;
    callbacks.on_event = [&](const Event& event) {
      if (!event.job) return;
      if (event.job->name != name) {
        Accept(event.job->name);
        name = event.job->name;
        ended = false;
      }
      if (ended) Wrong(name + " went on after its end");
      ended = IsTerminal(event.job->state);
    };
    planish::Call call = client.StartUnwrap({surface.positions, surface.triangles}, {}, callbacks);
    if (cancel) {
      Sleep(Uniform(0, 0.1));
      call.Cancel();
    }
    try {
      const UnwrapResult result = call.Wait();
      if (result.uv.size() != 2 * surface.triangles.size()) Wrong(name + " has UV of another mesh");
      if (FlippedTriangles(result.uv) > 0) Wrong(name + " has flipped triangles");
    } catch (const Error& error) {
      const bool wanted = cancel && error.code() == ErrorCode::kCancelled;
      // Whoever lost three workers or servers to the killer is told so.
      const bool unlucky = error.reason() == "WORKER_CRASHED" || error.reason() == "SERVER_CRASHED";
      if (!wanted && !unlucky) Wrong(name + " failed: " + error.what());
    }
  }

  void SendMalformed(Client& client) {
    v1::CreateJobRequest request;
    std::string bytes = "DRACO\2\2\1\1";
    for (int i = 0; i < 200; ++i) bytes.push_back(static_cast<char>(Uniform(0, 256)));
    request.mutable_spec()->set_draco(bytes);
    request.set_request_id("malformed " + std::to_string(Uniform(0, 1)));
    const double start = Now();
    for (;;) {
      try {
        Rpc rpc(server_.target(), PatientOptions());
        const std::string name = rpc.Call(&v1::Planish::Stub::CreateJob, request).name();
        Accept(name);
        const Job job = client.WatchJob(name);
        if (job.state != JobState::kFailed) Wrong(name + " is malformed and ended as " + ToString(job.state));
        return;
      } catch (const Error& error) {
        // The header alone may be enough to refuse it.
        if (error.code() == ErrorCode::kInvalidArgument || error.reason() == "MESH_TOO_LARGE" ||
            error.reason() == "MEMORY_LIMIT") {
          return;
        }
        const bool passing = error.code() == ErrorCode::kUnavailable || error.reason() == "QUEUE_FULL";
        if (!passing || Now() - start > 120) throw;
        Sleep(0.1);
      }
    }
  }

  void Accept(const std::string& name) {
    const std::lock_guard lock(mutex_);
    accepted_.push_back(name);
  }

  void KillAtRandom() {
    for (int i = 0; i < options_.kills && !calls_over_; ++i) {
      Sleep(Uniform(0, 2 * options_.kill_pause_seconds));
      const std::vector<pid_t> workers = server_.Workers();
      if (Uniform(0, 1) < 0.5 && !workers.empty()) {
        kill(workers[static_cast<std::size_t>(Uniform(0, static_cast<double>(workers.size())))], SIGKILL);
        ++report_.worker_kills;
        continue;
      }
      server_.Kill();
      const double start = Now();
      server_.Start();
      report_.slowest_restart_seconds = std::max(report_.slowest_restart_seconds, Now() - start);
      ++report_.server_kills;
    }
  }

  void CheckTheEnds() {
    Client client(server_.target(), PatientOptions());
    report_.accepted = static_cast<int>(accepted_.size());
    // A caller that cancels before it knows the name of its job does not see the end of that job: it comes later when
    // the server was killed meanwhile.
    WaitUntil([&] {
      const std::vector<Job> jobs = client.ListJobs(0);
      return std::all_of(jobs.begin(), jobs.end(), [](const Job& job) { return IsTerminal(job.state); });
    });
    for (const std::string& name : accepted_) {
      const Job job = client.GetJob(name);
      std::string end = ToString(job.state);
      if (job.error) end += " " + job.error->reason();
      ++report_.ends[end];
      if (!IsTerminal(job.state)) Wrong(name + " has not ended: " + end);
    }
    for (const Job& job : client.ListJobs(0)) {
      if (!IsTerminal(job.state)) Wrong(job.name + ", which no caller knows of, has not ended");
    }
  }

  void CheckLeaks() {
    {
      Client client(server_.target(), PatientOptions());
      for (const Job& job : client.ListJobs(0)) {
        if (IsTerminal(job.state)) client.DeleteJob(job.name);
      }
    }
    // The server notices closed connections, and sweeps, within moments.
    for (int i = 0; i < 50; ++i) {
      report_.descriptors_after = server_.Descriptors();
      const bool clean = server_.BlobFiles() == 0 && server_.Zombies() == 0;
      if (clean && report_.descriptors_after <= report_.descriptors_before) break;
      Sleep(0.1);
    }
    report_.resident_bytes = server_.ResidentBytes();
    if (server_.BlobFiles() > 0) Wrong(std::to_string(server_.BlobFiles()) + " blobs are left of deleted jobs");
    if (server_.Zombies() > 0) Wrong(std::to_string(server_.Zombies()) + " zombies");
    if (report_.descriptors_after > report_.descriptors_before) {
      Wrong("descriptors: " + std::to_string(report_.descriptors_before) + " before, " +
            std::to_string(report_.descriptors_after) + " after");
    }
  }

  const ChaosOptions options_;
  DurableServer& server_;
  std::atomic<int> next_ = 0;
  std::atomic<bool> calls_over_ = false;

  std::mutex mutex_;
  // Guarded by mutex_.
  std::mt19937 random_;
  std::vector<std::string> accepted_;
  ChaosReport report_;  // kills and leaks: by one thread
};

}  // namespace

ChaosReport RunChaos(const ChaosOptions& options, DurableServer& server) {
  return Chaos(options, server).Run();
}

}  // namespace planish
