// What a server costs beside the work, and what it survives.
#include <string>
#include <vector>

#include "tests/bench/report.h"

namespace planish::bench {
namespace {

Runs Of(const Runs& runs, const std::string& bench) {
  Runs chosen;
  for (const auto& run : runs) {
    if (run["bench"] == bench) chosen.push_back(run);
  }
  return chosen;
}

std::string Milliseconds(double seconds) {
  return ThreeDigits(1e3 * seconds);
}

std::string Overhead(const Runs& runs) {
  std::string text =
      "## Overhead\n\nMedians, in milliseconds, one job after the other. The server's own CPU, a "
      "job, is without its worker's.\n\n" +
      HeaderRow({"jobs kept in", "triangles", "runs", "solve", "Draco, both ways", "through the server", "above solve",
                 "over solve and Draco", "server's CPU"});
  for (const auto& run : runs) {
    text += Row({run["store"].get<std::string>(), WithCommas(run["triangles"].get<std::int64_t>()), run["runs"].dump(),
                 Milliseconds(run["solve_seconds"]), Milliseconds(run["draco_seconds"]),
                 Milliseconds(run["served_seconds"]), Milliseconds(run["above_solve_seconds"]),
                 ThreeDigits(run["served_over_solve_and_draco"]), Milliseconds(run["server_cpu_seconds"])});
  }
  return text;
}

std::string Workers(const Runs& runs) {
  std::string text = "\n## Two workers against one\n\nJobs of 20,000 triangles a second, four callers.\n\n" +
                     HeaderRow({"one worker", "two workers", "ratio"});
  for (const auto& run : runs) {
    text += Row({ThreeDigits(run["one"]), ThreeDigits(run["two"]), ThreeDigits(run["ratio"])});
  }
  return text + "\nMedian ratio: " + ThreeDigits(Median(Numbers(runs, "ratio"))) + ".\n";
}

std::string Watchers(const Runs& runs) {
  std::string text =
      "\n## Watchers\n\nOne job of 200,000 triangles, alone and with watchers of whom a tenth never reads; memory is "
      "the "
      "server process's own.\n\n" +
      HeaderRow({"watchers", "events read", "MB alone", "MB watched", "solve, watched over alone"});
  for (const auto& run : runs) {
    text += Row({run["watchers"].dump(), run["events"].dump(), run["resident_mb_alone"].dump(),
                 run["resident_mb_watched"].dump(), ThreeDigits(run["solve_ratio"])});
  }
  return text + "\nMedian ratio: " + ThreeDigits(Median(Numbers(runs, "solve_ratio"))) + ".\n";
}

std::string Chaos(const Runs& runs) {
  std::string text =
      "\n## Chaos\n\nMany callers, a tenth of the jobs cancelled, a twentieth malformed, while the server and "
      "its workers are killed at random.\n\n" +
      HeaderRow({"jobs", "server killed", "workers killed", "seconds", "ends", "descriptors before, after",
                 "MB at the end", "promises broken"});
  for (const auto& run : runs) {
    text +=
        Row({run["jobs"].dump(), run["server_kills"].dump(), run["worker_kills"].dump(), ThreeDigits(run["seconds"]),
             run["ends"].dump(), run["descriptors"].dump(), run["resident_mb"].dump(), run["wrong"].dump()});
  }
  return text;
}

}  // namespace

std::string ReportService(const Runs& runs, const std::string&) {
  return Overhead(Of(runs, "overhead")) + Workers(Of(runs, "workers")) + Watchers(Of(runs, "watchers")) +
         Chaos(Of(runs, "chaos"));
}

}  // namespace planish::bench
