// The progress bar as text: what a person sees.
#include "client/cli/progress_bar.h"

#include "client/cli/progress_lines.h"
#include "client/cli/text_width.h"
#include "gtest/gtest.h"

namespace planish::cli {
namespace {

Terminal Ascii(int width) {
  Terminal terminal;
  terminal.width = width;
  return terminal;
}

Terminal Utf8(int width) {
  Terminal terminal = Ascii(width);
  terminal.utf8 = true;
  return terminal;
}

BarState Solving() {
  BarState state;
  state.stage = Stage::kSolve;
  state.newton_iteration = 3;
  state.linear_iterations = 1234;
  state.residuals = {1e-1, 1e-2, 1e-3, 1e-5};
  state.tolerance = 1e-9;
  state.elapsed_seconds = 3.21;
  return state;
}

TEST(ProgressBarTest, SolvingInUtf8) {
  EXPECT_EQ(RenderBar(Solving(), Utf8(120), 2),
            "⠹ solve     ████████████████················  1.0e-05 → 1.0e-09  █▇▆▅  newton 3  1,234 linear  3.2 s");
}

TEST(ProgressBarTest, SolvingInAscii) {
  EXPECT_EQ(RenderBar(Solving(), Ascii(120), 1),
            "/ solve     [################................]  1.0e-05 -> 1.0e-09  newton 3  1,234 linear  3.2 s");
}

TEST(ProgressBarTest, NarrowTerminalsDropWhatMattersLeast) {
  EXPECT_EQ(RenderBar(Solving(), Utf8(80), 0),
            "⠋ solve     █████▌·····  1.0e-05 → 1.0e-09  █▇▆▅  newton 3  1,234 linear  3.2 s");
  EXPECT_EQ(RenderBar(Solving(), Utf8(60), 0), "⠋ solve     █████▌·····  1.0e-05 → 1.0e-09  newton 3  3.2 s");
  EXPECT_EQ(RenderBar(Solving(), Utf8(40), 0), "⠋ solve     █████·····  newton 3  3.2 s");
  EXPECT_EQ(RenderBar(Solving(), Utf8(20), 0), "⠋ solve     3.2 s");
  for (int width = 1; width < 130; ++width) {
    EXPECT_LT(DisplayWidth(RenderBar(Solving(), Utf8(width), 0)), width) << width;
    EXPECT_LT(DisplayWidth(RenderBar(Solving(), Ascii(width), 0)), width) << width;
  }
}

TEST(ProgressBarTest, ColorsTakeNoRoom) {
  Terminal colored = Utf8(80);
  colored.color = true;
  const std::string line = RenderBar(Solving(), colored, 0);
  EXPECT_NE(line.find("\x1b["), std::string::npos);
  EXPECT_EQ(DisplayWidth(line), DisplayWidth(RenderBar(Solving(), Utf8(80), 0)));
  EXPECT_EQ(RenderBar(Solving(), Utf8(80), 0).find('\x1b'), std::string::npos);
}

TEST(ProgressBarTest, OtherStages) {
  BarState state;
  state.elapsed_seconds = 75;
  EXPECT_EQ(RenderBar(state, Ascii(80), 0), "| upload    [................................]  1:15");
  state.stage = Stage::kQueue;
  state.queue_position = 3;
  EXPECT_EQ(RenderBar(state, Ascii(80), 0), "| queue (3 ahead)  [................................]  1:15");
  state.notice = "connection lost, re-attaching";
  EXPECT_EQ(RenderBar(state, Ascii(60), 0), "| connection lost, re-attaching  [..................]  1:15");
  state = Solving();
  state.stage = Stage::kDownload;
  state.received_bytes = 30;
  state.total_bytes = 40;
  EXPECT_EQ(RenderBar(state, Utf8(50), 0), "⠋ download 75 %  ███████████████  newton 3  3.2 s");
}

TEST(ProgressBarTest, LastLine) {
  BarState state = Solving();
  state.ending = BarState::Ending::kSucceeded;
  EXPECT_EQ(RenderBar(state, Utf8(90), 0),
            "✓ done      ██████████████████████████████  1.0e-05  █▇▆▅  newton 3  1,234 linear  3.21 s");
}

TEST(ProgressBarTest, FractionCountsChartsAndNeverFalls) {
  BarState state;
  Event event;
  event.progress.emplace();
  Progress& progress = *event.progress;
  progress.stage = Stage::kSolve;
  progress.chart_count = 4;
  progress.tolerance = 1e-8;
  progress.chart = 1;
  progress.residual.vertex = 1e-4;
  state.Apply(event);
  EXPECT_NEAR(state.Fraction(), 0.25, 1e-12);
  progress.newton_iteration = 1;
  progress.residual.vertex = 1e-6;
  state.Apply(event);
  EXPECT_NEAR(state.Fraction(), 0.375, 1e-12);
  progress.chart = 0;  // charts may be solved at the same time
  state.Apply(event);
  EXPECT_NEAR(state.Fraction(), 0.375, 1e-12);
  progress.chart = 3;
  state.Apply(event);
  EXPECT_NEAR(state.Fraction(), 0.75, 1e-12);
}

TEST(ProgressBarTest, FractionFollowsTheLogarithmOfTheResidual) {
  BarState state;
  EXPECT_EQ(state.Fraction(), 0);
  state.stage = Stage::kSolve;
  state.tolerance = 1e-9;
  state.residuals = {1e-1};
  EXPECT_EQ(state.Fraction(), 0);
  state.residuals = {1e-1, 1e-5};
  EXPECT_NEAR(state.Fraction(), 0.5, 1e-12);
  state.residuals = {1e-1, 1e-5, 1e-3};  // a step back
  EXPECT_NEAR(state.Fraction(), 0.5, 1e-12);
  state.residuals = {1e-1, 1e-12};
  EXPECT_EQ(state.Fraction(), 1);
  state.residuals = {1e-12};
  EXPECT_EQ(state.Fraction(), 1);
}

TEST(ProgressBarTest, AppliesEvents) {
  BarState state;
  Event event;
  event.job = Job();
  event.job->state = JobState::kQueued;
  event.job->queue_position = 2;
  state.Apply(event);
  EXPECT_EQ(state.stage, Stage::kQueue);
  EXPECT_EQ(state.queue_position, 2);
  event.job->state = JobState::kRunning;
  state.Apply(event);
  EXPECT_EQ(state.stage, Stage::kDecode);
  event = Event();
  event.progress = Progress();
  event.progress->stage = Stage::kSolve;
  event.progress->newton_iteration = 2;  // 0 and 1 were skipped
  event.progress->residual.wheel = 1e-3;
  event.progress->tolerance = 1e-9;
  state.Apply(event);
  EXPECT_EQ(state.residuals, (std::vector<double>{1e-3, 1e-3, 1e-3}));
  EXPECT_EQ(state.tolerance, 1e-9);
}

TEST(ProgressLinesTest, OneLinePerNewtonIteration) {
  Stage stage = Stage::kUnspecified;
  int newton = -1;
  Event event;
  event.progress = Progress();
  event.progress->stage = Stage::kSolve;
  event.progress->newton_iteration = 2;
  event.progress->linear_iterations = 1;
  event.progress->residual.gradient = 2e-4;
  event.progress->tolerance = 1e-9;
  event.progress->elapsed = Seconds(0.5);
  EXPECT_EQ(PlainLine(event, stage, newton),
            "solve: newton 2, residual 2.0e-04 (tolerance 1.0e-09), 1 linear iteration, 0.50 s");
  event.progress->linear_iterations = 50;
  EXPECT_EQ(PlainLine(event, stage, newton), "");
  event.progress->newton_iteration = 3;
  EXPECT_NE(PlainLine(event, stage, newton), "");
  event.progress->stage = Stage::kLayout;
  EXPECT_EQ(PlainLine(event, stage, newton), "layout, 0.50 s");
}

}  // namespace
}  // namespace planish::cli
