// What a person reads of a result or an error.
#include <sstream>
#include <string>

#include "client/cli/exit_codes.h"
#include "client/cli/results.h"
#include "client/cli/text.h"
#include "gmock/gmock.h"
#include "gtest/gtest.h"

namespace planish::cli {
namespace {

using ::testing::HasSubstr;

Report GoodReport() {
  Report report;
  report.triangles = 23062;
  report.times.total = Seconds(0.82);
  ChartReport chart;
  chart.solver = Solver::kUzawa;
  chart.preconditioner = Preconditioner::kCholesky;
  chart.converged = true;
  chart.newton_iterations = 8;
  chart.residual.vertex = 3e-12;
  report.charts = {chart};
  report.chart_totals = {1, 0, 8, 0, chart.residual, 1.897, {}};
  report.atlas = {true, 1024, 2, 1, 341.2};
  report.atlas.padding_kept = 2;
  report.quality.angle_error_mean_deg = 1.204;
  report.quality.angle_error_max_deg = 33.96;
  report.quality.stretch_l2 = 1.897;
  report.quality.packing_efficiency = 0.64;
  report.quality.seam_length = 12.34;
  report.quality.visible_seam_length = 9.87;
  report.quality.seam_turn_deg = 31.4;
  report.quality.seam_symmetry = 0.567;
  return report;
}

TEST(SummaryTest, UsableResult) {
  EXPECT_EQ(Summary(GoodReport(), {.output = "out.obj"}, Terminal()),
            "Flattened 23,062 triangles in 0.82 s into out.obj: 1 chart.\n"
            "Packed into 1 tile of 1,024 x 1,024 texels: 64 % of them used, 341 texels per unit of length.\n"
            "Stretch 1.90; angles off by 1.20 degrees on average, 34.0 at most.\n"
            "Seams are 12.3 times as long as the root of the surface's area, 9.9 of that in view; they turn by 31 "
            "degrees from "
            "edge to edge; 57 % have their mirror image.\n"
            "No flipped, degenerate or overlapping triangles.\n");
}

TEST(SummaryTest, TellsWhatAPrivateServerTookToStart) {
  EXPECT_THAT(Summary(GoodReport(), {.start_seconds = 0.31}, Terminal()),
              HasSubstr("in 0.82 s (0.31 s to start the private server): 1 chart.\n"));
}

// A summary said "2 texels between charts" beside a warning that there was no room for them.
TEST(SummaryTest, TellsThePaddingThatIsThere) {
  Report report = GoodReport();
  report.chart_totals.charts = 12;
  EXPECT_THAT(Summary(report, {}, Terminal()), HasSubstr(", 2 texels between charts, "));
  report.atlas.padding_kept = 0.625;
  EXPECT_THAT(Summary(report, {}, Terminal()), HasSubstr(", 0.625 texels of the 2 asked for between charts, "));
}

TEST(SummaryTest, ATerminalGetsLinesThatEndBetweenWords) {
  Terminal terminal;
  terminal.is_tty = true;
  terminal.width = 40;
  Report report = GoodReport();
  report.warnings.push_back({"SOME_REASON", "a sentence of several words that says what there is to know", {}});
  const std::string text = Summary(report, {.output = "out.obj"}, terminal);
  std::istringstream lines(text);
  std::string joined;
  for (std::string line; std::getline(lines, line);) {
    EXPECT_LE(DisplayWidth(line), 40) << line;
    joined += (line.starts_with("  ") ? line.substr(1) : (joined.empty() ? "" : "\n") + line);
  }
  EXPECT_EQ(joined + "\n", Summary(report, {.output = "out.obj"}, Terminal()));
  EXPECT_EQ(Wrapped("a b\n\nc", 1), "a\n  b\n\nc");
  EXPECT_EQ(Wrapped("a-word-that-is-too-long b\n", 6), "a-word-that-is-too-long\n  b\n");
  EXPECT_EQ(Wrapped("\x1b[31mone\x1b[0m two", 7), "\x1b[31mone\x1b[0m two") << "colours have no width";
  EXPECT_EQ(Wrapped("  at  x", 7), "  at  x");
}

TEST(SummaryTest, VerboseHasStagesTheLargestChartsAndEveryWarning) {
  Report report = GoodReport();
  report.times.solve = Seconds(0.25);
  report.peak_memory_bytes = 84'000'000;
  report.threads = 2;
  report.charts[0].triangles = 18062;
  for (int i = 1; i < 30; ++i) {
    ChartReport chart = report.charts[0];
    chart.chart = i;
    chart.triangles = i;
    report.charts.push_back(chart);
    report.warnings.push_back({"NOT_CONVERGED", "chart " + std::to_string(i) + " is slow", {}});
  }
  report.chart_totals.charts = 30;
  const std::string text = Summary(report, {.verbose = true}, Terminal());
  EXPECT_THAT(text, HasSubstr("Solved in 8 Newton iterations, worst residual 3.0e-12 (uzawa+cholesky).\n"));
  EXPECT_THAT(text, HasSubstr("Seconds: upload 0.000, queue 0.000, decode 0.000, charts 0.000, solve 0.250, "));
  EXPECT_THAT(text, HasSubstr("Memory of the worker: 84 MB at most, with 2 threads.\n"
                              "CHART  TRIANGLES  SOLVER             NEWTON  LINEAR  RESIDUAL  STRETCH\n"
                              "    0     18,062  uzawa+cholesky          8       0   3.0e-12    1.000\n"
                              "   29         29  uzawa+cholesky "));
  EXPECT_THAT(text, HasSubstr("(10 smaller charts are left out here)\n"));
  EXPECT_THAT(text, HasSubstr("warning: chart 29 is slow [NOT_CONVERGED]\n"));
}

TEST(SummaryTest, SaysWhatBecameOfTheOutline) {
  Report report = GoodReport();
  report.charts[0].boundary = {Boundary::kConvex, 1616, 610, 6, true};
  EXPECT_THAT(Summary(report, {}, Terminal()),
              HasSubstr("mirror image.\nThe outline is convex: straight at 610 of its 1,616 vertices.\nNo flipped"));
  report.charts[0].boundary.settled = false;
  EXPECT_THAT(Summary(report, {}, Terminal()), ::testing::Not(HasSubstr("convex")));
}

TEST(SummaryTest, WarningsAndUnusableResult) {
  Report report = GoodReport();
  report.charts[0].converged = false;
  report.chart_totals.not_converged = 1;
  report.quality.flipped = 1;
  report.quality.overlapping = 12;
  report.warnings.push_back({"UV_FLIPPED", "1 UV triangle is flipped", {}});
  const std::string text = Summary(report, {.output = "out.obj"}, Terminal());
  EXPECT_THAT(text, HasSubstr("\n1 flipped triangle and 12 overlapping pairs.\n"));
  EXPECT_THAT(text, HasSubstr("warning: 1 UV triangle is flipped [UV_FLIPPED]\n"));
  EXPECT_THAT(text, HasSubstr("planish: not usable: the solve did not converge and 1 triangle is flipped; it was "
                              "written all the same"));
}

TEST(SummaryTest, ManyChartsMakeNoLongerText) {
  Report report = GoodReport();
  for (int i = 1; i < 1024; ++i) {
    ChartReport chart = report.charts[0];
    chart.chart = i;
    chart.triangles = 5000 - i;
    chart.stretch_l2 = i == 77 ? 1.31 : 1.01;
    chart.converged = i % 100 != 0;
    chart.preconditioner = i < 10 ? Preconditioner::kAmg : Preconditioner::kCholesky;
    chart.boundary = {Boundary::kConvex, 40, 10, 1, true};
    report.charts.push_back(chart);
    report.warnings.push_back({"NOT_CONVERGED", "chart " + std::to_string(i) + " is slow", {}});
  }
  report.chart_totals = {5000, 12, 40000, 0, report.charts[0].residual, 1.31, {}};
  report.atlas.tiles = 2;
  report.quality.packing_efficiency = 0.784;
  EXPECT_EQ(Summary(report, {.output = "out.obj"}, Terminal()),
            "Flattened 23,062 triangles in 0.82 s into out.obj: 5,000 charts.\n"
            "Packed into 2 tiles of 1,024 x 1,024 texels: 78 % of them used, 2 texels between charts, 341 texels per "
            "unit of length.\n"
            "Stretch 1.90, 1.31 in the worst chart (77, 4,923 triangles); angles off by 1.20 degrees on average, 34.0 "
            "at most.\n"
            "Seams are 12.3 times as long as the root of the surface's area, 9.9 of that in view; they turn by 31 "
            "degrees from "
            "edge to edge; 57 % have their mirror image.\n"
            "The outlines of 1,023 charts are convex: straight at 10,230 of their 40,920 vertices.\n"
            "No flipped, degenerate or overlapping triangles.\n"
            "warning: chart 1 is slow [NOT_CONVERGED]\n"
            "warning: chart 2 is slow [NOT_CONVERGED]\n"
            "warning: chart 3 is slow [NOT_CONVERGED]\n"
            "warning: 1,020 more of [NOT_CONVERGED]; --json has them all\n"
            "planish: not usable: 12 of 5,000 charts (100, 200, 300 and 9 more) did not converge; it was written all "
            "the same, for you to look at\n");
  report.atlas.pack = false;
  EXPECT_THAT(Summary(report, {}, Terminal()), HasSubstr("Not packed: the charts lie on top of each other"));
}

TEST(SummaryTest, ErrorSaysWhatWhereAndWhatToDo) {
  EXPECT_EQ(ErrorText(Error(ErrorCode::kInvalidArgument, "MESH_FACE_DEGENERATE", "1 face has no area"),
                      "face 12 (in.obj:345)", Terminal()),
            "planish: error: 1 face has no area [MESH_FACE_DEGENERATE]\n  at face 12 (in.obj:345)\n");
  EXPECT_THAT(ErrorText(Error(ErrorCode::kUnavailable, "SERVER_UNREACHABLE", "x"), "", Terminal()), HasSubstr("hint:"));
  // Servers and files cannot write to the terminal.
  EXPECT_EQ(ErrorText(Error(ErrorCode::kInternal, "A\x1b[2J", "no\x1b]0;x\x07"), "b\x1b[1m.obj:3", Terminal()),
            "planish: error: no?]0;x? [A?[2J]\n  at b?[1m.obj:3\n");
  EXPECT_EQ(ExitCodeOf(Error(ErrorCode::kResourceExhausted, "QUEUE_FULL", "x")), 3);
}

}  // namespace
}  // namespace planish::cli
