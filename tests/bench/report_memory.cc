// Estimates of memory and time beside what was measured.
#include <algorithm>

#include "tests/bench/report.h"

namespace planish::bench {

std::string ReportMemory(const Runs& runs, const std::string&) {
  std::string text = HeaderRow({"mesh", "triangles", "seams", "threads", "peak MB", "bytes/triangle", "estimate MB",
                                "estimate/peak", "CPU seconds", "estimate s", "estimate/CPU"});
  int below = 0, large = 0, wasteful = 0, far = 0, timed = 0;
  double least = 1e300, most = 0;
  for (const auto& run : runs) {
    const auto triangles = run["triangles"].get<std::int64_t>();
    const double peak = run["peak_bytes"], estimate = run["estimate_bytes"], ratio = estimate / peak;
    const double seconds = run["cpu_seconds"], in_time = run["estimate_seconds"].get<double>() / seconds;
    below += ratio < 1;
    if (triangles >= 20'000) {
      ++large;
      wasteful += ratio > 2;
      least = std::min(least, ratio);
      most = std::max(most, ratio);
    }
    if (run["threads"] == 1) {
      ++timed;
      far += in_time < 1.0 / 3 || in_time > 3;
    }
    text += Row({run["mesh"], WithCommas(triangles), run["seams"], run["threads"].dump(), ThreeDigits(peak / 1e6),
                 ThreeDigits(peak / static_cast<double>(triangles)), ThreeDigits(estimate / 1e6), ThreeDigits(ratio),
                 ThreeDigits(seconds), ThreeDigits(run["estimate_seconds"]), ThreeDigits(in_time)});
  }
  text += "\nEstimates of memory below what was measured: " + std::to_string(below) + " of " +
          std::to_string(runs.size()) + ". From 20,000 triangles on: " + ThreeDigits(least) + " to " +
          ThreeDigits(most) + " times it, more than twice in " + std::to_string(wasteful) + " of " +
          std::to_string(large) +
          ". Estimates of seconds (of one thread) off by more than a factor of 3: " + std::to_string(far) + " of " +
          std::to_string(timed) + ".\n";
  return text;
}

}  // namespace planish::bench
