// The progress of a job: what it is made of, the bar as text, the lines.
#include "client/cli/progress.h"
#include "client/cli/text.h"
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

JobProgress Solving() {
  JobProgress state;
  state.stage = Stage::kSolve;
  state.newton_iteration = 3;
  state.linear_iterations = 1234;
  state.residuals = {1e-1, 1e-2, 1e-3, 1e-5};
  state.tolerance = 1e-9;
  state.elapsed_seconds = state.worker_began = 3.21;
  state.reached = 0.5;
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
  JobProgress state;
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
  EXPECT_EQ(RenderBar(state, Utf8(50), 0), "⠋ download 75 %  █████████████▏·  newton 3  3.2 s");
}

TEST(ProgressBarTest, LastLine) {
  JobProgress state = Solving();
  state.has_succeeded = true;
  EXPECT_EQ(RenderBar(state, Utf8(90), 0),
            "✓ done      ██████████████████████████████  1.0e-05  █▇▆▅  newton 3  1,234 linear  3.21 s");
}

// What a server told of a job: every change of stage.
struct Told {
  double seconds;
  Stage stage;
  int charts;
};
struct Recorded {
  std::int64_t mesh_bytes;
  double seconds;  // of the worker
  std::vector<Told> told;
};

// Runs on two busy cores with default options.
const Recorded& Koala() {  // 99,994 triangles
  static const Recorded recorded = {
      1160431, 11.848, {{0.000, Stage::kDecode, 0},  {0.027, Stage::kCharts, 1},   {3.936, Stage::kSolve, 7},
                        {5.080, Stage::kLayout, 7},  {5.367, Stage::kCharts, 7},   {5.790, Stage::kSolve, 9},
                        {6.291, Stage::kLayout, 9},  {6.494, Stage::kCharts, 9},   {6.822, Stage::kSolve, 17},
                        {7.582, Stage::kLayout, 17}, {7.727, Stage::kCharts, 17},  {7.825, Stage::kSolve, 18},
                        {7.872, Stage::kLayout, 18}, {7.884, Stage::kCharts, 18},  {7.935, Stage::kSolve, 19},
                        {7.971, Stage::kLayout, 19}, {7.973, Stage::kCharts, 19},  {8.023, Stage::kSolve, 20},
                        {8.029, Stage::kLayout, 20}, {8.039, Stage::kCharts, 20},  {8.077, Stage::kLayout, 21},
                        {8.078, Stage::kCharts, 21}, {8.092, Stage::kSolve, 22},   {8.093, Stage::kLayout, 22},
                        {8.117, Stage::kCharts, 22}, {8.269, Stage::kSolve, 22},   {8.777, Stage::kLayout, 22},
                        {8.856, Stage::kCharts, 22}, {8.924, Stage::kSolve, 22},   {9.068, Stage::kLayout, 22},
                        {9.120, Stage::kCharts, 22}, {9.175, Stage::kSolve, 22},   {9.339, Stage::kLayout, 22},
                        {9.408, Stage::kPack, 17},   {11.670, Stage::kVerify, 17}, {11.848, Stage::kEncode, 17}}};
  return recorded;
}
const Recorded& Corset() {  // 18,324 triangles, 172 charts: packing takes half of the time
  static const Recorded recorded = {
      155626, 0.823, {{0.000, Stage::kDecode, 0},   {0.002, Stage::kCharts, 1},   {0.168, Stage::kSolve, 120},
                      {0.229, Stage::kLayout, 120}, {0.240, Stage::kCharts, 120}, {0.253, Stage::kSolve, 149},
                      {0.264, Stage::kLayout, 149}, {0.272, Stage::kCharts, 149}, {0.273, Stage::kSolve, 157},
                      {0.273, Stage::kLayout, 157}, {0.274, Stage::kCharts, 157}, {0.274, Stage::kSolve, 161},
                      {0.275, Stage::kLayout, 161}, {0.275, Stage::kCharts, 161}, {0.276, Stage::kSolve, 165},
                      {0.276, Stage::kLayout, 165}, {0.284, Stage::kCharts, 165}, {0.293, Stage::kSolve, 187},
                      {0.325, Stage::kLayout, 187}, {0.342, Stage::kCharts, 187}, {0.343, Stage::kSolve, 187},
                      {0.344, Stage::kLayout, 187}, {0.345, Stage::kCharts, 187}, {0.346, Stage::kSolve, 187},
                      {0.346, Stage::kLayout, 187}, {0.347, Stage::kPack, 172},   {0.781, Stage::kVerify, 172},
                      {0.823, Stage::kEncode, 172}}};
  return recorded;
}

Event ToEvent(const Told& told) {
  Event event;
  event.progress.emplace();
  event.progress->stage = told.stage;
  event.progress->chart_count = told.charts;
  event.progress->elapsed = Seconds(told.seconds);
  return event;
}

// Where the bar stands at each hundredth of the job's time, seen by a clock that began `delay` before the worker.
std::vector<double> Fractions(const Recorded& recorded, double delay) {
  JobProgress progress;
  Event running;
  running.job.emplace();
  running.job->state = JobState::kRunning;
  running.job->mesh_bytes = recorded.mesh_bytes;
  progress.elapsed_seconds = delay;
  progress.Apply(running);
  std::vector<double> fractions;
  std::size_t next = 0;
  for (int i = 1; i <= 100; ++i) {
    const double seconds = i * recorded.seconds / 100;
    for (; next < recorded.told.size() && recorded.told[next].seconds <= seconds; ++next) {
      progress.elapsed_seconds = delay + recorded.told[next].seconds;
      progress.Apply(ToEvent(recorded.told[next]));
    }
    progress.elapsed_seconds = delay + seconds;
    fractions.push_back(progress.Fraction());
  }
  return fractions;
}

