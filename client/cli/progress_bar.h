// The live progress bar: one line on a terminal, painted in place.
//
//   ⠹ solve    ███████████▌········  3.2e-05 → 1.0e-09  █▇▅▃▂  newton 4  1,234 linear  3.2 s
//
// The bar fills as the worst residual falls, on a logarithmic scale, from where it began to the tolerance.
#pragma once

#include <chrono>
#include <condition_variable>
#include <mutex>
#include <string>
#include <thread>
#include <vector>

#include "client/cli/progress.h"
#include "client/cli/terminal.h"

namespace planish::cli {

// The time between two paintings.
inline constexpr std::chrono::milliseconds kFrame(80);

// Everything the line depends on.
struct BarState {
  enum class Ending { kNone, kSucceeded, kFailed };

  Stage stage = Stage::kUpload;
  int queue_position = 0;  // jobs ahead
  int newton_iteration = 0;
  std::int64_t linear_iterations = 0;
  std::vector<double> residuals;  // worst one after 0, 1, 2, ... Newton iterations
  double tolerance = 0;           // 0: not known yet
  int chart = 0;
  int chart_count = 0;
  double reached = 0;  // of all charts, where there are several
  double elapsed_seconds = 0;
  std::int64_t received_bytes = 0;
  std::int64_t total_bytes = 0;
  std::string notice;  // shown instead of the stage
  Ending ending = Ending::kNone;

  void Apply(const Event& event);
  // Of the way from the first residual to the tolerance, over all charts, in [0, 1]; never falls.
  double Fraction() const;
  // Of the present chart.
  double ChartFraction() const;
};

// The line, without line break, at most terminal.width - 1 columns wide. `frame` counts paintings. Pure.
std::string RenderBar(const BarState& state, const Terminal& terminal, int frame);

// One block character per value, high for the largest and low for `floor`, on a logarithmic scale.
std::string Sparkline(const std::vector<double>& values, double floor);

// Paints from a thread of its own, at most 20 times a second, and ticks while nothing arrives.
class ProgressBar : public ProgressView {
 public:
  ProgressBar();
  ~ProgressBar() override;
  void OnEvent(const Event& event) override;
  void OnDownload(std::int64_t received, std::int64_t total) override;
  void OnNotice(const std::string& notice) override;
  void Finish(bool succeeded) override;

 private:
  void PaintUntilStopped();
  // The line as it is now, over the one before.
  std::string Painting(int frame);

  const std::chrono::steady_clock::time_point start_ = std::chrono::steady_clock::now();
  std::mutex mutex_;
  std::condition_variable changed_;
  bool stopped_ = false;  // guarded by mutex_, like state_
  BarState state_;
  std::thread painter_;
};

}  // namespace planish::cli
