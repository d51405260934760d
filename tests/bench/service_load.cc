// What a real planishd costs beside the work itself, and whether it keeps its promises under load:
//
//   planish_service_load overhead [RUNS]       1,000 and 200,000 triangles through a warm server, without and with
//                                              a data directory, beside the same in process
//   planish_service_load workers [JOBS]        jobs a second of one worker and of two, in turn
//   planish_service_load watchers [RUNS]       1,000 watchers, a tenth of them stalled: memory, and the job's own pace
//   planish_service_load chaos [JOBS] [KILLS] [SEED]
//
// One JSON object a line on stdout.
#include <grpcpp/grpcpp.h>

#include <algorithm>
#include <atomic>
#include <chrono>
#include <cstdlib>
#include <functional>
#include <iostream>
#include <memory>
#include <mutex>
#include <stdexcept>
#include <string>
#include <thread>
#include <vector>

#include "core/base/heap.h"
#include "nlohmann/json.hpp"
#include "planish/client.h"
#include "planish/v1/planish.grpc.pb.h"
#include "tests/bench/bench_meshes.h"
#include "tests/bench/direct_work.h"
#include "tests/bench/report.h"
#include "tests/faults/chaos.h"
#include "tests/testing/daemon.h"
#include "tests/testing/files.h"
#include "tests/testing/process.h"

namespace planish::bench {
namespace {

using nlohmann::json;
using Clock = std::chrono::steady_clock;

double SecondsOf(const std::function<void()>& task) {
  const Clock::time_point start = Clock::now();
  task();
  return std::chrono::duration<double>(Clock::now() - start).count();
}

// The mesh as a client has it.
struct Arrays {
  explicit Arrays(const Mesh& mesh) {
    for (const Vec3& p : mesh.positions) {
      for (int c = 0; c < 3; ++c) positions.push_back(static_cast<float>(p[c]));
    }
    for (const Face& face : mesh.faces) triangles.insert(triangles.end(), face.begin(), face.end());
  }
  MeshView view() const { return {positions, triangles}; }

  std::vector<float> positions;
  std::vector<std::int32_t> triangles;
};

// Loopback, as in production; the port is the system's choice.
const std::vector<std::string> kOnLoopback = {"--listen=127.0.0.1:0", "--log-level=info"};

// Where such a server says that it listens.
std::string TargetIn(const std::string& log) {
  const std::size_t at = log.find("127.0.0.1:");
  return log.substr(at, log.find_first_of(" ,\n", at) - at);
}

// With a data directory.
struct TcpServer {
  explicit TcpServer(std::vector<std::string> flags) {
    flags.insert(flags.begin(), kOnLoopback.begin(), kOnLoopback.end());
    server = std::make_unique<DurableServer>(directory.Path("s"), flags);
    target = TargetIn(server->Log());
  }

