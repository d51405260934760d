// planish_given_seams [FILE...] [--family=NAME...] [--seeds=N] [--first=N] [--faces=N] [--limit=SECONDS]: what
// --seams=needed takes beside --seams=auto, and whether it warns of stretch. A line for each FILE that has UV, whose
// seams are the borders of its UV islands; then the median and the 95th percentile of the ratios of the two times, and
// how many results have a chart that is stretched beyond 2 without a warning that names it. With --family: random
// members of these families (tests/testing/families.h; "all" for every one) with seams of three kinds:
//   none  no seam: what is closed must be slit
//   few   the borders of a map with much stretch, of which a third are missing
//   all   the borders of such a map
// Times are those of one thread's CPU. A run of --seams=needed that takes longer than LIMIT is cancelled and counts as
// that long. Exit code 1 if the median is above 2, the percentile above 6, or a warning is missing.
#include <algorithm>
#include <array>
#include <cstdint>
#include <cstdio>
#include <ctime>
#include <filesystem>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "CLI/CLI.hpp"
#include "core/base/interrupter.h"
#include "core/unwrap/unwrap.h"
#include "tests/bench/bench_meshes.h"
#include "tests/testing/dice.h"
#include "tests/testing/families.h"

namespace planish::bench {
namespace {

constexpr double kStretchToWarnOf = 2, kMostMedian = 2, kMostAt95 = 6;
constexpr double kLeastSeconds = 1e-3;  // shorter times are no measurement

double CpuSeconds() {
  return static_cast<double>(std::clock()) / CLOCKS_PER_SEC;
}

struct Run {
  double seconds = 0;
  absl::StatusOr<UnwrapResult> result;
};

Run TimeUnwrap(const Mesh& mesh, const UnwrapOptions& options, double limit) {
  Interrupter cancel;
  UnwrapControl control;
  control.cancel = &cancel;
  const double begin = CpuSeconds();
  control.on_progress = [&](const UnwrapProgress&) {
    if (CpuSeconds() - begin > limit) cancel.Interrupt();
  };
  absl::StatusOr<UnwrapResult> result = Unwrap(mesh, options, control);
  return {CpuSeconds() - begin, std::move(result)};
}

// Whether each chart with much stretch is named by a warning about stretch, which has the chart, the stretch and words
// on what to do.
bool WarnsOfStretch(const UnwrapResult& result) {
  const auto is_stretched = [](const ChartReport& chart) { return chart.stretch_l2 > kStretchToWarnOf; };
  const auto count = std::count_if(result.charts.begin(), result.charts.end(), is_stretched);
  if (count == 0) return true;
  return std::any_of(result.warnings.begin(), result.warnings.end(), [&](const UnwrapWarning& warning) {
    const auto named = warning.metadata.find("chart_count");
    return warning.reason == "STRETCH_HIGH" && warning.metadata.contains("stretch") &&
           (named == warning.metadata.end() ? count == 1 : std::stoll(named->second) >= count);
  });
}

class Comparison {
 public:
  explicit Comparison(double limit) : limit_(limit) {
    std::printf("%-40s %8s %8s %7s %7s %7s %9s %7s  %s\n", "mesh", "faces", "auto s", "needed", "ratio", "charts",
                "stretch", "median", "warnings");
  }

  void Try(const std::string& name, const Mesh& mesh, const std::vector<std::int32_t>& seam_corners) {
    UnwrapOptions options;
    const Run of_auto = TimeUnwrap(mesh, options, 1e9);
    if (!of_auto.result.ok()) return;
    options.seams.policy = SeamPolicy::kNeeded;
    options.seams.corners = seam_corners;
    const Run needed = TimeUnwrap(mesh, options, limit_);
    const double ratio = std::max(needed.seconds, kLeastSeconds) / std::max(of_auto.seconds, kLeastSeconds);
    ratios_.push_back(ratio);
    std::printf("%-40s %8lld %8.3f %7.3f %7.2f ", name.c_str(), static_cast<long long>(mesh.num_faces()),
                of_auto.seconds, needed.seconds, ratio);
    if (!needed.result.ok()) {
      std::printf(" %s\n", std::string(needed.result.status().message()).c_str());
      std::fflush(stdout);
      return;
    }
    const UnwrapResult& result = *needed.result;
    std::vector<double> stretch;
    for (const ChartReport& chart : result.charts) stretch.push_back(chart.stretch_l2);
    std::sort(stretch.begin(), stretch.end());
    std::printf("%7zu %9.3g %7.3g ", stretch.size(), stretch.back(), stretch[stretch.size() / 2]);
    for (const UnwrapWarning& warning : result.warnings) std::printf(" %s", warning.reason.c_str());
    if (!WarnsOfStretch(result)) {
      ++silent_;
      std::printf(" -- SILENT");
    }
    std::printf("\n");
    std::fflush(stdout);
  }

