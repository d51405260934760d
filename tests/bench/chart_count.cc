// planish_chart_count [options] MESH...: unwraps meshes (LoadMesh()) at one or several stretch limits and prints, a
// line each, the charts before and after they were cut again, total stretch, seam length and visible seam length over
// the square root of the area, the turning and symmetry of the seams, and the CPU seconds of charts, of packing and of
// all stages. What the constants of core/charts/tuning.h were chosen by.
#include <cstdio>
#include <ctime>
#include <map>
#include <string>
#include <vector>

#include "CLI/CLI.hpp"
#include "core/unwrap/unwrap.h"
#include "tests/bench/bench_meshes.h"

namespace planish::bench {
namespace {

int Main(int argc, char** argv) {
  CLI::App app("Counts the charts of meshes");
  std::vector<std::string> specs;
  std::vector<double> limits = {AtlasTuning().texture_stretch};
  UnwrapOptions options;
  options.seams.prefer = SeamPreference::kTexture;  // most of whose constants it sweeps
  bool no_pack = false;
  const std::map<std::string, SeamPreference> preferences = {{"seams", SeamPreference::kSeams},
                                                             {"texture", SeamPreference::kTexture}};
  app.add_option("--prefer", options.seams.prefer, "seams or texture")->transform(CLI::CheckedTransformer(preferences));
  app.add_option("--max-stretch", limits, "one or several, separated by commas")->delimiter(',');
  app.add_flag("--no-pack", no_pack, "leaves out the packer, and the cuts that are made for it");
  AtlasTuning& tuning = options.tuning;
  app.add_option("--patch-deviation", tuning.patch_deviation);
  app.add_option("--compactness", tuning.compactness);
  app.add_option("--widest", tuning.widest, "radians");
  app.add_option("--estimate-reach", tuning.estimate_reach);
  app.add_option("--estimate-growth", tuning.estimate_growth);
  app.add_option("--outline-growth", tuning.outline_growth);
  app.add_option("--hull-gain", tuning.packer_cuts.hull_gain);
  app.add_option("--cut-faces", tuning.cut_faces);
  app.add_option("--cut-width", tuning.packer_cuts.cut_width);
  app.add_option("--folded-faces", tuning.folded_faces);
  app.add_option("--max-extent", tuning.max_extent, "sides of the square");
  app.add_option("--first-stretch", tuning.seams_first_stretch, "with --prefer=seams");
  app.add_option("--waste-price", tuning.waste_price);
  app.add_option("--stretch-price", tuning.stretch_price);
  app.add_option("--seam-band", tuning.seam_band);
  app.add_option("--narrow-seam-band", tuning.narrow_seam_band);
  app.add_option("--glue-estimates", tuning.glue_estimates);
  app.add_option("--dart-estimates", tuning.dart_estimates);
  app.add_option("--move-estimates", tuning.move_estimates);
  app.add_option("--crumb-estimates", tuning.crumb_estimates);
  app.add_option("--join-rounds", tuning.join_rounds);
  app.add_option("--join-faces", tuning.join_faces);
  app.add_option("--join-gain", tuning.packer_cuts.join_gain);
  app.add_option("--join-misfit", tuning.join_misfit);
  app.add_option("meshes", specs)->required();
  CLI11_PARSE(app, argc, argv);
  options.pack = !no_pack;
  std::printf("%-28s %8s %7s %7s %7s %7s %7s %7s %7s %7s %7s %8s %8s %8s\n", "mesh", "limit", "first", "charts", "L2",
              "seams", "visible", "turn", "mirror", "filled", "faults", "charts s", "pack s", "CPU s");
  for (const std::string& spec : specs) {
    const auto mesh = LoadMesh(spec);
    if (!mesh.ok()) {
      std::fprintf(stderr, "%s\n", std::string(mesh.status().message()).c_str());
      return 2;
    }
    for (const double limit : limits) {
      options.seams.max_stretch = limit;
      int first = 0;
      UnwrapControl control;
      const std::clock_t clock = std::clock();
      std::clock_t since = clock, charts = 0, packing = 0;
      UnwrapStage stage = UnwrapStage::kVerify;
      control.on_progress = [&](const UnwrapProgress& progress) {
        if (first == 0 && progress.stage == UnwrapStage::kSolve) first = progress.chart_count;
        if (progress.stage == stage) return;
        const std::clock_t now = std::clock();
        if (stage == UnwrapStage::kCharts) charts += now - since;
        if (stage == UnwrapStage::kPack) packing += now - since;
        stage = progress.stage;
        since = now;
      };
      const auto result = Unwrap(*mesh, options, control);
      const double seconds = static_cast<double>(std::clock() - clock) / CLOCKS_PER_SEC;
      if (!result.ok()) {
        std::printf("%-28s %8.3f %s\n", LabelOf(spec).c_str(), limit, std::string(result.status().message()).c_str());
        continue;
      }
      const Quality& q = result->quality;
      std::printf("%-28s %8.3f %7d %7zu %7.4f %7.2f %7.2f %7.1f %7.2f %7.4f %7lld %8.3f %8.3f %8.3f\n",
                  LabelOf(spec).c_str(), limit, first, result->charts.size(), q.stretch_l2, q.seam_length,
                  q.visible_seam_length, q.seam_turn_deg, q.seam_symmetry.value_or(0), q.packing_efficiency,
                  static_cast<long long>(q.overlapping + q.flipped + q.degenerate),
                  static_cast<double>(charts) / CLOCKS_PER_SEC, static_cast<double>(packing) / CLOCKS_PER_SEC, seconds);
      std::fflush(stdout);
    }
  }
  return 0;
}

}  // namespace
}  // namespace planish::bench

int main(int argc, char** argv) {
  return planish::bench::Main(argc, argv);
}
