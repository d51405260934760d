// planish_pack_time [options] CHARTS...: packs charts (see pack_charts.h) and prints, a line each, what came out, and
// then the means of efficiency and the sums of seconds. What the constants of core/pack/tuning.h were chosen by.
#include <cstdio>
#include <ctime>
#include <fstream>
#include <map>
#include <string>
#include <vector>

#include "CLI/CLI.hpp"
#include "core/base/thread_team.h"
#include "core/base/timer.h"
#include "core/pack/pack.h"
#include "tests/core/pack_charts.h"

namespace planish::bench {
namespace {

// The charts as they lie, each in its own colour.
void Draw(const std::string& path, const std::vector<PackChart>& charts, const Packing& packing) {
  std::ofstream file(path);
  const int side = 1000, width = side * packing.tiles;
  file << "<svg xmlns='http://www.w3.org/2000/svg' width='" << width << "' height='" << side << "'>\n";
  file << "<rect width='" << width << "' height='" << side << "' fill='white' stroke='black'/>\n";
  for (std::size_t i = 0; i < charts.size(); ++i) {
    file << "<path fill='hsl(" << i * 137 % 360 << ",60%,60%)' d='";
    for (const Face& face : charts[i].faces) {
      for (int k = 0; k < 3; ++k) {
        const Vec2 p = packing.charts[i](charts[i].positions[face[k]]);
        file << (k == 0 ? "M" : "L") << side * p.x() << "," << side * (1 - p.y());
      }
      file << "z";
    }
    file << "'/>\n";
  }
  file << "</svg>\n";
}

int Main(int argc, char** argv) {
  CLI::App app("Packs charts and prints what came out");
  PackOptions options;
  std::vector<std::string> names;
  std::string svg;
  int threads = 1;
  app.add_option("--texture-size", options.texture_size);
  app.add_option("--padding", options.padding);
  app.add_option("--tiles", options.tiles);
  const std::map<std::string, PackEffort> efforts = {
      {"fast", PackEffort::kFast}, {"normal", PackEffort::kNormal}, {"best", PackEffort::kBest}};
  app.add_option("--effort", options.effort)->transform(CLI::CheckedTransformer(efforts));
  app.add_option("--threads", threads);
  app.add_option("--svg", svg, "draws the last packing");
  PackTuning& tuning = options.tuning;
  app.add_option("--rest-per-face", tuning.rest_per_face);
  app.add_option("--full-work-faces", tuning.full_work_faces);
  app.add_option("--rest-per-chart", tuning.rest_per_chart);
  app.add_option("--normal-share", tuning.normal_share);
  app.add_option("--best-share", tuning.best_share);
  app.add_option("--best-per-few", tuning.best_per_few);
  app.add_option("--least-best-work", tuning.least_best_work);
  app.add_option("--least-per-few", tuning.least_per_few);
  app.add_option("--least-work", tuning.least_work);
  app.add_option("--least-per-chart", tuning.least_per_chart);
  app.add_option("--cells-per-chart", tuning.cells_per_chart);
  app.add_option("--fewest-cells", tuning.fewest_cells);
  app.add_option("--most-angles", tuning.most_angles);
  app.add_option("--typical-trials", tuning.typical_trials);
  app.add_option("--most-trials", tuning.most_trials);
  app.add_option("--tighten-per-chart", tuning.tighten_per_chart);
  app.add_option("--first-step", tuning.first_step);
  app.add_option("--moves-at-once", tuning.moves_at_once);
  app.add_option("--moves-at-once-per-chart", tuning.moves_at_once_per_chart);
  app.add_option("--pixels-per-chart", tuning.pixels_per_chart);
  app.add_option("--hops-away", tuning.hops_away);
  app.add_option("--growing-share", tuning.growing_share);
  app.add_option("--settling-share", tuning.settling_share);
  app.add_option("--fewest-orders", tuning.fewest_orders);
  app.add_option("--charts-for-orders", tuning.charts_for_orders);
  app.add_option("--large-area", tuning.large_area);
  app.add_option("--orders-share", tuning.orders_share);
  app.add_option("--starts", tuning.starts);
  app.add_option("charts", names)->required();
  CLI11_PARSE(app, argc, argv);
  ThreadTeam team(threads);
  Execution execution;
  execution.team = &team;
  std::printf("%-28s %6s %7s %10s %5s %7s %8s %8s\n", "charts", "n", "faces", "efficiency", "tiles", "padding",
              "seconds", "CPU");
  double efficiencies = 0, seconds_of_all = 0, cpu_of_all = 0;
  for (const std::string& name : names) {
    const auto charts = testing::MakeCharts(name);
    if (!charts.ok()) {
      std::fprintf(stderr, "%s\n", std::string(charts.status().message()).c_str());
      return 2;
    }
    std::size_t faces = 0;
    for (const PackChart& chart : *charts) faces += chart.faces.size();
    const Timer timer;
    const std::clock_t clock = std::clock();
    const Packing packing = Pack(*charts, options, execution);
    const double seconds = timer.Seconds();
    const double cpu_seconds = static_cast<double>(std::clock() - clock) / CLOCKS_PER_SEC;
    std::printf("%-28s %6zu %7zu %10.4f %5d %7.2f %8.3f %8.3f\n", name.substr(name.rfind('/') + 1).c_str(),
                charts->size(), faces, packing.efficiency, packing.tiles, packing.padding, seconds, cpu_seconds);
    std::fflush(stdout);
    efficiencies += packing.efficiency;
    seconds_of_all += seconds;
    cpu_of_all += cpu_seconds;
    if (!svg.empty()) Draw(svg, *charts, packing);
  }
  std::printf("%-28s %6s %7s %10.4f %5s %7s %8.3f %8.3f\n", "mean and sums", "", "",
              efficiencies / static_cast<double>(names.size()), "", "", seconds_of_all, cpu_of_all);
  return 0;
}

}  // namespace
}  // namespace planish::bench

int main(int argc, char** argv) {
  return planish::bench::Main(argc, argv);
}
