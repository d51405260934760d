#include "client/cli/progress_bar.h"

#include <unistd.h>

#include <algorithm>
#include <array>
#include <cmath>

#include "client/cli/numbers.h"
#include "client/cli/text_width.h"

namespace planish::cli {
namespace {

constexpr std::size_t kSparklineLength = 16;
constexpr int kLongestBar = 32;
constexpr int kShortestBar = 8;

const char kBold[] = "\x1b[1m";
const char kDim[] = "\x1b[2m";
const char kCyan[] = "\x1b[36m";
const char kGreen[] = "\x1b[32m";
const char kRed[] = "\x1b[31m";
const char kYellow[] = "\x1b[33m";

std::string Repeat(const std::string& text, int count) {
  std::string result;
  for (int i = 0; i < count; ++i) result += text;
  return result;
}

std::string Mark(const BarState& state, const Terminal& terminal, int frame) {
  if (state.ending == BarState::Ending::kSucceeded) return Colored(terminal, kGreen, terminal.utf8 ? "✓" : "+");
  if (state.ending == BarState::Ending::kFailed) return Colored(terminal, kRed, terminal.utf8 ? "✗" : "x");
  static constexpr std::array<const char*, 10> kDots = {"⠋", "⠙", "⠹", "⠸", "⠼", "⠴", "⠦", "⠧", "⠇", "⠏"};
  static constexpr std::array<const char*, 4> kTurns = {"|", "/", "-", "\\"};
  const auto at = static_cast<std::size_t>(frame);
  return Colored(terminal, kCyan, terminal.utf8 ? kDots[at % kDots.size()] : kTurns[at % kTurns.size()]);
}

std::string StageText(const BarState& state) {
  if (state.ending == BarState::Ending::kSucceeded) return "done";
  if (!state.notice.empty()) return state.notice;
  if (state.stage == Stage::kQueue && state.queue_position > 0) {
    return "queue (" + std::to_string(state.queue_position) + " ahead)";
  }
  if (state.stage == Stage::kDownload && state.total_bytes > 0) {
    return "download " + std::to_string(100 * state.received_bytes / state.total_bytes) + " %";
  }
  std::string text = ToString(state.stage);
  if (state.chart_count > 1) {
    text += " " + std::to_string(state.chart + 1) + "/" + std::to_string(state.chart_count);
  }
  return text;
}

std::string Bar(const BarState& state, const Terminal& terminal, int width) {
  const double filled = state.Fraction() * width;
  const int whole = static_cast<int>(filled);
  const char* color = state.ending == BarState::Ending::kSucceeded ? kGreen : kCyan;
  if (!terminal.utf8) {
    return "[" + Colored(terminal, color, std::string(static_cast<std::size_t>(whole), '#')) +
           std::string(static_cast<std::size_t>(width - whole), '.') + "]";
  }
  static constexpr std::array<const char*, 8> kEighths = {"", "▏", "▎", "▍", "▌", "▋", "▊", "▉"};
  const std::string part = kEighths[static_cast<std::size_t>((filled - whole) * 8)];
  const int rest = width - whole - (part.empty() ? 0 : 1);
  return Colored(terminal, color, Repeat("█", whole) + part) + Colored(terminal, kDim, Repeat("·", rest));
}

struct Piece {
  std::string text;
  int rank;  // pieces of the highest rank go first when space is short
};

}  // namespace

std::string Sparkline(const std::vector<double>& values, double floor) {
  static constexpr std::array<const char*, 8> kBlocks = {"▁", "▂", "▃", "▄", "▅", "▆", "▇", "█"};
  const std::size_t skip = values.size() > kSparklineLength ? values.size() - kSparklineLength : 0;
  const double low = std::log10(std::max(floor, 1e-300));
  double high = low;
  for (std::size_t i = skip; i < values.size(); ++i) high = std::max(high, std::log10(std::max(values[i], 1e-300)));
  std::string line;
  for (std::size_t i = skip; i < values.size(); ++i) {
    const double height = high > low ? (std::log10(std::max(values[i], 1e-300)) - low) / (high - low) : 0;
    line += kBlocks[static_cast<std::size_t>(std::lround(7 * std::clamp(height, 0.0, 1.0)))];
  }
  return line;
}

void BarState::Apply(const Event& event) {
  if (notice != kCancelling) notice.clear();
  if (event.job) {
    queue_position = event.job->queue_position;
    if (event.job->state == JobState::kQueued) {
      // A job that was lost and submitted anew begins again.
      *this = BarState();
      stage = Stage::kQueue;
      queue_position = event.job->queue_position;
    }
    if (event.job->state == JobState::kRunning && stage <= Stage::kQueue) stage = Stage::kDecode;
    if (event.job->state == JobState::kStopping) notice = kCancelling;
    if (event.job->state == JobState::kSucceeded) stage = Stage::kDownload;
  }
  if (!event.progress) return;
  const Progress& progress = *event.progress;
  stage = progress.stage;
  if (progress.chart != chart) residuals.clear();
  chart = progress.chart;
  chart_count = progress.chart_count;
  newton_iteration = progress.newton_iteration;
  linear_iterations = progress.linear_iterations;
  if (progress.tolerance > 0) tolerance = progress.tolerance;
  const double worst = progress.residual.Worst();
  if (progress.stage < Stage::kSolve || !(worst > 0) || !std::isfinite(worst)) return;
  // Events may be skipped, so iterations that were not seen take the value of the next one.
  const auto count = static_cast<std::size_t>(std::max(0, progress.newton_iteration)) + 1;
  if (residuals.size() < count) residuals.resize(count, worst);
  residuals[count - 1] = worst;
  if (chart_count > 1) reached = Fraction();
}

double BarState::Fraction() const {
  if (ending == Ending::kSucceeded || stage > Stage::kSolve) return 1;
  if (chart_count <= 1) return ChartFraction();
  return std::clamp((chart + ChartFraction()) / chart_count, reached, 1.0);
}

double BarState::ChartFraction() const {
  if (residuals.empty() || tolerance <= 0) return 0;
  const double first = *std::max_element(residuals.begin(), residuals.end());
  const double least = *std::min_element(residuals.begin(), residuals.end());
  if (first <= tolerance) return 1;
  return std::clamp(std::log(first / least) / std::log(first / tolerance), 0.0, 1.0);
}

std::string RenderBar(const BarState& state, const Terminal& terminal, int frame) {
  const int width = terminal.width - 1;  // the last column would wrap on some terminals
  const char* stage_color = !state.notice.empty() && state.ending == BarState::Ending::kNone ? kYellow : kBold;
  std::vector<Piece> pieces;
  pieces.push_back(
      {Mark(state, terminal, frame) + " " + Colored(terminal, stage_color, Padded(StageText(state), 8)), 0});
  const std::size_t bar_at = pieces.size();
  pieces.push_back({"", 2});
  if (!state.residuals.empty()) {
    std::string residual = Scientific(state.residuals.back());
    if (state.tolerance > 0 && state.ending == BarState::Ending::kNone) {
      residual += Colored(terminal, kDim, (terminal.utf8 ? " → " : " -> ") + Scientific(state.tolerance));
    }
    pieces.push_back({residual, 3});
    if (terminal.utf8) pieces.push_back({Colored(terminal, kCyan, Sparkline(state.residuals, state.tolerance)), 5});
    pieces.push_back({"newton " + std::to_string(state.newton_iteration), 1});
    if (state.linear_iterations > 0) {
      pieces.push_back({Colored(terminal, kDim, WithCommas(state.linear_iterations) + " linear"), 4});
    }
  }
  // Hundredths would flicker while the clock ticks.
  const double seconds = state.elapsed_seconds;
  const bool ticking = state.ending == BarState::Ending::kNone && seconds < 59.95;
  pieces.push_back({ticking ? Fixed(seconds, 1) + " s" : Duration(seconds), 1});

  const auto total = [&pieces](int bar_width) {
    int columns = -2;
    for (const Piece& piece : pieces) {
      const int own = piece.rank == 2 ? bar_width : DisplayWidth(piece.text);
      if (own > 0) columns += own + 2;
    }
    return columns;
  };
  const int frame_columns = terminal.utf8 ? 0 : 2;  // of an ASCII bar
  for (int rank = 5; rank >= 3 && total(kShortestBar + frame_columns) > width; --rank) {
    pieces.erase(std::remove_if(pieces.begin(), pieces.end(), [rank](const Piece& p) { return p.rank == rank; }),
                 pieces.end());
  }
  const int bar_width = std::min(kLongestBar, width - total(frame_columns + 1) + 1);
  if (bar_width >= kShortestBar) pieces[bar_at].text = Bar(state, terminal, bar_width);

  std::string line;
  for (const Piece& piece : pieces) {
    if (piece.text.empty()) continue;
    const std::string next = (line.empty() ? "" : "  ") + piece.text;
    if (DisplayWidth(line) + DisplayWidth(next) <= width) line += next;
  }
  return line;
}

ProgressBar::ProgressBar() : painter_([this] { PaintUntilStopped(); }) {}

ProgressBar::~ProgressBar() {
  if (painter_.joinable()) Finish(false);
}

void ProgressBar::OnEvent(const Event& event) {
  const std::lock_guard lock(mutex_);
  state_.Apply(event);
}

void ProgressBar::OnDownload(std::int64_t received, std::int64_t total) {
  const std::lock_guard lock(mutex_);
  state_.received_bytes = received;
  state_.total_bytes = total;
}

void ProgressBar::OnNotice(const std::string& notice) {
  const std::lock_guard lock(mutex_);
  state_.notice = notice;
}

std::string ProgressBar::Painting(int frame) {
  state_.elapsed_seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - start_).count();
  // One write, the old line overwritten and only its rest erased: nothing ever blinks.
  return "\r" + RenderBar(state_, StderrTerminal(), frame) + "\x1b[K";
}

void ProgressBar::PaintUntilStopped() {
  std::unique_lock lock(mutex_);
  for (int frame = 0; !stopped_; ++frame) {
    // A quick job should not flash a bar at all before its last line.
    if (frame > 0) {
      const std::string painting = Painting(frame);
      lock.unlock();
      [[maybe_unused]] const ssize_t written = write(STDERR_FILENO, painting.data(), painting.size());
      lock.lock();
    }
    changed_.wait_for(lock, kFrame, [this] { return stopped_; });
  }
}

void ProgressBar::Finish(bool succeeded) {
  {
    const std::lock_guard lock(mutex_);
    if (stopped_) return;
    stopped_ = true;
    changed_.notify_all();
  }
  painter_.join();
  const std::lock_guard lock(mutex_);
  state_.ending = succeeded ? BarState::Ending::kSucceeded : BarState::Ending::kFailed;
  // What went wrong is told by others, in words.
  const std::string last = succeeded ? Painting(0) + "\n" : "\r\x1b[K";
  [[maybe_unused]] const ssize_t written = write(STDERR_FILENO, last.data(), last.size());
}

}  // namespace planish::cli
