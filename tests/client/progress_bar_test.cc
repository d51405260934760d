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
  EXPECT_EQ(RenderBar(state, Utf8(90), 0), "✓ done      ████████████████████████████████  3.21 s");
}

// What a server told of a job: every change of stage, and how far that of charts is.
struct Told {
  double seconds;
  Stage stage;
  int charts;
  double stage_fraction = 0;
};
struct Recorded {
  std::int64_t mesh_bytes;
  double seconds;  // of the worker
  std::vector<Told> told;
};

// Runs on two busy cores with default options.
const Recorded& Koala() {  // 99,994 triangles
  static const Recorded recorded = {
      1160431,
      3.756,
      {{0.000, Stage::kDecode, 0, 0},    {0.041, Stage::kCharts, 1, 0},    {0.132, Stage::kCharts, 1, 0.15},
       {0.307, Stage::kCharts, 1, 0.34}, {0.757, Stage::kCharts, 1, 0.45}, {0.829, Stage::kCharts, 1, 0.52},
       {0.916, Stage::kCharts, 1, 0.63}, {0.937, Stage::kCharts, 1, 0.74}, {1.019, Stage::kCharts, 1, 0.83},
       {1.110, Stage::kCharts, 1, 0.89}, {1.497, Stage::kSolve, 54, 0.92}, {2.244, Stage::kLayout, 54, 0},
       {2.357, Stage::kCharts, 54, 0},   {2.396, Stage::kSolve, 54, 0},    {2.591, Stage::kLayout, 54, 0},
       {2.618, Stage::kCharts, 54, 0},   {2.659, Stage::kSolve, 54, 0},    {2.983, Stage::kLayout, 54, 0},
       {2.997, Stage::kCharts, 54, 0},   {3.003, Stage::kSolve, 54, 0},    {3.010, Stage::kLayout, 54, 0},
       {3.012, Stage::kPack, 48, 0},     {3.627, Stage::kVerify, 48, 0},   {3.756, Stage::kEncode, 48, 0}}};
  return recorded;
}
const Recorded& Corset() {  // 18,324 triangles, 195 charts: packing takes half of the time
  static const Recorded recorded = {
      155626,
      0.890,
      {{0.000, Stage::kDecode, 0, 0},    {0.006, Stage::kCharts, 1, 0},    {0.014, Stage::kCharts, 1, 0.15},
       {0.020, Stage::kCharts, 1, 0.22}, {0.032, Stage::kCharts, 1, 0.29}, {0.038, Stage::kCharts, 1, 0.35},
       {0.041, Stage::kCharts, 1, 0.42}, {0.044, Stage::kCharts, 1, 0.49}, {0.053, Stage::kCharts, 1, 0.55},
       {0.054, Stage::kCharts, 1, 0.61}, {0.055, Stage::kCharts, 1, 0.68}, {0.061, Stage::kCharts, 1, 0.74},
       {0.063, Stage::kCharts, 1, 0.81}, {0.064, Stage::kCharts, 1, 0.87}, {0.141, Stage::kSolve, 195, 0.92},
       {0.192, Stage::kLayout, 195, 0},  {0.232, Stage::kCharts, 195, 0},  {0.259, Stage::kSolve, 205, 0},
       {0.260, Stage::kLayout, 205, 0},  {0.261, Stage::kCharts, 205, 0},  {0.261, Stage::kSolve, 213, 0},
       {0.262, Stage::kLayout, 213, 0},  {0.262, Stage::kCharts, 213, 0},  {0.262, Stage::kSolve, 217, 0},
       {0.262, Stage::kLayout, 217, 0},  {0.264, Stage::kCharts, 217, 0},  {0.266, Stage::kSolve, 217, 0},
       {0.279, Stage::kLayout, 217, 0},  {0.281, Stage::kCharts, 217, 0},  {0.282, Stage::kSolve, 217, 0},
       {0.294, Stage::kLayout, 217, 0},  {0.295, Stage::kCharts, 217, 0},  {0.296, Stage::kSolve, 217, 0},
       {0.298, Stage::kLayout, 217, 0},  {0.299, Stage::kPack, 195, 0},    {0.867, Stage::kVerify, 195, 0},
       {0.890, Stage::kEncode, 195, 0}}};
  return recorded;
}
const Recorded& Net() {  // 488,032 triangles: charts take more than half of the time
  static const Recorded recorded = {
      4758990,
      14.349,
      {{0.000, Stage::kDecode, 0, 0},    {0.324, Stage::kCharts, 1, 0},     {1.533, Stage::kCharts, 1, 0.15},
       {2.479, Stage::kCharts, 1, 0.23}, {2.675, Stage::kCharts, 1, 0.30},  {3.461, Stage::kCharts, 1, 0.37},
       {4.215, Stage::kCharts, 1, 0.43}, {4.605, Stage::kCharts, 1, 0.49},  {4.914, Stage::kCharts, 1, 0.56},
       {5.067, Stage::kCharts, 1, 0.65}, {5.234, Stage::kCharts, 1, 0.73},  {5.710, Stage::kCharts, 1, 0.79},
       {6.694, Stage::kCharts, 1, 0.88}, {8.055, Stage::kSolve, 101, 0.92}, {11.425, Stage::kLayout, 101, 0},
       {11.839, Stage::kCharts, 101, 0}, {11.903, Stage::kSolve, 101, 0},   {12.184, Stage::kLayout, 101, 0},
       {12.242, Stage::kCharts, 101, 0}, {12.254, Stage::kSolve, 101, 0},   {12.280, Stage::kLayout, 101, 0},
       {12.282, Stage::kCharts, 101, 0}, {12.288, Stage::kLayout, 101, 0},  {12.289, Stage::kPack, 95, 0},
       {13.465, Stage::kVerify, 95, 0},  {14.349, Stage::kEncode, 95, 0}}};
  return recorded;
}

Event ToEvent(const Told& told) {
  Event event;
  event.progress.emplace();
  event.progress->stage = told.stage;
  event.progress->chart_count = told.charts;
  event.progress->stage_fraction = told.stage_fraction;
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
  for (const Recorded* recorded : {&Koala(), &Corset(), &Net()}) {
    SCOPED_TRACE(recorded->mesh_bytes);
    const std::vector<double> fractions = Fractions(*recorded, 1.5);
    for (std::size_t i = 1; i < fractions.size(); ++i) EXPECT_GE(fractions[i], fractions[i - 1]) << i;
    for (const int percent : {10, 25, 50, 75, 90})
      EXPECT_NEAR(fractions[percent - 1], percent / 100.0, 0.22) << percent;
    EXPECT_LT(fractions.back(), 1) << "the result is yet to come";
  }
}

// It stood at 7 % at half of the time: nothing was told before the first solve.
TEST(ProgressBarTest, MovesWhileChartsAreMade) {
  JobProgress progress;
  Event running;
  running.job.emplace();
  running.job->state = JobState::kRunning;
  running.job->mesh_bytes = 5'000'000;
  progress.Apply(running);
  for (int percent = 0; percent <= 100; ++percent) {
    const double part = percent / 100.0;
    progress.elapsed_seconds = 60 * part;  // a slow machine
    progress.Apply(ToEvent({60 * part, Stage::kCharts, 1, part}));
    if (percent < 25) continue;
    EXPECT_NEAR(progress.Fraction(), 0.45 * part, 0.1) << percent;
  }
  EXPECT_EQ(RenderBar(progress, Ascii(80), 0).substr(0, 14), "| charts 100 %");
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
