// The live view of a batch: a bar per job in flight, painted in place, under the lines of the files that ended.
//
//   ✓ a.obj  23,062 triangles, 12 charts, 0.82 s
//   b.obj           ⠹ solve     ███████████▌········  3.2e-05 → 1.0e-09  newton 4  3.2 s
//   props/lamp.glb  ⠹ queue (2 ahead)  0.4 s
//   1 of 12 files, 2 in flight, 4.1 s
#pragma once

#include <chrono>
#include <condition_variable>
#include <map>
#include <mutex>
#include <string>
#include <thread>
#include <vector>

#include "client/cli/batch_view.h"
#include "client/cli/progress_bar.h"

namespace planish::cli {

// Everything that the live lines depend on.
struct BatchBarsState {
  struct Job {
    std::string name;
    BarState bar;
  };
  std::vector<Job> jobs;  // in flight, in the order in which they were taken up
  int files = 0;
  int ended = 0;
  int bad = 0;  // of these: failed, cancelled or not usable
  double elapsed_seconds = 0;
  std::string notice;
};

// The live lines, without line breaks, each at most terminal.width - 1 columns wide: as many jobs as the terminal's
// height allows, how many more there are, and the totals. Pure.
std::vector<std::string> RenderBatch(const BatchBarsState& state, const Terminal& terminal, int frame);

// What to write to the terminal so that `ended` lines and then `live` ones stand where the live lines `before` stand,
// which end above the cursor. A terminal that has become narrower since has broken those. Pure.
std::string Repaint(const std::vector<std::string>& before, const std::vector<std::string>& ended,
                    const std::vector<std::string>& live, const Terminal& terminal);

// Paints from a thread of its own.
class BatchBars : public BatchView {
 public:
  explicit BatchBars(const std::vector<std::string>& names);
  ~BatchBars() override;
  void Begin(std::size_t file) override;
  void OnEvent(std::size_t file, const Event& event) override;
  void OnDownload(std::size_t file, std::int64_t received, std::int64_t total) override;
  void OnNotice(std::size_t file, const std::string& notice) override;
  void OnNotice(const std::string& notice) override;
  void End(std::size_t file, const BatchRow& row) override;
  void Finish() override;

 private:
  using Clock = std::chrono::steady_clock;
  struct Running {
    Clock::time_point start;
    BarState bar;
  };

  void PaintUntilStopped();
  std::string Painting(int frame, bool is_last);

  const std::vector<std::string> names_;
  const Clock::time_point start_ = Clock::now();
  std::mutex mutex_;  // guards what follows
  std::condition_variable changed_;
  bool stopped_ = false;
  std::map<std::size_t, Running> running_;  // by file: the order of the plan
  std::vector<BatchRow> ended_;             // not painted yet
  BatchBarsState state_;                    // without its jobs
  std::vector<std::string> painted_;        // the live lines as they stand
  std::thread painter_;
};

}  // namespace planish::cli
