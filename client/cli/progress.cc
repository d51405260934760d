#include "client/cli/progress.h"

#include <algorithm>
#include <cmath>

#include "client/cli/numbers.h"

namespace planish::cli {
namespace {

// Chosen by what 22 meshes of 250 to 100,000 triangles took on two busy cores (client/README.md, "What the bar shows").
struct Weights {
  double cut = 2e-6;     // seconds a byte of the mesh
  double solve = 4e-6;   // seconds a byte
  double cuts = 1.7;     // times what came before the first solve: all solves
  double pack = 0.1;     // seconds, and
  double packs = 0.35;   // times all that came before
  double verify = 0.03;  // times all that came before
};
// Other policies do not cut for stretch.
constexpr Weights kCutting = {}, kGiven = {0.35e-6, 1.3e-6, 4, 0, 0.15, 0.1};

constexpr double kStart = 0.01;  // seconds, of a worker
// What all rounds take of solves and cuts, times the first one; and what is left at the end of a round, times that.
constexpr double kRounds = 3.5, kMoreRounds = 2;
// What is left of a phase that takes longer than expected, as a part of that.
constexpr double kLeast = 0.15;
// Newton's method squares residuals, so the logarithm falls ever faster: after this power of the way a step is about as
// long as another.
constexpr double kNewtonPower = 0.33;

const Weights& WeightsOf(const UnwrapOptions& options) {
  return options.seams == Seams::kAuto ? kCutting : kGiven;
}

double Left(double expected, double spent) {
  return std::max(expected - spent, kLeast * expected);
}

}  // namespace

void WorkEstimate::OnJob(const Job& job) {
  options_ = job.options;
  bytes_ = static_cast<double>(job.mesh_bytes);
}

void WorkEstimate::OnProgress(const Progress& progress, double chart_part) {
  const double now = progress.elapsed_seconds;
  const int phase = progress.stage < Stage::kSolve   ? kCut
                    : progress.stage < Stage::kPack  ? kSolve
                    : progress.stage == Stage::kPack ? kPack
                                                     : kVerify;
  if (phase_ < kSolve && phase >= kSolve) {
    solve_seconds_ = WeightsOf(options_).cuts * now;
    round_began_ = now;
  }
  // A round ends with cuts or joins, which are called charts again. What is delivered may be cut once more, too.
  for (; phase_ < phase; ++phase_) begin_[phase_ + 1] = now;
  if (phase_ == kSolve && progress.stage == Stage::kCharts && stage_ != Stage::kCharts) {
    const double round = now - round_began_;
    if (++rounds_ == 1) solve_seconds_ = std::sqrt(solve_seconds_ * kRounds * round);
    solve_seconds_ = std::max(solve_seconds_, now - begin_[kSolve] + kMoreRounds * round);
    round_began_ = now;
  }
  const bool is_single = progress.chart_count <= 1 && phase_ == kSolve;
  single_chart_part_ = is_single ? std::pow(chart_part, kNewtonPower) : 0;
  stage_ = progress.stage;
}

double WorkEstimate::PackSeconds(double seconds) const {
  const Weights& weights = WeightsOf(options_);
  if (!options_.pack || options_.seams == Seams::kNone) return 0;
  // As the server bounds it, from normal effort on: half of that, a hundred times that.
  const double effort = options_.effort == Effort::kFast ? 0.5 : options_.effort == Effort::kBest ? 100 : 1;
  return weights.pack + effort * weights.packs * seconds;
}

double WorkEstimate::VerifySeconds(double seconds) const {
  return WeightsOf(options_).verify * seconds;
}

double WorkEstimate::Fraction(double seconds) const {
  if (seconds <= 0) return 0;
  const Weights& weights = WeightsOf(options_);
  const double spent = std::max(0.0, seconds - begin_[phase_]);
  double all = 0;  // up to the end of the phase
  switch (phase_) {
    case kCut:
      all = seconds + Left(kStart + weights.cut * bytes_, seconds) + weights.solve * bytes_;
      break;
    case kSolve:
      // From a tenth on the chart's own way tells more.
      all = seconds + (single_chart_part_ > 0.1 ? spent * (1 / single_chart_part_ - 1) : Left(solve_seconds_, spent));
      break;
    case kPack:
      all = seconds + Left(PackSeconds(begin_[kPack]), spent);
      break;
    default:
      all = seconds + Left(VerifySeconds(begin_[kVerify]), spent);
  }
  if (phase_ < kPack) all += PackSeconds(all);
  if (phase_ < kVerify) all += VerifySeconds(all);
  return seconds / all;
}

void JobProgress::Apply(const Event& event) {
  reached = Fraction();
  if (notice != kCancelling) notice.clear();
  if (event.job) {
    const Job& job = *event.job;
    if (job.state == JobState::kQueued) {
      // A job that was lost and submitted anew begins again.
      const double now = elapsed_seconds;
      *this = JobProgress();
      elapsed_seconds = now;
      stage = Stage::kQueue;
    }
    queue_position = job.queue_position;
    estimate.OnJob(job);
    if (job.state == JobState::kRunning && stage <= Stage::kQueue) {
      stage = Stage::kDecode;
      worker_began = elapsed_seconds;
    }
    if (job.state == JobState::kStopping) notice = kCancelling;
    if (job.state == JobState::kSucceeded) stage = Stage::kDownload;
  }
  if (event.progress) {
    const Progress& progress = *event.progress;
    stage = progress.stage;
    worker_began = elapsed_seconds - progress.elapsed_seconds;
    if (progress.chart != chart) residuals.clear();
    chart = progress.chart;
    chart_count = progress.chart_count;
    newton_iteration = progress.newton_iteration;
    linear_iterations = progress.linear_iterations;
    if (progress.tolerance > 0) tolerance = progress.tolerance;
    const double worst = progress.residual.Worst();
    if (stage >= Stage::kSolve && worst > 0 && std::isfinite(worst)) {
      // Events may be skipped, so iterations that were not seen take the value of the next one.
      const auto count = static_cast<std::size_t>(std::max(0, newton_iteration)) + 1;
      if (residuals.size() < count) residuals.resize(count, worst);
      residuals[count - 1] = worst;
    }
    estimate.OnProgress(progress, ChartFraction());
  }
}

double JobProgress::Fraction() const {
  if (has_succeeded) return 1;
  if (stage <= Stage::kQueue) return 0;
  if (stage == Stage::kDownload) {
    const double received =
        total_bytes > 0 ? static_cast<double>(received_bytes) / static_cast<double>(total_bytes) : 0;
    return reached + (1 - reached) * std::clamp(received, 0.0, 1.0);
  }
  return std::max(reached, estimate.Fraction(elapsed_seconds - worker_began));
}

double JobProgress::ChartFraction() const {
  if (residuals.empty() || tolerance <= 0) return 0;
  const double first = *std::max_element(residuals.begin(), residuals.end());
  const double least = *std::min_element(residuals.begin(), residuals.end());
  if (first <= tolerance) return 1;
  return std::clamp(std::log(first / least) / std::log(first / tolerance), 0.0, 1.0);
}

std::string PlainLine(const Event& event, LastLine& last) {
  if (event.job) {
    std::string line = event.job->name + " " + ToString(event.job->state);
    if (event.job->queue_position > 0) line += ", " + std::to_string(event.job->queue_position) + " ahead";
    return line;
  }
  if (!event.progress) return "";
  const Progress& progress = *event.progress;
  // The solve is announced before its first residual is known.
  const bool is_solving = progress.stage == Stage::kSolve && progress.residual.Worst() > 0;
  if (progress.stage == last.stage && (!is_solving || progress.newton_iteration == last.newton_iteration)) return "";
  last.stage = progress.stage;
  last.newton_iteration = is_solving ? progress.newton_iteration : -1;
  std::string line = ToString(last.stage);
  if (progress.chart_count > 1) {
    line += " " + std::to_string(progress.chart + 1) + "/" + std::to_string(progress.chart_count);
  }
  if (is_solving) {
    line += ": newton " + std::to_string(last.newton_iteration) + ", residual " +
            Scientific(progress.residual.Worst()) + " (tolerance " + Scientific(progress.tolerance) + "), " +
            Counted(progress.linear_iterations, "linear iteration", "linear iterations");
  }
  return line + ", " + Duration(progress.elapsed_seconds);
}

}  // namespace planish::cli