  const TempDir directory;
  std::unique_ptr<DurableServer> server;
  std::string target;
};

CallOptions Fresh() {
  CallOptions call;
  call.scheduling.fresh = true;
  return call;
}

// `store`: what the server keeps its jobs in.
void OverheadOf(const std::string& store, int runs) {
  const TempDir directory;
  std::vector<std::string> flags = kOnLoopback;
  flags.insert(flags.end(), {"--workers=1", "--threads=1"});
  if (store == "directory") flags.push_back("--data-dir=" + directory.Path("data"));
  Daemon server(flags, /*supervised=*/true);
  if (!server.WaitReady()) throw std::runtime_error("planishd: " + server.Output());
  Client client(TargetIn(server.Output()));
  for (const int triangles : {1000, 200'000}) {
    const Mesh mesh = MakeMesh("waves", triangles);
    const Arrays arrays(mesh);
    const int count = triangles < 10'000 ? runs : std::max(3, runs / 10);
    std::vector<double> solve, draco, served, worker;
    client.Unwrap(arrays.view(), {}, {}, Fresh());
    const double cpu_before = CpuSecondsOf(server.pid());
    for (int i = 0; i < count; ++i) {
      const DirectSeconds direct = WorkDirectly(mesh);
      solve.push_back(direct.solve);
      draco.push_back(direct.draco);
      served.push_back(SecondsOf([&] {
        const StageTimes in = client.Unwrap(arrays.view(), {}, {}, Fresh()).report.times;
        worker.push_back((in.decode + in.charts + in.solve + in.layout + in.pack + in.verify + in.encode).count());
      }));
    }
    json line = {{"bench", "overhead"}, {"store", store}, {"triangles", mesh.num_faces()}, {"runs", count}};
    line["server_cpu_seconds"] = (CpuSecondsOf(server.pid()) - cpu_before) / count;
    line["solve_seconds"] = Median(solve);
    line["draco_seconds"] = Median(draco);
    line["worker_seconds"] = Median(worker);
    line["served_seconds"] = Median(served);
    line["above_solve_seconds"] = Median(served) - Median(solve);
    line["served_over_solve_and_draco"] = Median(served) / (Median(solve) + Median(draco));
    std::cout << line << std::endl;
  }
}

void Overhead(int runs) {
  for (const char* store : {"memory", "directory"}) OverheadOf(store, runs);
}

// So many jobs from four callers, each its own mesh; jobs a second.
double Throughput(const std::string& target, int jobs) {
  const Arrays arrays(MakeMesh("waves", 20'000));
  std::atomic<int> next = 0;
  const double seconds = SecondsOf([&] {
    std::vector<std::thread> callers;
    for (int i = 0; i < 4; ++i) {
      callers.emplace_back([&] {
        Client client(target);
        while (next++ < jobs) client.Unwrap(arrays.view(), {}, {}, Fresh());
      });
    }
    for (std::thread& caller : callers) caller.join();
  });
  return jobs / seconds;
}

void Workers(int jobs) {
  TcpServer one({"--workers=1", "--threads=1"}), two({"--workers=2", "--threads=1"});
  for (const TcpServer* server : {&one, &two}) Throughput(server->target, 4);
  for (int round = 0; round < 5; ++round) {
    const double of_one = Throughput(one.target, jobs), of_two = Throughput(two.target, jobs);
    std::cout
        << json{{"bench", "workers"}, {"jobs", jobs}, {"one", of_one}, {"two", of_two}, {"ratio", of_two / of_one}}
        << std::endl;
  }
}

// WatchJob calls of which the last tenth never reads.
class Watchers {
 public:
  Watchers(const std::string& target, const std::string& job, int count) {
    grpc::ChannelArguments arguments;
    arguments.SetInt(GRPC_ARG_USE_LOCAL_SUBCHANNEL_POOL, 1);
    v1::WatchJobRequest request;
    request.set_name(job);
    for (int i = 0; i < count; ++i) {
      // Connections of a hundred streams, as a server has them from many machines.
      if (i % 100 == 0) {
        stubs_.push_back(v1::Planish::NewStub(
            grpc::CreateCustomChannel("ipv4:" + target, grpc::InsecureChannelCredentials(), arguments)));
      }
      calls_.push_back(std::make_unique<Call>());
      Call& call = *calls_.back();
      call.stalled = i >= count - count / 10;
      call.reader = stubs_.back()->PrepareAsyncWatchJob(&call.context, request, &queue_);
      call.reader->StartCall(&call);
    }
    thread_ = std::thread([this] { Serve(); });
  }

  ~Watchers() {
    {
      const std::lock_guard lock(mutex_);
      closing_ = true;  // nothing is started on the queue from now on
    }
    for (const auto& call : calls_) call->context.TryCancel();
    queue_.Shutdown();
    thread_.join();
  }

  std::int64_t events() const { return events_; }

 private:
  struct Call {
    grpc::ClientContext context;
    v1::WatchJobResponse response;
    std::unique_ptr<grpc::ClientAsyncReader<v1::WatchJobResponse>> reader;
    bool stalled = false;
    bool started = false;
  };

  void Serve() {
    void* tag = nullptr;
    bool ok = false;
    while (queue_.Next(&tag, &ok)) {
      auto* call = static_cast<Call*>(tag);
      if (!ok) continue;  // the stream is over
      if (call->started) ++events_;
      call->started = true;
      const std::lock_guard lock(mutex_);
      if (!call->stalled && !closing_) call->reader->Read(&call->response, call);
    }
  }

  grpc::CompletionQueue queue_;
  std::vector<std::unique_ptr<v1::Planish::Stub>> stubs_;
  std::vector<std::unique_ptr<Call>> calls_;
  std::atomic<std::int64_t> events_ = 0;
  std::mutex mutex_;
  bool closing_ = false;  // guarded by mutex_
  std::thread thread_;
};

void WatchersOfOneJob(int runs) {
  constexpr int kWatchers = 1000;
  TcpServer server({"--workers=1", "--threads=1"});
  Client client(server.target);
  const Arrays arrays(MakeMesh("foot", 200'000));
  client.Unwrap(arrays.view(), {}, {}, Fresh());
  for (int i = 0; i < runs; ++i) {
    double seconds[2] = {};
    json line = {{"bench", "watchers"}, {"watchers", kWatchers}};
    for (const bool watched : {false, true}) {
      const Job created = client.CreateJob(arrays.view(), {}, Fresh());
      std::unique_ptr<Watchers> watchers;
      if (watched) watchers = std::make_unique<Watchers>(server.target, created.name, kWatchers);
      const Job job = client.WatchJob(created.name);
      seconds[watched ? 1 : 0] = job.report->times.solve.count();
      if (watched) line["events"] = watchers->events();
      line[watched ? "resident_mb_watched" : "resident_mb_alone"] = server.server->ResidentBytes() >> 20;
    }
    line["solve_ratio"] = seconds[1] / seconds[0];
    std::cout << line << std::endl;
  }
}

int ChaosOf(int jobs, int kills, int seed) {
  const TempDir directory;
  DurableServer server(directory.Path("s"), {"--workers=2", "--threads=1", "--retain-records-mb=100000", "--queue=50"});
  ChaosOptions options;
  options.jobs = jobs;
  options.kills = kills;
  options.seed = static_cast<std::uint32_t>(seed);
  options.largest_grid = 120;
  options.kill_pause_seconds = 0.25;
  const ChaosReport report = RunChaos(options, server);
  json line = {{"bench", "chaos"}, {"jobs", jobs}, {"accepted", report.accepted}, {"ends", report.ends}};
  line["server_kills"] = report.server_kills;
  line["worker_kills"] = report.worker_kills;
  line["seconds"] = report.seconds;
  line["slowest_restart_seconds"] = report.slowest_restart_seconds;
  line["descriptors"] = {report.descriptors_before, report.descriptors_after};
  line["resident_mb"] = report.resident_bytes >> 20;
  line["wrong"] = report.wrong;
  std::cout << line << std::endl;
  return report.wrong.empty() ? EXIT_SUCCESS : EXIT_FAILURE;
}

int Main(int argc, char** argv) {
  const std::string bench = argc > 1 ? argv[1] : "";
  KeepFreedMemory();  // as a worker
  const auto number = [&](int i, int otherwise) { return argc > i ? std::atoi(argv[i]) : otherwise; };
  if (bench == "overhead") return Overhead(number(2, 50)), EXIT_SUCCESS;
  if (bench == "workers") return Workers(number(2, 30)), EXIT_SUCCESS;
  if (bench == "watchers") return WatchersOfOneJob(number(2, 7)), EXIT_SUCCESS;
  if (bench == "chaos") return ChaosOf(number(2, 500), number(3, 50), number(4, 1));
  std::cerr << "usage: planish_service_load overhead|workers|watchers|chaos [NUMBER...]\n";
  return 2;
}

}  // namespace
}  // namespace planish::bench

int main(int argc, char** argv) {
  return planish::bench::Main(argc, argv);
}
