#include "client/cli/summary.h"

#include <algorithm>
#include <map>
#include <utility>
#include <vector>

#include "client/cli/text.h"

namespace planish::cli {
namespace {

constexpr std::size_t kMaxNamedCharts = 3;
constexpr std::size_t kMaxWarningsOfAKind = 3;
constexpr std::size_t kMaxListedCharts = 20;

std::string Join(const std::vector<std::string>& parts, const std::string& last_separator) {
  std::string text;
  for (std::size_t i = 0; i < parts.size(); ++i) {
    if (i > 0) text += i + 1 == parts.size() ? last_separator : ", ";
    text += parts[i];
  }
  return text;
}

std::string Validity(const Quality& quality) {
  std::vector<std::string> bad;
  if (quality.flipped > 0) bad.push_back(Counted(quality.flipped, "flipped triangle", "flipped triangles"));
  if (quality.degenerate > 0) bad.push_back(Counted(quality.degenerate, "degenerate triangle", "degenerate triangles"));
  if (quality.overlapping > 0) bad.push_back(Counted(quality.overlapping, "overlapping pair", "overlapping pairs"));
  return bad.empty() ? "No flipped, degenerate or overlapping triangles" : Join(bad, " and ");
}

// "3 of 120 charts (12, 40 and 77) did not converge"; the largest few are named.
std::string UnconvergedText(const Report& report) {
  std::vector<const ChartReport*> charts;
  for (const ChartReport& chart : report.charts) {
    if (!chart.converged) charts.push_back(&chart);
  }
  std::stable_sort(charts.begin(), charts.end(),
                   [](const ChartReport* a, const ChartReport* b) { return a->triangles > b->triangles; });
  std::vector<std::string> names;
  for (const ChartReport* chart : charts) {
    if (names.size() < kMaxNamedCharts) names.push_back(std::to_string(chart->chart));
  }
  const auto unnamed = report.chart_totals.not_converged - static_cast<std::int64_t>(names.size());
  if (unnamed > 0) names.push_back(WithCommas(unnamed) + " more");
  return WithCommas(report.chart_totals.not_converged) + " of " +
         Counted(report.chart_totals.charts, "chart", "charts") + " (" + Join(names, " and ") + ") did not converge";
}

// "uzawa+amg"
std::string SolverName(const ChartReport& chart) {
  std::string name = ToString(chart.solver);
  if (chart.preconditioner != Preconditioner::kNone && chart.solver != Solver::kDirect) {
    name += std::string("+") + ToString(chart.preconditioner);
  }
  return name;
}

// The solvers in use, those of most triangles first: " (uzawa+amg, uzawa+cholesky)".
std::string SolversText(const std::vector<ChartReport>& charts) {
  std::map<std::string, std::int64_t> triangles;
  for (const ChartReport& chart : charts) triangles[SolverName(chart)] += chart.triangles;
  std::vector<std::pair<std::string, std::int64_t>> ranked(triangles.begin(), triangles.end());
  std::stable_sort(ranked.begin(), ranked.end(), [](const auto& a, const auto& b) { return a.second > b.second; });
  std::vector<std::string> names;
  for (const auto& [name, count] : ranked) names.push_back(name);
  return names.empty() ? "" : " (" + Join(names, ", ") + ")";
}

// What became of the outlines of BOUNDARY_CONVEX: one line, whatever the number of charts.
std::string OutlinesText(const std::vector<ChartReport>& charts) {
  std::int64_t settled = 0, active = 0, vertices = 0;
  for (const ChartReport& chart : charts) {
    if (chart.boundary.boundary != Boundary::kConvex || !chart.boundary.settled) continue;
    ++settled;
    active += chart.boundary.active;
    vertices += chart.boundary.vertices;
  }
  if (settled == 0) return "";
  return (charts.size() == 1 ? "The outline is convex"
                             : "The outlines of " + Counted(settled, "chart", "charts") + " are convex") +
         std::string(": straight at ") + WithCommas(active) + (charts.size() == 1 ? " of its " : " of their ") +
         Counted(vertices, "vertex", "vertices") + ".\n";
}

std::string AtlasText(const Report& report) {
  const Atlas& atlas = report.atlas;
  if (report.chart_totals.charts <= 1 && atlas.tiles <= 1) return "";
  if (!atlas.pack) return "Not packed: charts lie one over the other, at the surface's scale.\n";
  const std::string size = WithCommas(atlas.texture_size);
  return "Packed into " + Counted(atlas.tiles, "tile", "tiles") + " of " + size + " x " + size + " texels, " +
         Fixed(100 * report.quality.packing_efficiency, 0) + " % covered, " +
         Counted(atlas.padding, "texel", "texels") + " between charts, " + Significant(atlas.texels_per_unit, 3) +
         " texels per unit of length.\n";
}

std::string MostStretchedText(const Report& report) {
  if (report.chart_totals.charts <= 1 || report.charts.empty()) return "";
  const auto most =
      std::max_element(report.charts.begin(), report.charts.end(),
                       [](const ChartReport& a, const ChartReport& b) { return a.stretch_l2 < b.stretch_l2; });
  return ", " + Fixed(most->stretch_l2, 2) + " in the worst chart (" + std::to_string(most->chart) + ", " +
         Counted(most->triangles, "triangle", "triangles") + ")";
}

// The largest charts, a line each under a heading.
std::string ChartsText(const Report& report) {
  std::vector<const ChartReport*> charts;
  for (const ChartReport& chart : report.charts) charts.push_back(&chart);
  std::stable_sort(charts.begin(), charts.end(),
                   [](const ChartReport* a, const ChartReport* b) { return a->triangles > b->triangles; });
  if (charts.size() > kMaxListedCharts) charts.resize(kMaxListedCharts);
  std::string text = "CHART  TRIANGLES  SOLVER             NEWTON  LINEAR  RESIDUAL  STRETCH\n";
  for (const ChartReport* chart : charts) {
    text += Padded(std::to_string(chart->chart), 5, true) + "  " + Padded(WithCommas(chart->triangles), 9, true) +
            "  " + Padded(SolverName(*chart), 17) + "  " + Padded(std::to_string(chart->newton_iterations), 6, true) +
            "  " + Padded(WithCommas(chart->linear_iterations), 6, true) + "  " +
            Padded(Scientific(chart->residual.Worst()), 8, true) + "  " + Padded(Fixed(chart->stretch_l2, 3), 7, true) +
            "\n";
  }
  const auto left_out = report.chart_totals.charts - static_cast<std::int64_t>(charts.size());
  if (left_out > 0) text += "(" + Counted(left_out, "smaller chart is", "smaller charts are") + " left out here)\n";
  return text;
}

// What --verbose adds.
std::string Details(const Report& report) {
  const StageTimes& times = report.times;
  std::string text = "Seconds:";
  const auto add = [&](const char* stage, Seconds value) {
    text += (text.back() == ':' ? " " : ", ") + std::string(stage) + " " + Fixed(value.count(), 3);
  };
  add("upload", times.upload);
  add("queue", times.queue);
  add("decode", times.decode);
  add("charts", times.charts);
  add("solve", times.solve);
  add("layout", times.layout);
  add("pack", times.pack);
  add("verify", times.verify);
  add("encode", times.encode);
  add("download", times.download);
  return text + ".\nMemory of the worker: " + Megabytes(report.peak_memory_bytes) + " at most, with " +
         Counted(report.threads, "thread", "threads") + ".\n" + ChartsText(report);
}

// A line each; of many with the same reason the first few, unless `all` are wanted.
std::string WarningsText(const std::vector<Warning>& warnings, bool all, const Terminal& terminal) {
  std::map<std::string, std::size_t> count;
  std::string text;
  const std::string mark = Colored(terminal, "\x1b[33m", "warning:") + " ";
  for (const Warning& warning : warnings) {
    if (++count[warning.reason] <= kMaxWarningsOfAKind || all) {
      text += mark + Printable(warning.message + " [" + warning.reason + "]", true) + "\n";
    }
  }
  for (const auto& [reason, number] : count) {
    if (number <= kMaxWarningsOfAKind || all) continue;
    text += mark + WithCommas(static_cast<std::int64_t>(number - kMaxWarningsOfAKind)) + " more of [" + reason +
            "]; --json has them all\n";
  }
  return text;
}

std::string Hint(const Error& error) {
  if (error.reason() == "SERVER_UNREACHABLE") {
    return "check the address, start a server (planishd --listen=ADDR), or leave out --server to use a private one";
  }
  if (error.reason() == "TLS_FAILED") {
    return "--tls, --tls-ca=PEM, --tls-cert=PEM with --tls-key=PEM and --tls-server-name=NAME say how to connect";
  }
  if (error.code() == ErrorCode::kUnauthenticated) {
    return "say who you are with --token-file=FILE or PLANISH_TOKEN, or with --tls-cert=PEM and --tls-key=PEM";
  }
  if (error.reason() == "PRIVATE_SERVER_FAILED") {
    return "install planishd beside planish, set PLANISHD=/path/to/planishd, or use a running one: --server=ADDR";
  }
  if (error.reason() == "QUEUE_FULL") return "try again later, or another server";
  if (error.reason() == "DEADLINE_EXCEEDED") return "allow more with --timeout=SECONDS";
  return "";
}

}  // namespace

std::string WhyNotUsable(const Report& report) {
  std::vector<std::string> reasons;
  const ChartTotals& totals = report.chart_totals;
  if (totals.not_converged > 0) {
    reasons.push_back(totals.charts == 1 ? "the solve did not converge" : UnconvergedText(report));
  }
  const Quality& quality = report.quality;
  if (quality.flipped > 0) {
    reasons.push_back(Counted(quality.flipped, "triangle is flipped", "triangles are flipped"));
  }
  if (quality.degenerate > 0) {
    reasons.push_back(Counted(quality.degenerate, "triangle has no area", "triangles have no area"));
  }
  return Join(reasons, " and ");
}

std::string Summary(const Report& report, const std::string& output, const Terminal& terminal, bool verbose) {
  const ChartTotals& totals = report.chart_totals;
  std::string text = Colored(terminal, "\x1b[1m", "Flattened " + Counted(report.triangles, "triangle", "triangles")) +
                     " in " + Duration(report.times.total.count()) +
                     (output.empty() || output == "-" ? "" : " into " + Printable(output, true)) + ": " +
                     (totals.charts > 1 ? Counted(totals.charts, "chart", "charts") + ", " : "") +
                     Counted(totals.newton_iterations, "Newton iteration", "Newton iterations") + ", worst residual " +
                     Scientific(totals.residual.Worst()) + SolversText(report.charts) + ".\n";
  text += AtlasText(report);
  text += OutlinesText(report.charts);
  const Quality& quality = report.quality;
  text +=
      Validity(quality) + "; angles off by " + Fixed(quality.angle_error_mean_deg, 2) + " deg on average, " +
      Fixed(quality.angle_error_max_deg, 1) + " at most; stretch " + Fixed(quality.stretch_l2, 2) +
      MostStretchedText(report) +
      (quality.seam_length > 0 ? "; seam length " + Fixed(quality.seam_length, 1) + " (in roots of the area)" : "") +
      ".\n";
  if (verbose) text += Details(report);
  text += WarningsText(report.warnings, verbose, terminal);
  if (const std::string why = WhyNotUsable(report); !why.empty()) {
    text += Colored(terminal, "\x1b[31m", "planish: not usable:") + " " + why +
            (output.empty() ? "" : "; it was written all the same, for you to look at") + "\n";
  }
  return text;
}

std::string ErrorText(const Error& error, const std::string& places, const Terminal& terminal) {
  std::string text = Colored(terminal, "\x1b[31m", "planish: error:") + " " + PrintableLines(error.what(), true);
  if (error.reason() != ToString(error.code())) text += " [" + Printable(error.reason(), true) + "]";
  text += "\n";
  if (!places.empty()) text += "  at " + Printable(places, true) + "\n";
  if (!error.job().empty()) text += "  job " + Printable(error.job(), true) + "\n";
  if (const std::string hint = Hint(error); !hint.empty()) text += "  hint: " + hint + "\n";
  return text;
}

}  // namespace planish::cli