  int End() {
    if (ratios_.empty()) return 0;
    std::sort(ratios_.begin(), ratios_.end());
    const double median = ratios_[ratios_.size() / 2];
    const double at_95 = ratios_[std::min(ratios_.size() - 1, ratios_.size() * 95 / 100)];
    std::printf("%zu meshes: median %.2f, 95th percentile %.2f, largest %.2f; %d silent about stretch\n",
                ratios_.size(), median, at_95, ratios_.back(), silent_);
    return median > kMostMedian || at_95 > kMostAt95 || silent_ > 0 ? 1 : 0;
  }

 private:
  const double limit_;
  std::vector<double> ratios_;
  int silent_ = 0;
};

// The borders of the charts of a map with much stretch; each is left out with this probability.
std::vector<std::int32_t> BordersOf(const Mesh& mesh, std::uint64_t seed, double left_out) {
  UnwrapOptions options;
  options.seams.max_stretch = 2;
  options.pack = false;
  const absl::StatusOr<UnwrapResult> map = Unwrap(mesh, options, {});
  if (!map.ok()) return {};
  std::vector<std::array<std::int32_t, 4>> borders;  // vertices, chart, corner
  for (std::int32_t c = 0; c < 3 * static_cast<std::int32_t>(mesh.faces.size()); ++c) {
    const Face& face = mesh.faces[c / 3];
    const auto [low, high] = std::minmax({face[(c + 1) % 3], face[(c + 2) % 3]});
    borders.push_back({low, high, map->face_chart[c / 3], c});
  }
  std::sort(borders.begin(), borders.end());
  testing::Dice dice(seed);
  std::vector<std::int32_t> corners;
  for (std::size_t i = 1; i < borders.size(); ++i) {
    const auto& a = borders[i - 1];
    const auto& b = borders[i];
    if (a[0] == b[0] && a[1] == b[1] && a[2] != b[2] && dice.In(0, 1) >= left_out) corners.push_back(a[3]);
  }
  return corners;
}

int Main(int argc, char** argv) {
  CLI::App app("Compares --seams=needed with --seams=auto");
  std::vector<std::string> files, families;
  std::uint64_t first = 1, seeds = 3;
  int faces = 2000;
  double limit = 60;
  app.add_option("--family", families);
  app.add_option("--first", first, "the first seed");
  app.add_option("--seeds", seeds, "so many of each family");
  app.add_option("--faces", faces, "about so many triangles each");
  app.add_option("--limit", limit, "CPU seconds");
  app.add_option("files", files);
  CLI11_PARSE(app, argc, argv);
  if (families == std::vector<std::string>{"all"}) families = testing::Families();
  Comparison comparison(limit);
  for (const std::string& file : files) {
    const std::optional<SeamedMesh> given = ReadWithSeams(file);
    if (!given || !given->has_uv || given->mesh.faces.empty()) continue;
    comparison.Try(std::filesystem::path(file).filename(), given->mesh, given->seam_corners);
  }
  for (const std::string& family : families) {
    for (std::uint64_t seed = first; seed < first + seeds; ++seed) {
      const Mesh mesh = testing::MakeFamily(family, seed, faces);
      if (mesh.faces.empty()) continue;
      const std::string name = family + "-" + std::to_string(seed);
      comparison.Try(name + "-none", mesh, {});
      comparison.Try(name + "-few", mesh, BordersOf(mesh, seed, 1.0 / 3));
      comparison.Try(name + "-all", mesh, BordersOf(mesh, seed, 0));
    }
  }
  return comparison.End();
}

}  // namespace
}  // namespace planish::bench

int main(int argc, char** argv) {
  return planish::bench::Main(argc, argv);
}
