#include "client/cli/batch_view.h"

#include <iostream>
#include <mutex>
#include <utility>

#include "client/cli/batch_bars.h"
#include "client/cli/json.h"
#include "client/cli/progress_lines.h"
#include "client/cli/terminal.h"
#include "client/cli/text_width.h"

namespace planish::cli {
namespace {

class NoBatchView : public BatchView {};

// A line per file that ended; with `every_step` also one per change of state, stage and Newton iteration.
class BatchLines : public BatchView {
 public:
  BatchLines(const std::vector<std::string>& names, bool every_step)
      : names_(names), every_step_(every_step), said_(names.size()) {}

  void OnEvent(std::size_t file, const Event& event) override {
    if (!every_step_) return;
    const std::lock_guard lock(mutex_);
    const std::string line = PlainLine(event, said_[file].stage, said_[file].newton_iteration);
    if (!line.empty()) Say(file, line);
  }
  void OnNotice(std::size_t file, const std::string& notice) override {
    if (!every_step_) return;
    const std::lock_guard lock(mutex_);
    Say(file, notice);
  }
  void OnNotice(const std::string& notice) override {
    const std::lock_guard lock(mutex_);
    std::cerr << notice + "\n" << std::flush;
  }
  void End(std::size_t, const BatchRow& row) override {
    const std::lock_guard lock(mutex_);
    if (!row.kept || row.result != BatchResult::kUsable) std::cerr << RowLine(row, Terminal()) + "\n" << std::flush;
  }

 private:
  struct Said {
    Stage stage = Stage::kUnspecified;
    int newton_iteration = -1;
  };

  void Say(std::size_t file, const std::string& line) const {
    std::cerr << Printable(names_[file], true) + ": " + line + "\n" << std::flush;
  }

  const std::vector<std::string> names_;
  const bool every_step_;
  std::mutex mutex_;
  std::vector<Said> said_;
};

// A JSON object per event, with "file" in front of what a single unwrap has, and one per end: {"file", "result"}.
class BatchJson : public BatchView {
 public:
  explicit BatchJson(std::vector<std::string> names) : names_(std::move(names)) {}

  void OnEvent(std::size_t file, const Event& event) override {
    Json json = {{"file", names_[file]}};
    json.update(ToJson(event));
    Print(json);
  }
  void OnNotice(std::size_t file, const std::string& notice) override {
    Print({{"file", names_[file]}, {"notice", notice}});
  }
  void End(std::size_t file, const BatchRow& row) override {
    Print({{"file", names_[file]}, {"result", ToString(row.result)}});
  }

 private:
  void Print(const Json& json) {
    const std::lock_guard lock(mutex_);
    std::cerr << ToLine(json) + "\n" << std::flush;
  }

  const std::vector<std::string> names_;
  std::mutex mutex_;
};

}  // namespace

Callbacks BatchView::CallbacksOf(std::size_t file) {
  Callbacks callbacks;
  callbacks.on_event = [this, file](const Event& event) { OnEvent(file, event); };
  callbacks.on_download = [this, file](std::int64_t received, std::int64_t total) {
    OnDownload(file, received, total);
  };
  callbacks.on_reconnect = [this, file](const Error& why, Seconds) {
    OnNotice(file, why.reason() == "QUEUE_FULL" ? "the queue is full, waiting" : "connection lost, re-attaching");
  };
  return callbacks;
}

std::unique_ptr<BatchView> NewBatchView(ProgressMode mode, const std::vector<std::string>& names) {
  if (mode == ProgressMode::kAuto) {
    const Terminal terminal = StderrTerminal();
    if (!terminal.is_tty || terminal.is_dumb) return std::make_unique<BatchLines>(names, false);
    mode = ProgressMode::kBar;
  }
  switch (mode) {
    case ProgressMode::kBar:
      return std::make_unique<BatchBars>(names);
    case ProgressMode::kPlain:
      return std::make_unique<BatchLines>(names, true);
    case ProgressMode::kJson:
      return std::make_unique<BatchJson>(names);
    default:
      return std::make_unique<NoBatchView>();
  }
}

}  // namespace planish::cli
