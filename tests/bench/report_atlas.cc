// Whole atlases: others on the same meshes in the same minutes.
#include <cmath>
#include <cstdio>

#include "tests/bench/report.h"

namespace planish::bench {
namespace {

const char* const kTools[] = {"planish", "blender", "xatlas"};

std::string NameOf(const std::string& tool) {
  return tool == "blender" ? "Blender Smart UV" : tool;
}

// Adds "map_seconds" to the runs of planish, whose report has them by stage: those in which it makes, packs and checks
// the map.
Runs WithSeconds(Runs runs) {
  for (auto& run : runs) {
    if (!run.contains("report")) continue;
    double sum = 0;
    for (const char* stage : {"charts", "solve", "layout", "pack", "verify"}) {
      sum += run["report"]["seconds"][stage].get<double>();
    }
    run["map_seconds"] = sum;
  }
  return runs;
}

std::string Fixed(const nlohmann::json& run, const char* field, const char* format) {
  if (!run.contains(field) || !run[field].is_number()) return "-";
  char text[32];
  std::snprintf(text, sizeof text, format, run[field].get<double>());
  return text;
}

std::string Count(const nlohmann::json& run, const char* field) {
  return run.contains(field) ? WithCommas(run[field]) : "-";
}

}  // namespace

std::string ReportAtlas(const Runs& all, const std::string& columns) {
  const Runs runs = WithSeconds(all);
  std::string text = HeaderRow({"mesh", "triangles", "tool", "seconds", "times planish", "whole command", "charts",
                                "packing efficiency", "L2 stretch", "mean angle error", "mirrored", "degenerate",
                                "overlapping pairs", "charts too near"});
  std::vector<std::string> tools;
  for (const char* tool : kTools) {
    if (!Numbers(Where(runs, "tool", tool), "map_seconds").empty()) tools.push_back(tool);
  }
  // For gnuplot, between tabs: the mesh, then a number for every tool that has any.
  const std::vector<std::string> plotted = {"map_seconds", "charts", "packing_efficiency"};
  std::vector<std::string> data(plotted.size(), "mesh");
  for (std::string& lines : data) {
    for (const std::string& tool : tools) lines += "\t" + NameOf(tool);
  }
  for (const Runs& mesh : ByMesh(runs)) {
    const std::string label = mesh.front()["mesh"];
    for (std::size_t i = 0; i < plotted.size(); ++i) {
      data[i] += "\n\"" + label + "\"";
      for (const std::string& tool : tools) {
        const double value = Median(Numbers(Where(mesh, "tool", tool), plotted[i]));
        data[i] += std::isfinite(value) ? "\t" + std::to_string(value) : "\tNaN";
      }
    }
    for (const char* tool : kTools) {
      const Runs own = Where(mesh, "tool", tool);
      if (own.empty()) continue;
      const std::vector<double> seconds = Numbers(own, "map_seconds");
      const std::vector<double> ratios = Ratios(mesh, tool, "map_seconds", "planish", "map_seconds");
      const auto& run = own.front();
      text += Row({label, WithCommas(run["triangles"]), NameOf(tool),
                   seconds.empty() ? run.value("ended", "failed") : ThreeDigits(Median(seconds)),
                   std::string(tool) != "planish" && !ratios.empty() ? ThreeDigits(Median(ratios)) : "",
                   ThreeDigits(Median(Numbers(own, "command_seconds"))), Count(run, "charts"),
                   Fixed(run, "packing_efficiency", "%.3f"), Fixed(run, "stretch_l2", "%.3f"),
                   Fixed(run, "angle_error_mean_deg", "%.2f"), Count(run, "flipped"), Count(run, "degenerate"),
                   Count(run, "overlapping"), Count(run, "too_near")});
    }
  }
  for (std::size_t i = 0; i < plotted.size(); ++i) WriteText(columns + "." + plotted[i], data[i] + "\n");
  return text;
}

}  // namespace planish::bench
