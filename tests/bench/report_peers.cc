// Others on the same meshes in the same minutes.
#include <algorithm>
#include <cmath>
#include <cstdio>

#include "tests/bench/report.h"

namespace planish::bench {
namespace {

std::string NameOf(const std::string& tool) {
  return tool == "planish_warm" ? "planish, its second run"
         : tool == "blender"    ? "Blender ABF"
         : tool == "cgal"       ? "CGAL LSCM"
                                : tool;
}

std::string Flips(const nlohmann::json& run) {
  if (!run.contains("flipped")) return "-";
  return WithCommas(run["flipped"]) + " / " + WithCommas(run["degenerate"]);
}

// A number printed by `format`; "infinite" where a triangle has no area; "-" where the tool failed.
std::string Number(const nlohmann::json& run, const char* field, const char* format) {
  if (!run.contains(field)) return "-";
  if (!run[field].is_number()) return "infinite";
  char text[32];
  std::snprintf(text, sizeof text, format, run[field].get<double>());
  return text;
}

}  // namespace

std::string ReportPeers(const Runs& runs, const std::string& columns) {
  std::string text =
      HeaderRow({"mesh", "triangles", "tool", "CPU seconds", "times planish", "least to most", "times its warm solve",
                 "ABF energy", "flipped / degenerate", "mean conformal distortion"});
  // For gnuplot, between tabs: the mesh, then the seconds of every tool that has any.
  std::vector<std::string> tools;
  std::string data = "mesh";
  for (const char* tool : {"planish", "blender", "cgal"}) {
    if (Numbers(Where(runs, "tool", tool), "map_cpu_seconds").empty()) continue;
    tools.push_back(tool);
    data += "\t" + NameOf(tool);
  }
  data += "\n";
  for (const Runs& mesh : ByMesh(runs)) {
    const auto& label = mesh.front()["mesh"];
    data += "\"" + label.get<std::string>() + "\\n" + WithCommas(mesh.front()["triangles"]) + "\"";
    for (const std::string& tool : tools) {
      const double seconds = Median(Numbers(Where(mesh, "tool", tool), "map_cpu_seconds"));
      data += std::isfinite(seconds) ? "\t" + std::to_string(seconds) : "\tNaN";
    }
    data += "\n";
    for (const char* tool : {"planish", "planish_warm", "blender", "cgal"}) {
      const Runs own = Where(mesh, "tool", tool);
      const std::vector<double> seconds = Numbers(own, "map_cpu_seconds");
      if (own.empty()) continue;
      const std::vector<double> ratios = Ratios(mesh, tool, "map_cpu_seconds", "planish", "map_cpu_seconds");
      const std::vector<double> of_solve = Ratios(mesh, tool, "map_cpu_seconds", "planish_warm", "flat_cpu_seconds");
      const bool peer = std::string(tool).rfind("planish", 0) != 0 && !ratios.empty();
      const auto& run = own.front();
      text += Row({label, WithCommas(run["triangles"]), NameOf(tool),
                   seconds.empty() ? run.value("ended", "failed") : ThreeDigits(Median(seconds)),
                   peer ? ThreeDigits(Median(ratios)) : "",
                   peer ? ThreeDigits(*std::min_element(ratios.begin(), ratios.end())) + " to " +
                              ThreeDigits(*std::max_element(ratios.begin(), ratios.end()))
                        : "",
                   peer ? ThreeDigits(Median(of_solve)) : "", Number(run, "abf_energy", "%.3e"), Flips(run),
                   Number(run, "conformal_distortion_mean", "%.3f")});
    }
  }
  WriteText(columns + ".columns", data);
  return text;
}

}  // namespace planish::bench
