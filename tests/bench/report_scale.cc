// Time and memory over the number of triangles.
#include "tests/bench/report.h"

namespace planish::bench {

std::string ReportScale(const Runs& runs, const std::string& columns) {
  std::string text = HeaderRow({"mesh", "triangles", "threads", "seconds", "CPU us/triangle", "of it: solve",
                                "Newton steps", "linear iterations", "peak bytes/triangle"});
  std::string data;
  for (const auto& threads : Values(runs, "threads")) {
    for (const auto& label : Values(runs, "family")) {
      const Runs family = Where(Where(runs, "threads", threads), "family", label);
      if (family.empty()) continue;
      if (!data.empty()) data += "\n\n";  // between gnuplot's blocks
      data +=
          "\"" + label.get<std::string>() + ", " + threads.dump() + (threads == 1 ? " thread" : " threads") + "\"\n";
      for (const auto& triangles : Values(family, "triangles")) {
        const Runs same = Where(family, "triangles", triangles);
        const auto& run = same.front();
        const auto count = triangles.get<double>();
        const double seconds = Median(Numbers(same, "map_seconds"));
        const double micros = 1e6 * Median(Numbers(same, "map_cpu_seconds")) / count;
        const double solve_micros = 1e6 * Median(Numbers(same, "solve_cpu_seconds")) / count;
        const double bytes = Median(Numbers(same, "peak_bytes")) / count;
        const bool converged = run["ended"] == "converged";
        text +=
            Row({run["mesh"], WithCommas(triangles), threads.dump(),
                 converged ? ThreeDigits(seconds) : run["ended"].get<std::string>() + " " + ThreeDigits(seconds),
                 ThreeDigits(micros), ThreeDigits(solve_micros), std::to_string(run["newton_iterations"].get<int>()),
                 WithCommas(run["linear_iterations"]), ThreeDigits(bytes)});
        if (converged) {
          data += triangles.dump() + " " + std::to_string(seconds) + " " + std::to_string(micros) + " " +
                  std::to_string(bytes) + "\n";
        }
      }
    }
  }
  WriteText(columns + ".columns", data);
  return text;
}

}  // namespace planish::bench
