#include "client/cli/progress_view.h"

#include <unistd.h>

#include <chrono>
#include <condition_variable>
#include <iostream>
#include <map>
#include <mutex>
#include <optional>
#include <thread>
#include <utility>

#include "client/cli/progress.h"
#include "client/cli/results.h"
#include "client/cli/text.h"
#include "core/base/timer.h"

namespace planish::cli {
namespace {

// The time between two repaints.
constexpr std::chrono::milliseconds kFrame(80);

class NoView : public ProgressView {
 public:
  using ProgressView::ProgressView;
  void Say(const std::string& line) override { std::cerr << line + "\n" << std::flush; }
};

// A job in progress, and the time since Begin().
struct Running {
  Timer timer;
  JobProgress progress;

  void Apply(const Event& event) {
    progress.elapsed_seconds = timer.Seconds();
    progress.Apply(event);
  }
};

// Repaints the bars from a thread of its own, so that the clock goes on between events.
class BarsView : public ProgressView {
 public:
  BarsView(const std::vector<std::string>& names, bool is_batch) : ProgressView(names, is_batch) {
    state_.jobs_in_all = static_cast<int>(names.size());
    painter_ = std::thread([this] { PaintUntilStopped(); });
  }
  ~BarsView() override {
    if (painter_.joinable()) Finish();
  }

  void Begin(std::size_t job) override {
    const std::lock_guard lock(mutex_);
    running_[job];
  }
  void OnEvent(std::size_t job, const Event& event) override {
    const std::lock_guard lock(mutex_);
    running_[job].Apply(event);
  }
  void OnDownload(std::size_t job, std::int64_t received, std::int64_t total) override {
    const std::lock_guard lock(mutex_);
    running_[job].progress.received_bytes = received;
    running_[job].progress.total_bytes = total;
  }
  void OnImage(std::size_t job, const ImageProgress& image) override {
    const std::lock_guard lock(mutex_);
    JobProgress& progress = running_[job].progress;
    progress.image = ImageText(image);
    progress.image_fraction = static_cast<double>(image.number - 1) / static_cast<double>(image.count);
  }
  void OnNotice(std::size_t job, const std::string& notice) override {
    const std::lock_guard lock(mutex_);
    running_[job].progress.notice = notice;
  }
  void OnNotice(const std::string& notice) override {
    const std::lock_guard lock(mutex_);
    state_.notice = notice;
  }
  void Say(const std::string& line) override {
    const std::lock_guard lock(mutex_);
    ended_.push_back(line);
  }
  void End(std::size_t job, const BatchRow& row) override {
    const std::lock_guard lock(mutex_);
    const Terminal terminal = StderrTerminal();
    const bool usable = row.result == BatchResult::kUsable;
    if (is_batch_) {
      // Usable files that an earlier run has done get no line.
      if (row.result != BatchResult::kNotTried && !(row.kept && usable)) ended_.push_back(RowLine(row, terminal));
    } else if (usable) {
      JobProgress& progress = running_[job].progress;
      progress.elapsed_seconds = running_[job].timer.Seconds();
      progress.has_succeeded = true;
      ended_.push_back(RenderBar(progress, terminal, 0));
    }
    running_.erase(job);
    if (row.result == BatchResult::kNotTried) return;
    ++state_.ended;
    if (!usable && row.result != BatchResult::kQueued) ++state_.bad;
  }
  void Finish() override {
    {
      const std::lock_guard lock(mutex_);
      if (stopped_) return;
      stopped_ = true;
      changed_.notify_all();
    }
    painter_.join();
    const std::lock_guard lock(mutex_);
    // The caller reports errors.
    Write(Painting(0, true));
  }

 private:
  static void Write(const std::string& text) {
    [[maybe_unused]] const ssize_t written = write(STDERR_FILENO, text.data(), text.size());
  }

