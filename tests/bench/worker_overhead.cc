// What the way to a worker costs: the same job by a plain call, through a link to a thread and through a link to a
// process, in turn, so that all three see the same machine. One JSON object on stdout, milliseconds.
//
//   planish_worker_overhead [squares per side, 22: 968 triangles] [rounds, 200]
#include <algorithm>
#include <cstdlib>
#include <iostream>
#include <optional>
#include <vector>

#include "core/base/heap.h"
#include "core/base/timer.h"
#include "core/draco/codec.h"
#include "nlohmann/json.hpp"
#include "server/link/in_process_link.h"
#include "server/link/process_link.h"
#include "server/worker/work.h"
#include "server/worker/worker.h"
#include "server/worker_main.h"
#include "tests/testing/meshes.h"

namespace planish {
namespace {

struct Job {
  worker::v1::WorkRequest request;
  std::vector<BlobPtr> blobs;
};

// Seconds until the result is there; then waits until the worker is idle.
double RoundTrip(WorkerLink& link, const Job& job) {
  const Timer timer;
  worker::v1::ToWorker message;
  *message.mutable_request() = job.request;
  link.Send(std::move(message), job.blobs);
  WorkerLink::Received received;
  double seconds = 0;
  while (!received.message.has_idle()) {
    if (link.Receive(absl::InfiniteFuture(), &received) != WorkerLink::Wait::kMessage) {
      std::cerr << link.HowEnded().message << "\n";
      std::exit(1);
    }
    if (received.message.has_result()) seconds = timer.Seconds();
  }
  return seconds;
}

void WaitUntilIdle(WorkerLink& link) {
  WorkerLink::Received received;
  while (!received.message.has_idle()) link.Receive(absl::InfiniteFuture(), &received);
}

double Median(std::vector<double> values) {
  std::nth_element(values.begin(), values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2), values.end());
  return values[values.size() / 2];
}

nlohmann::json Summary(const std::vector<double>& seconds) {
  return {{"least", 1000 * *std::min_element(seconds.begin(), seconds.end())}, {"median", 1000 * Median(seconds)}};
}

int Run(int squares, int rounds) {
  KeepFreedMemory();
  Job job;
  job.blobs = {*Blob::Copy(*EncodeDraco(Bump(squares)))};
  Timer timer;
  const auto process = *StartProcessWorker({});
  WaitUntilIdle(*process);
  const double start = timer.Seconds();
  const auto thread = *StartInProcessWorker(RunWorker);
  WaitUntilIdle(*thread);

  Job limited = job;
  limited.request.set_memory_bytes(std::int64_t{256} << 20);
  std::vector<double> direct, by_thread, by_process, by_limited;
  for (int i = 0; i < rounds; ++i) {
    timer.Restart();
    DoWork(job.request, job.blobs, {});
    direct.push_back(timer.Seconds());
    by_thread.push_back(RoundTrip(*thread, job));
    by_process.push_back(RoundTrip(*process, job));
    by_limited.push_back(RoundTrip(*process, limited));
  }
  std::cout << nlohmann::json{{"triangles", 2 * squares * squares},
                              {"rounds", rounds},
                              {"call", Summary(direct)},
                              {"thread", Summary(by_thread)},
                              {"process", Summary(by_process)},
                              {"process_with_memory_limit", Summary(by_limited)},
                              {"worker_start", 1000 * start}}
                   .dump()
            << "\n";
  return 0;
}

}  // namespace
}  // namespace planish

int main(int argc, char** argv) {
  if (const std::optional<int> code = planish::RunIfWorker(argc, argv)) return *code;
  const int squares = argc > 1 ? std::atoi(argv[1]) : 22;
  const int rounds = argc > 2 ? std::atoi(argv[2]) : 200;
  return planish::Run(std::max(squares, 1), std::max(rounds, 1));
}
