#include "client/cli/batch_bars.h"

#include <unistd.h>

#include <algorithm>

#include "client/cli/numbers.h"
#include "client/cli/terminal.h"
#include "client/cli/text_width.h"

namespace planish::cli {
namespace {

constexpr int kNarrowestBar = 24;  // columns that a bar keeps beside its name
constexpr int kShortestName = 8;
constexpr char kEraseLine[] = "\x1b[K";
constexpr char kEraseBelow[] = "\x1b[J";

std::string TotalsLine(const BatchBarsState& state, std::size_t hidden) {
  std::string text = WithCommas(state.ended) + " of " + Counted(state.files, "file", "files");
  if (state.bad > 0) text += ", " + WithCommas(state.bad) + " failed or not usable";
  if (!state.jobs.empty()) text += ", " + std::to_string(state.jobs.size()) + " in flight";
  if (hidden > 0) text += " (" + std::to_string(hidden) + " not shown)";
  const bool ticking = state.elapsed_seconds < 59.95;
  text += ", " + (ticking ? Fixed(state.elapsed_seconds, 1) + " s" : Duration(state.elapsed_seconds));
  return state.notice.empty() ? text : state.notice + ": " + text;
}

// The beginning of `text`, which has no colours.
std::string CutBehind(const std::string& text, int columns) {
  if (DisplayWidth(text) <= columns) return text;
  return text.substr(0, static_cast<std::size_t>(std::max(0, columns)));
}

}  // namespace

std::vector<std::string> RenderBatch(const BatchBarsState& state, const Terminal& terminal, int frame) {
  // One row for the totals, one for the cursor; what scrolls off the top cannot be painted over.
  const auto room = static_cast<std::size_t>(std::max(0, terminal.height - 2));
  const std::size_t shown = std::min(room, state.jobs.size());
  const int width = terminal.width - 1;
  int name_width = 0;
  for (std::size_t j = 0; j < shown; ++j) name_width = std::max(name_width, DisplayWidth(state.jobs[j].name));
  name_width = std::min(name_width, std::max(kShortestName, std::min(width / 3, width - kNarrowestBar)));

  std::vector<std::string> lines;
  for (std::size_t j = 0; j < shown; ++j) {
    const std::string& name = state.jobs[j].name;
    std::string line =
        CutToWidth(Padded(CutToWidth(name, name_width, terminal.utf8), name_width), width, terminal.utf8);
    Terminal rest = terminal;
    rest.width = terminal.width - name_width - 2;
    if (rest.width > 1) line += "  " + RenderBar(state.jobs[j].bar, rest, frame);
    lines.push_back(line);
  }
  lines.push_back(CutBehind(TotalsLine(state, state.jobs.size() - shown), width));
  return lines;
}

std::string Repaint(const std::vector<std::string>& before, const std::vector<std::string>& ended,
                    const std::vector<std::string>& live, const Terminal& terminal) {
  const int width = std::max(1, terminal.width);
  int rows = 0;
  for (const std::string& line : before) rows += std::max(1, (DisplayWidth(line) + width - 1) / width);
  rows = std::min(rows, std::max(0, terminal.height - 1));
  std::string text = "\r";
  if (rows > 0) text += "\x1b[" + std::to_string(rows) + "A";
  // Lines are overwritten and only their rests erased: nothing blinks.
  for (const std::string& line : ended) text += line + kEraseLine + "\n";
  for (const std::string& line : live) text += line + kEraseLine + "\n";
  return text + kEraseBelow;
}

BatchBars::BatchBars(const std::vector<std::string>& names) : names_(names) {
  state_.files = static_cast<int>(names.size());
  painter_ = std::thread([this] { PaintUntilStopped(); });
}

BatchBars::~BatchBars() {
  if (painter_.joinable()) Finish();
}

void BatchBars::Begin(std::size_t file) {
  const std::lock_guard lock(mutex_);
  running_[file].start = Clock::now();
}

void BatchBars::OnEvent(std::size_t file, const Event& event) {
  const std::lock_guard lock(mutex_);
  running_[file].bar.Apply(event);
}

void BatchBars::OnDownload(std::size_t file, std::int64_t received, std::int64_t total) {
  const std::lock_guard lock(mutex_);
  running_[file].bar.received_bytes = received;
  running_[file].bar.total_bytes = total;
}

void BatchBars::OnNotice(std::size_t file, const std::string& notice) {
  const std::lock_guard lock(mutex_);
  running_[file].bar.notice = notice;
}

void BatchBars::OnNotice(const std::string& notice) {
  const std::lock_guard lock(mutex_);
  state_.notice = notice;
}

void BatchBars::End(std::size_t file, const BatchRow& row) {
  const std::lock_guard lock(mutex_);
  running_.erase(file);
  if (row.result == BatchResult::kNotTried) return;
  ++state_.ended;
  if (row.result != BatchResult::kUsable && row.result != BatchResult::kQueued) ++state_.bad;
  // Of a batch that is resumed only the news scroll by.
  if (!row.kept || row.result != BatchResult::kUsable) ended_.push_back(row);
}

std::string BatchBars::Painting(int frame, bool is_last) {
  const Terminal terminal = StderrTerminal();
  std::vector<std::string> ended, live;
  for (const BatchRow& row : ended_) ended.push_back(RowLine(row, terminal));
  ended_.clear();
  if (!is_last) {
    BatchBarsState state = state_;
    const Clock::time_point now = Clock::now();
    state.elapsed_seconds = std::chrono::duration<double>(now - start_).count();
    for (const auto& [file, running] : running_) {
      state.jobs.push_back({Printable(names_[file], terminal.utf8), running.bar});
      state.jobs.back().bar.elapsed_seconds = std::chrono::duration<double>(now - running.start).count();
    }
    live = RenderBatch(state, terminal, frame);
  }
  std::string text = Repaint(painted_, ended, live, terminal);
  painted_ = std::move(live);
  return text;
}

void BatchBars::PaintUntilStopped() {
  std::unique_lock lock(mutex_);
  for (int frame = 0; !stopped_; ++frame) {
    const std::string painting = Painting(frame, false);
    lock.unlock();
    [[maybe_unused]] const ssize_t written = write(STDERR_FILENO, painting.data(), painting.size());
    lock.lock();
    changed_.wait_for(lock, kFrame, [this] { return stopped_; });
  }
}

void BatchBars::Finish() {
  {
    const std::lock_guard lock(mutex_);
    if (stopped_) return;
    stopped_ = true;
    changed_.notify_all();
  }
  painter_.join();
  const std::lock_guard lock(mutex_);
  const std::string last = Painting(0, true);
  [[maybe_unused]] const ssize_t written = write(STDERR_FILENO, last.data(), last.size());
}

}  // namespace planish::cli