  std::string Painting(int frame, bool is_last) {
    const Terminal terminal = StderrTerminal();
    std::vector<std::string> live;
    if (!is_last) {
      ProgressState state = state_;
      state.elapsed_seconds = timer_.Seconds();
      for (const auto& [job, running] : running_) {
        state.jobs.push_back({Printable(names_[job], terminal.utf8), running.progress});
        state.jobs.back().progress.elapsed_seconds = running.timer.Seconds();
      }
      if (is_batch_) {
        live = RenderBatch(state, terminal, frame);
      } else if (!state.jobs.empty()) {
        live.push_back(RenderBar(state.jobs[0].progress, terminal, frame));
      }
    }
    std::string text = Repaint(painted_, std::exchange(ended_, {}), live, terminal);
    painted_ = std::move(live);
    return text;
  }

  void PaintUntilStopped() {
    std::unique_lock lock(mutex_);
    for (int frame = 0; !stopped_; ++frame) {
      // A quick job shows its last line only.
      if (frame > 0) {
        const std::string painting = Painting(frame, false);
        lock.unlock();
        Write(painting);
        lock.lock();
      }
      changed_.wait_for(lock, kFrame, [this] { return stopped_; });
    }
  }

  const Timer timer_;
  std::mutex mutex_;  // guards what follows
  std::condition_variable changed_;
  bool stopped_ = false;
  std::map<std::size_t, Running> running_;  // by index in names_
  std::vector<std::string> ended_;          // permanent lines that are not painted yet
  ProgressState state_;                     // everything but `jobs`
  std::vector<std::string> painted_;        // the live lines on the terminal
  std::thread painter_;
};

// Prints a line per file of a batch that ended and, with `every_step`, per change of state, stage and Newton iteration.
class LinesView : public ProgressView {
 public:
  LinesView(const std::vector<std::string>& names, bool is_batch, bool every_step)
      : ProgressView(names, is_batch), every_step_(every_step), said_(names.size()) {}

  void OnEvent(std::size_t job, const Event& event) override {
    if (!every_step_) return;
    const std::lock_guard lock(mutex_);
    const std::string line = PlainLine(event, said_[job]);
    if (!line.empty()) Print(job, line);
  }
  void OnImage(std::size_t job, const ImageProgress& progress) override { OnNotice(job, ImageText(progress)); }
  void OnNotice(std::size_t job, const std::string& notice) override {
    if (!every_step_) return;
    const std::lock_guard lock(mutex_);
    Print(job, notice);
  }
  void OnNotice(const std::string& notice) override { Say(notice); }
  void Say(const std::string& line) override {
    const std::lock_guard lock(mutex_);
    std::cerr << line + "\n" << std::flush;
  }
  void End(std::size_t, const BatchRow& row) override {
    if (!is_batch_ || (row.kept && row.result == BatchResult::kUsable)) return;
    const std::lock_guard lock(mutex_);
    std::cerr << RowLine(row, Terminal()) + "\n" << std::flush;
  }

 private:
  void Print(std::size_t job, const std::string& line) const {
    std::cerr << Printable(names_[job], true) + ": " + line + "\n" << std::flush;
  }

  const bool every_step_;
  std::mutex mutex_;
  std::vector<LastLine> said_;
};

// Prints a JSON object per event, {"sequence", "time", "skipped", "job" or "progress", "fraction"}; per image that is
// drawn, {"image": {"name", "number", "count"}}; and per message about the whole command, {"note"} (more of them with
// --verbose). In a batch "file" comes first, and there are also notices, {"file", "notice"}, and ends of jobs, {"file",
// "result"}.
class JsonView : public ProgressView {
 public:
  using ProgressView::ProgressView;

