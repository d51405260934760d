// A batch as people see it: bars, the table, the exit code; and how many of its files are in flight.
#include <atomic>
#include <sstream>
#include <thread>

#include "client/cli/batch_job.h"
#include "client/cli/batch_table.h"
#include "client/cli/progress.h"
#include "client/cli/progress_view.h"
#include "client/cli/results.h"
#include "client/cli/text.h"
#include "gmock/gmock.h"
#include "gtest/gtest.h"

namespace planish::cli {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::Not;

Terminal Screen(int width, int height, bool utf8 = true) {
  Terminal terminal;
  terminal.is_tty = true;
  terminal.utf8 = utf8;
  terminal.width = width;
  terminal.height = height;
  return terminal;
}

ProgressState TwoJobs() {
  ProgressState state;
  state.jobs_in_all = 12;
  state.ended = 3;
  state.bad = 1;
  state.elapsed_seconds = 4.12;
  JobProgress solving;
  solving.stage = Stage::kSolve;
  solving.newton_iteration = 3;
  solving.residuals = {1e-1, 1e-2, 1e-3, 1e-5};
  solving.tolerance = 1e-9;
  solving.elapsed_seconds = solving.worker_began = 3.21;
  solving.reached = 0.5;
  JobProgress queued;
  queued.stage = Stage::kQueue;
  queued.queue_position = 2;
  queued.elapsed_seconds = 0.4;
  state.jobs = {{"b.obj", solving}, {"props/lamp.glb", queued}};
  return state;
}

TEST(BatchBarsTest, LinePerJob) {
  EXPECT_THAT(RenderBatch(TwoJobs(), Screen(100, 24), 2),
              ElementsAre("b.obj           ⠹ solve     ██████████████▌··············  1.0e-05 → 1.0e-09  █▇▆▅  "
                          "newton 3  3.2 s",
                          "props/lamp.glb  ⠹ queue (2 ahead)  ································  0.4 s",
                          "3 of 12 files, 1 failed or not usable, 2 in flight, 4.1 s"));
}

TEST(BatchBarsTest, FitsAnyTerminal) {
  ProgressState state = TwoJobs();
  state.jobs.push_back({"a/very/long/way/down/to/a/file/of/the/name/文件/文件/文件.obj", JobProgress()});
  for (int height = 1; height < 8; ++height) {
    for (int width = 1; width < 150; ++width) {
      for (const bool utf8 : {true, false}) {
        const auto lines = RenderBatch(state, Screen(width, height, utf8), 0);
        EXPECT_LE(static_cast<int>(lines.size()), std::max(1, height - 1));
        for (const std::string& line : lines) EXPECT_LT(DisplayWidth(line), width) << line;
      }
    }
  }
  EXPECT_THAT(RenderBatch(state, Screen(100, 3), 0).back(), HasSubstr("3 in flight (2 not shown)"));
  EXPECT_THAT(RenderBatch(state, Screen(60, 9), 0)[2], HasSubstr("…"));
}

TEST(BatchBarsTest, RepaintsOverWhatStands) {
  EXPECT_EQ(Repaint({}, {}, {"one", "two"}, Screen(80, 24)), "\rone\x1b[K\ntwo\x1b[K\n\x1b[J");
  EXPECT_EQ(Repaint({"one", "two"}, {"end"}, {"two"}, Screen(80, 24)), "\r\x1b[2Aend\x1b[K\ntwo\x1b[K\n\x1b[J");
  // Made narrower, the terminal has broken a line of 30 columns in three.
  EXPECT_THAT(Repaint({std::string(30, 'x'), "two"}, {}, {"a"}, Screen(12, 24)), HasSubstr("\x1b[4A"));
  EXPECT_THAT(Repaint({std::string(30, 'x'), "two"}, {}, {"a"}, Screen(12, 3)), HasSubstr("\x1b[2A"));
}

// What a terminal that nothing scrolls off shows after `text`: rows, without trailing empty ones.
std::vector<std::string> Shown(const std::string& text) {
  std::vector<std::string> rows(1);
  std::size_t row = 0, column = 0;
  for (std::size_t i = 0; i < text.size(); ++i) {
    if (text[i] == '\r') {
      column = 0;
    } else if (text[i] == '\n') {
      column = 0;
      if (++row == rows.size()) rows.emplace_back();
    } else if (text[i] == '\x1b') {
      const std::size_t end = text.find_first_not_of("[0123456789", i + 1);
      const std::string number = text.substr(i + 2, end - i - 2);
      if (text[end] == 'A') row -= std::stoul(number);
      if (text[end] == 'K' || text[end] == 'J') rows[row].resize(column);
      if (text[end] == 'J') rows.resize(row + 1);
      i = end;
    } else {
      if (rows[row].size() <= column) rows[row].resize(column + 1, ' ');
      rows[row][column++] = text[i];
    }
  }
  while (!rows.empty() && rows.back().empty()) rows.pop_back();
  return rows;
}

TEST(BatchBarsTest, EndedLinesStayAboveTheLiveOnes) {
  const Terminal screen = Screen(40, 24);
  std::string text = "before\n" + Repaint({}, {}, {"a 10 %", "b 10 %", "0 of 3"}, screen);
  EXPECT_THAT(Shown(text), ElementsAre("before", "a 10 %", "b 10 %", "0 of 3"));
  text += Repaint({"a 10 %", "b 10 %", "0 of 3"}, {"a ok"}, {"b 9 %", "c", "1 of 3"}, screen);
  EXPECT_THAT(Shown(text), ElementsAre("before", "a ok", "b 9 %", "c", "1 of 3"));
  text += Repaint({"b 9 %", "c", "1 of 3"}, {"b ok", "c ok"}, {}, screen);
  EXPECT_THAT(Shown(text), ElementsAre("before", "a ok", "b ok", "c ok"));
}

TEST(ProgressJsonTest, EveryEventHasTheFraction) {
  TerminalArguments terminal;
  terminal.progress = ProgressMode::kJson;
  Event event;
  event.progress.emplace();
  event.progress->stage = Stage::kPack;
  event.progress->elapsed = Seconds(3);
  ::testing::internal::CaptureStderr();
  const auto view = NewProgressView(terminal, {"a.obj"}, /*is_batch=*/false);
  view->Begin(0);
  view->OnEvent(0, event);
  view->Say("a line");
  view->Finish();
  std::istringstream lines(::testing::internal::GetCapturedStderr());
  std::string line, note;
  ASSERT_TRUE(std::getline(lines, line) && std::getline(lines, note));
  const Json told = Json::parse(line);
  EXPECT_EQ(told["progress"]["stage"], "pack");
  EXPECT_GT(told["fraction"], 0.5);
  EXPECT_LT(told["fraction"], 1);
  EXPECT_FALSE(told.contains("file"));
  EXPECT_EQ(Json::parse(note), Json({{"note", "a line"}}));
}

std::vector<BatchRow> Rows() {
  BatchRow good;
  good.name = "props/lamp.obj";
  good.result = BatchResult::kUsable;
  good.triangles = 23062;
  good.charts = 12;
  good.seconds = 0.82;
  BatchRow kept = good;
  kept.name = "b.obj";
  kept.kept = true;
  BatchRow flipped = good;
  flipped.name = "c.obj";
  flipped.result = BatchResult::kNotUsable;
  flipped.message = "1 triangle is flipped";
  flipped.exit_code = kFailed;
  BatchRow bad;
  bad.name = "bad\x1b[2J.obj";
  bad.result = BatchResult::kFailed;
  bad.reason = "FILE_MALFORMED";
  bad.message = "bad.obj:2: no number";
  bad.exit_code = kUsage;
  return {good, kept, flipped, bad};
}

TEST(BatchBarsTest, LeavesOnlyWhatEnded) {
  ::testing::internal::CaptureStderr();
  {
    TerminalArguments terminal;
    terminal.progress = ProgressMode::kBar;
    const auto bars = NewProgressView(terminal, {"props/lamp.obj", "b.obj", "c.obj"}, /*is_batch=*/true);
    for (std::size_t file = 0; file < 3; ++file) bars->Begin(file);
    Event event;
    event.progress.emplace();
    event.progress->stage = Stage::kSolve;
    bars->OnEvent(2, event);
    bars->OnNotice(1, "the queue is full, waiting");
    for (std::size_t file = 0; file < 3; ++file) bars->End(file, Rows()[file]);
    bars->Finish();
  }
  const std::vector<std::string> shown = Shown(::testing::internal::GetCapturedStderr());
  ASSERT_EQ(shown.size(), 2u) << "of what was done before only the totals tell";
  EXPECT_THAT(shown[0], HasSubstr("props/lamp.obj  23,062 triangles, 12 charts, 0.82 s"));
  EXPECT_THAT(shown[1], HasSubstr("c.obj  23,062 triangles, 12 charts, 0.82 s; not usable: 1 triangle is flipped"));
}

TEST(BatchTableTest, EveryFileAndTheTotals) {
  EXPECT_EQ(BatchTable(Rows(), TotalsOf(Rows(), 2.5), Terminal()),
            "FILE            TRIANGLES  CHARTS  SECONDS  RESULT\n"
            "props/lamp.obj     23,062      12     0.82  ok\n"
            "b.obj              23,062      12     0.82  ok, done before\n"
            "c.obj              23,062      12     0.82  not usable: 1 triangle is flipped\n"
            "bad?[2J.obj             -       -        -  failed: FILE_MALFORMED\n"
            "4 files: 2 usable, 1 not usable, 1 failed (1 done before); 69,186 triangles in 2.50 s.\n");
  EXPECT_EQ(RowLine(Rows()[0], Terminal()), "+ props/lamp.obj  23,062 triangles, 12 charts, 0.82 s");
  EXPECT_EQ(RowLine(Rows()[3], Terminal()), "x bad?[2J.obj  bad.obj:2: no number [FILE_MALFORMED]");
}

TEST(BatchTableTest, LongOnesNameOnlyWhatWentWrong) {
  std::vector<BatchRow> rows(kMostBatchRows, Rows()[0]);
  rows.push_back(Rows()[3]);
  const std::string table = BatchTable(rows, TotalsOf(rows, 1), Terminal());
  EXPECT_THAT(table, Not(HasSubstr("lamp")));
  EXPECT_THAT(table,
              HasSubstr("FILE_MALFORMED\n(100 usable files are left out here; --json has them all)\n101 files: "));
}

TEST(BatchTableTest, NamesAreCutOnATerminal) {
  std::vector<BatchRow> rows = {Rows()[0]};
  rows[0].name = std::string(100, 'x') + ".obj";
  EXPECT_THAT(BatchTable(rows, TotalsOf(rows, 1), Screen(60, 24)), HasSubstr("…xxx"));
  EXPECT_THAT(BatchTable(rows, TotalsOf(rows, 1), Terminal()), HasSubstr(rows[0].name));
}

TEST(BatchTableTest, ExitCodes) {
  const std::vector<BatchRow> rows = Rows();
  EXPECT_EQ(BatchExitCode({rows[0], rows[1]}, false, false), kOk);
  EXPECT_EQ(BatchExitCode({rows[0], rows[2]}, false, false), kFailed);
  EXPECT_EQ(BatchExitCode({rows[0], rows[3]}, false, false), kFailed);
  EXPECT_EQ(BatchExitCode({rows[3], rows[3]}, false, false), kUsage) << "nothing could be read";
  EXPECT_EQ(BatchExitCode({rows[0]}, false, true), kServerUnreachable);
  EXPECT_EQ(BatchExitCode({rows[0]}, true, true), kInterrupted);
}

TEST(TextWidthTest, WideCharactersAndControls) {
  EXPECT_EQ(DisplayWidth("a文b"), 4);
  EXPECT_EQ(DisplayWidth("\x1b[31mé\x1b[0m"), 1);
  EXPECT_EQ(Printable("a\nb\x7f\xc2\x9b\xff é文", true), "a?b??? é文");
  EXPECT_EQ(Printable("é.obj", false), "?.obj");
  EXPECT_EQ(CutToWidth("path/文文.obj", 8, true), "…文.obj");
  EXPECT_EQ(CutToWidth("path/to.obj", 8, false), "..to.obj");
  EXPECT_EQ(CutToWidth("short", 8, true), "short");
  EXPECT_EQ(Padded("文", 4), "文  ");
  // An accent that combines takes no column and is never cut from its letter; emoji take two.
  EXPECT_EQ(DisplayWidth("e\u0301"), 1);
  EXPECT_EQ(DisplayWidth("🎲.obj"), 6);
  EXPECT_EQ(CutToWidth("path/e\u0301x.obj", 7, true), "…e\u0301x.obj");
  EXPECT_EQ(CutToWidth("path/e\u0301x.obj", 6, true), "…x.obj");
  // What turns the direction of writing could show another name than there is; a torn character is no name at all.
  EXPECT_EQ(Printable("a\u202ejbo.exe", true), "a?jbo.exe");
  EXPECT_EQ(Printable("a\xff\x80\xe6\x96", true), "a????");
}

TEST(BatchFlightTest, FollowsTheServer) {
  BatchFlight flight(4, 1000);
  EXPECT_EQ(flight.limit(), 6);
  for (int i = 0; i < 6; ++i) flight.OnDone(0);
  EXPECT_EQ(flight.limit(), 6) << "the first jobs say nothing: they had the workers for themselves";
  flight.OnDone(1);
  EXPECT_EQ(flight.limit(), 6);
  flight.OnDone(0);
  EXPECT_EQ(flight.limit(), 7);
  for (int i = 0; i < 100; ++i) flight.OnDone(0);
  EXPECT_EQ(flight.limit(), flight.most());
  for (int i = 0; i < 4; ++i) EXPECT_TRUE(flight.Enter(1));
  flight.OnQueueFull();
  EXPECT_EQ(flight.limit(), 3);
  for (int i = 0; i < 100; ++i) flight.OnQueueFull();
  EXPECT_EQ(flight.limit(), 1);
}

TEST(BatchFlightTest, BoundsFilesAndBytes) {
  BatchFlight flight(2, 100);
  std::atomic<int> inside = 0, most = 0;
  {
    std::vector<std::jthread> threads;
    for (int t = 0; t < 16; ++t) {
      threads.emplace_back([&] {
        if (!flight.Enter(40)) return;
        const int now = ++inside;
        for (int seen = most; seen < now && !most.compare_exchange_weak(seen, now);) continue;
        std::this_thread::yield();
        --inside;
        flight.Leave(40);
      });
    }
  }
  EXPECT_LE(most, 2) << "80 of 100 bytes";
  EXPECT_TRUE(flight.Enter(1000)) << "alone, anything goes";
  std::atomic<bool> entered = true;
  std::jthread waiting([&] { entered = flight.Enter(1); });
  flight.Stop();
  waiting.join();
  EXPECT_FALSE(entered);
}

}  // namespace
}  // namespace planish::cli
