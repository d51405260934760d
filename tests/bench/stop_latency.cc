// planish_stop_latency MESH [none|keep|needed|auto] [STOPS] [THREADS]: how long an unwrap goes on after a stop, at
// moments spread evenly over the seconds it takes without one. MESH as in bench_meshes.h. One JSON object per stop:
//
//   at, after    seconds from the start to the stop, and from there to the end
//   ended        "ok" or the reason of the error
//   charts, cut_short, flipped, overlapping, stretch   of the map that was kept
#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <string>
#include <thread>

#include "core/base/error.h"
#include "core/base/interrupter.h"
#include "core/base/timer.h"
#include "core/unwrap/unwrap.h"
#include "nlohmann/json.hpp"
#include "tests/bench/bench_meshes.h"

namespace planish::bench {
namespace {

nlohmann::json StopAt(const Mesh& mesh, const UnwrapOptions& options, double seconds) {
  Interrupter stop;
  UnwrapControl control;
  control.stop = &stop;
  Timer since_stop;
  std::thread stopper([&] {
    std::this_thread::sleep_for(std::chrono::duration<double>(seconds));
    since_stop.Restart();
    stop.Interrupt();
  });
  const absl::StatusOr<UnwrapResult> result = Unwrap(mesh, options, control);
  const bool in_time = stop.IsInterrupted();
  stopper.join();
  const double after = in_time ? since_stop.Restart() : 0;
  nlohmann::json line = {{"at", seconds}, {"after", after}};
  line["ended"] = result.ok() ? "ok" : ErrorInfoOf(result.status()).reason;
  if (!result.ok()) return line;
  int cut_short = 0;
  for (const ChartReport& chart : result->charts) cut_short += chart.flatten->stopped;
  line["charts"] = result->charts.size();
  line["cut_short"] = cut_short;
  line["flipped"] = result->quality.flipped + result->quality.degenerate;
  line["overlapping"] = result->quality.overlapping;
  line["stretch"] = result->quality.stretch_l2;
  return line;
}

int Main(int argc, char** argv) {
  const std::string seams = argc > 2 ? argv[2] : "auto";
  const int stops = argc > 3 ? std::atoi(argv[3]) : 20;
  UnwrapOptions options;
  options.threads = argc > 4 ? std::atoi(argv[4]) : 1;
  options.seams.policy = seams == "none"     ? SeamPolicy::kNone
                         : seams == "keep"   ? SeamPolicy::kKeep
                         : seams == "needed" ? SeamPolicy::kNeeded
                                             : SeamPolicy::kAuto;
  const absl::StatusOr<Mesh> mesh = LoadMesh(argc > 1 ? argv[1] : "");
  if (!mesh.ok() || stops < 1) {
    std::fprintf(stderr, "planish_stop_latency MESH [none|keep|needed|auto] [STOPS] [THREADS]\n%s\n",
                 mesh.status().ToString().c_str());
    return 2;
  }
  Timer timer;
  if (const absl::StatusOr<UnwrapResult> whole = Unwrap(*mesh, options, {}); !whole.ok()) {
    std::fprintf(stderr, "%s\n", whole.status().ToString().c_str());
    return 1;
  }
  const double seconds = timer.Restart();
  for (int i = 0; i < stops; ++i) {
    nlohmann::json line = StopAt(*mesh, options, seconds * i / stops);
    line["whole"] = seconds;
    std::printf("%s\n", line.dump().c_str());
    std::fflush(stdout);
  }
  return 0;
}

}  // namespace
}  // namespace planish::bench

int main(int argc, char** argv) {
  return planish::bench::Main(argc, argv);
}