TEST(ProgressBarTest, GrowsAboutEvenlyWithTimeAndNeverFalls) {
  for (const Recorded* recorded : {&Koala(), &Corset()}) {
    SCOPED_TRACE(recorded->mesh_bytes);
    const std::vector<double> fractions = Fractions(*recorded, 1.5);
    for (std::size_t i = 1; i < fractions.size(); ++i) EXPECT_GE(fractions[i], fractions[i - 1]) << i;
    for (const int percent : {10, 25, 50, 75, 90})
      EXPECT_NEAR(fractions[percent - 1], percent / 100.0, 0.22) << percent;
    EXPECT_LT(fractions.back(), 1) << "the result is yet to come";
  }
}

// The weights are of one machine; what the first phases took tells how fast another one is.
TEST(ProgressBarTest, ASlowMachineMovesTheBarLikeAFastOne) {
  Recorded slow = Koala();
  slow.seconds *= 20;
  for (Told& told : slow.told) told.seconds *= 20;
  const std::vector<double> fractions = Fractions(slow, 0);
  for (std::size_t i = 1; i < fractions.size(); ++i) EXPECT_GE(fractions[i], fractions[i - 1]) << i;
  for (const int percent : {50, 75, 90}) EXPECT_NEAR(fractions[percent - 1], percent / 100.0, 0.22) << percent;
}

TEST(ProgressBarTest, TheDownloadEndsIt) {
  JobProgress progress;
  progress.elapsed_seconds = 10;
  progress.Apply(ToEvent({10, Stage::kEncode, 1}));
  Event succeeded;
  succeeded.job.emplace();
  succeeded.job->state = JobState::kSucceeded;
  progress.Apply(succeeded);
  const double before = progress.Fraction();
  progress.total_bytes = 100;
  progress.received_bytes = 50;
  EXPECT_NEAR(progress.Fraction(), (before + 1) / 2, 1e-12);
  progress.received_bytes = 100;
  EXPECT_EQ(progress.Fraction(), 1);
}

TEST(ProgressBarTest, AJobThatIsSubmittedAnewBeginsAnew) {
  JobProgress progress;
  progress.elapsed_seconds = 10;
  progress.Apply(ToEvent({10, Stage::kPack, 3}));
  EXPECT_GT(progress.Fraction(), 0.5);
  Event queued;
  queued.job.emplace();
  queued.job->state = JobState::kQueued;
  progress.Apply(queued);
  EXPECT_EQ(progress.Fraction(), 0);
}

// The way of a single chart is that of its residual, whatever the time says.
TEST(ProgressBarTest, ASingleChartFollowsItsResidual) {
  JobProgress progress;
  Event running;
  running.job.emplace();
  running.job->state = JobState::kRunning;
  running.job->options.seams = Seams::kNone;
  progress.Apply(running);
  Event event = ToEvent({0, Stage::kSolve, 1});
  event.progress->tolerance = 1e-9;
  double before = 0;
  for (const double residual : {1.0, 1e-1, 1e-2, 1e-4, 1e-8}) {
    event.progress->residual.vertex = residual;
    progress.Apply(event);
    EXPECT_GE(progress.Fraction(), before);
    before = progress.Fraction();
    ++event.progress->newton_iteration;
    event.progress->elapsed = Seconds(progress.elapsed_seconds += 1);
  }
  EXPECT_GT(before, 0.8);
}

TEST(ProgressBarTest, ChartFractionFollowsTheLogarithmOfTheResidual) {
  JobProgress state;
  EXPECT_EQ(state.ChartFraction(), 0);
  state.stage = Stage::kSolve;
  state.tolerance = 1e-9;
  state.residuals = {1e-1};
  EXPECT_EQ(state.ChartFraction(), 0);
  state.residuals = {1e-1, 1e-5};
  EXPECT_NEAR(state.ChartFraction(), 0.5, 1e-12);
  state.residuals = {1e-1, 1e-5, 1e-3};  // a step back
  EXPECT_NEAR(state.ChartFraction(), 0.5, 1e-12);
  state.residuals = {1e-1, 1e-12};
  EXPECT_EQ(state.ChartFraction(), 1);
  state.residuals = {1e-12};
  EXPECT_EQ(state.ChartFraction(), 1);
}

TEST(ProgressBarTest, AppliesEvents) {
  JobProgress state;
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
  LastLine last;
  Event event;
  event.progress = Progress();
  event.progress->stage = Stage::kSolve;
  event.progress->newton_iteration = 2;
  event.progress->linear_iterations = 1;
  event.progress->residual.gradient = 2e-4;
  event.progress->tolerance = 1e-9;
  event.progress->elapsed = Seconds(0.5);
  EXPECT_EQ(PlainLine(event, last),
            "solve: newton 2, residual 2.0e-04 (tolerance 1.0e-09), 1 linear iteration, 0.50 s");
  event.progress->linear_iterations = 50;
  EXPECT_EQ(PlainLine(event, last), "");
  event.progress->newton_iteration = 3;
  EXPECT_NE(PlainLine(event, last), "");
  event.progress->stage = Stage::kLayout;
  EXPECT_EQ(PlainLine(event, last), "layout, 0.50 s");
}

}  // namespace
}  // namespace planish::cli