  void Begin(std::size_t job) override {
    const std::lock_guard lock(mutex_);
    running_[job];
  }
  void OnEvent(std::size_t job, const Event& event) override {
    Json json = Json::object();
    if (is_batch_) json["file"] = names_[job];
    json.update(ToJson(event));
    {
      const std::lock_guard lock(mutex_);
      running_[job].Apply(event);
      json["fraction"] = running_[job].progress.Fraction();
    }
    Print(json);
  }
  void OnImage(std::size_t job, const ImageProgress& progress) override {
    Json json = Json::object();
    if (is_batch_) json["file"] = names_[job];
    json["image"] = {{"name", progress.name}, {"number", progress.number}, {"count", progress.count}};
    Print(json);
  }
  void OnNotice(std::size_t job, const std::string& notice) override {
    if (is_batch_) Print({{"file", names_[job]}, {"notice", notice}});
  }
  void OnNotice(const std::string& notice) override { Say(notice); }
  void Say(const std::string& line) override { Print({{"note", line}}); }
  void End(std::size_t job, const BatchRow& row) override {
    {
      const std::lock_guard lock(mutex_);
      running_.erase(job);
    }
    if (is_batch_) Print({{"file", names_[job]}, {"result", ToString(row.result)}});
  }

 private:
  void Print(const Json& json) {
    const std::lock_guard lock(mutex_);
    std::cerr << ToLine(json) + "\n" << std::flush;
  }

  std::mutex mutex_;  // guards what follows, and stderr
  std::map<std::size_t, Running> running_;
};

}  // namespace

Callbacks ProgressView::CallbacksOf(std::size_t job, bool verbose) {
  Callbacks callbacks;
  callbacks.on_event = [this, job](const Event& event) { OnEvent(job, event); };
  callbacks.on_download = [this, job](std::int64_t received, std::int64_t total) { OnDownload(job, received, total); };
  callbacks.on_reconnect = [this, job](const Error& why, Seconds) {
    OnNotice(job, why.reason() == "QUEUE_FULL" ? "the queue is full, waiting" : "connection lost, re-attaching");
  };
  if (!verbose) return callbacks;
  // With jobs watch the name in the view is the job's name, which is not printed twice.
  const auto say = [this, job](const std::string& text) {
    const bool is_named = text.rfind(names_[job] + ",", 0) == 0;
    Say(Printable(is_named ? text : names_[job] + ": " + text, true));
  };
  callbacks.on_event = [say, told = callbacks.on_event, known = std::string()](const Event& event) mutable {
    // A lost job is submitted again under another name.
    if (event.job && event.job->name != known) {
      known = event.job->name;
      say(known + ", " + WithCommas(event.job->mesh_bytes) + " bytes sent, " + Megabytes(event.job->memory_bytes) +
          " of memory reserved, trace " + event.job->trace_id);
    }
    told(event);
  };
  callbacks.on_reconnect = [say, told = callbacks.on_reconnect](const Error& why, Seconds pause) {
    say(std::string(why.what()) + " [" + why.reason() + "]; again in " + Duration(pause.count()));
    told(why, pause);
  };
  return callbacks;
}

std::unique_ptr<ProgressView> NewProgressView(const TerminalArguments& terminal, const std::vector<std::string>& names,
                                              bool is_batch) {
  ProgressMode mode = terminal.ShownProgress();
  if (mode == ProgressMode::kAuto) {
    const Terminal screen = StderrTerminal();
    const bool has_bars = screen.is_tty && !screen.is_dumb;
    if (is_batch && !has_bars && !terminal.verbose) return std::make_unique<LinesView>(names, is_batch, false);
    const bool has_lines = terminal.verbose || screen.is_tty;
    mode = has_bars ? ProgressMode::kBar : has_lines ? ProgressMode::kPlain : ProgressMode::kNone;
  }
  switch (mode) {
    case ProgressMode::kBar:
      return std::make_unique<BarsView>(names, is_batch);
    case ProgressMode::kPlain:
      return std::make_unique<LinesView>(names, is_batch, true);
    case ProgressMode::kJson:
      return std::make_unique<JsonView>(names, is_batch);
    default:
      return std::make_unique<NoView>(names, is_batch);
  }
}

}  // namespace planish::cli
