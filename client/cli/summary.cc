#include "client/cli/summary.h"

#include <algorithm>
#include <vector>

#include "client/cli/numbers.h"

namespace planish::cli {
namespace {

std::string Colored(const Terminal& terminal, const char* color, const std::string& text) {
  return terminal.color ? color + text + "\x1b[0m" : text;
}

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

std::string Hint(const Error& error) {
  if (error.reason() == "SERVER_UNREACHABLE") {
    return "check the address, start a server (planishd --listen=ADDR), or leave out --server to use a private one";
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
  const auto unconverged = std::count_if(report.charts.begin(), report.charts.end(),
                                         [](const ChartReport& chart) { return !chart.converged; });
  if (unconverged > 0) {
    reasons.push_back(report.charts.size() == 1 ? "the solve did not converge"
                                                : Counted(unconverged, "chart", "charts") + " did not converge");
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

std::string Summary(const Report& report, const std::string& output, const Terminal& terminal) {
  int newton = 0;
  double residual = 0;
  for (const ChartReport& chart : report.charts) {
    newton += chart.newton_iterations;
    residual = std::max(residual, chart.residual.Worst());
  }
  std::string solver;
  if (!report.charts.empty()) {
    const ChartReport& chart = report.charts.front();
    solver = std::string(" (") + ToString(chart.solver);
    if (chart.preconditioner != Preconditioner::kNone && chart.solver != Solver::kDirect) {
      solver += std::string("+") + ToString(chart.preconditioner);
    }
    solver += ")";
  }
  std::string text = Colored(terminal, "\x1b[1m", "Flattened " + Counted(report.triangles, "triangle", "triangles")) +
                     " in " + Duration(report.seconds.total) +
                     (output.empty() || output == "-" ? "" : " into " + output) + ": " +
                     Counted(newton, "Newton iteration", "Newton iterations") + ", worst residual " +
                     Scientific(residual) + solver + ".\n";
  for (const ChartReport& chart : report.charts) {
    if (chart.boundary.boundary != Boundary::kConvex || !chart.boundary.settled) continue;
    text += "The outline is convex: straight at " + WithCommas(chart.boundary.active) + " of its " +
            Counted(chart.boundary.vertices, "vertex", "vertices") + ".\n";
  }
  const Quality& quality = report.quality;
  text += Validity(quality) + "; angles off by " + Fixed(quality.angle_error_mean_deg, 2) + " deg on average, " +
          Fixed(quality.angle_error_max_deg, 1) + " at most; stretch " + Fixed(quality.stretch_l2, 2) + ".\n";
  for (const Warning& warning : report.warnings) {
    text += Colored(terminal, "\x1b[33m", "warning:") + " " + warning.message + " [" + warning.reason + "]\n";
  }
  if (const std::string why = WhyNotUsable(report); !why.empty()) {
    text += Colored(terminal, "\x1b[31m", "planish: not usable:") + " " + why +
            (output.empty() ? "" : "; it was written all the same, for you to look at") + "\n";
  }
  return text;
}

std::string ErrorText(const Error& error, const std::string& places, const Terminal& terminal) {
  std::string text = Colored(terminal, "\x1b[31m", "planish: error:") + " " + error.what();
  if (error.reason() != ToString(error.code())) text += " [" + error.reason() + "]";
  text += "\n";
  if (!places.empty()) text += "  at " + places + "\n";
  if (!error.job().empty()) text += "  job " + error.job() + "\n";
  if (const std::string hint = Hint(error); !hint.empty()) text += "  hint: " + hint + "\n";
  return text;
}

}  // namespace planish::cli
