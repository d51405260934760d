#include "client/cli/progress.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "client/cli/text.h"

namespace planish::cli {
namespace {

// Fitted to the times of 22 meshes of 250 to 100,000 triangles on two busy cores (client/README.md, "What the bar
// shows").
struct Weights {
  // Everything before the first solve: seconds per byte of the mesh.
  double cut = 2e-6;
  // All solves: seconds per byte of the mesh; once the first solve has begun, a fraction of the time before it.
  double solve = 4e-6;
  double cuts = 0.65;
  // Packing: seconds, plus seconds per chart (at most the time before packing), plus a fraction of the time before it.
  double pack = 0.1;
  double chart = 1e-3;
  double packs = 0.35;
  // The verifier: a fraction of the time before it.
  double verify = 0.03;
};
// kCutting is for Seams::kAuto, kGiven for the other policies, which do not cut for stretch.
constexpr Weights kCutting = {}, kGiven = {0.35e-6, 1.3e-6, 4, 0, 0, 0.15, 0.1};

constexpr double kStart = 0.01;          // seconds until a worker begins to compute
constexpr double kBestPackSeconds = 40;  // an average: Effort::kBest takes 10 to 60 s from 5 charts on
// A round is a series of solves up to the next cuts. kRounds: time of all rounds, divided by the time of the first.
// kMoreRounds: time that is left after a round, divided by the time of that round.
constexpr double kRounds = 3.5, kMoreRounds = 2;
// The time left of a phase is never estimated below this fraction of its expected time.
constexpr double kLeast = 0.15;
// Newton's method squares residuals, so the fraction of the way to the tolerance, on a logarithmic scale, grows ever
// faster. This power of the fraction grows about evenly.
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
  const double now = progress.elapsed.count();
  charts_ = progress.chart_count;
  const int phase = progress.stage < Stage::kSolve   ? kCut
                    : progress.stage < Stage::kPack  ? kSolve
                    : progress.stage == Stage::kPack ? kPack
                                                     : kVerify;
  if (phase == kCut && progress.stage == Stage::kCharts) {
    if (stage_ != Stage::kCharts) charts_began_ = now;
    if (progress.stage_fraction > charts_part_) {
      charts_part_ = progress.stage_fraction;
      charts_told_ = now;
    }
  }
  if (phase_ < kSolve && phase >= kSolve) {
    solve_seconds_ = WeightsOf(options_).cuts * now;
    round_began_ = now;
  }
  // The phase never goes back, although the stage may: a round of solves ends with cuts or joins, which the server
  // reports as stage CHARTS again.
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
  // These formulas follow the server's own limits for packing.
  const double normal = weights.packs * seconds;
  if (options_.effort == Effort::kBest) return std::max(kBestPackSeconds, 100 * normal);
  return weights.pack + std::min(weights.chart * charts_, seconds) +
         (options_.effort == Effort::kFast ? 0.5 : 1) * normal;
}

double WorkEstimate::VerifySeconds(double seconds) const {
  return WeightsOf(options_).verify * seconds;
}

double WorkEstimate::Fraction(double seconds) const {
  if (seconds <= 0) return 0;
  const Weights& weights = WeightsOf(options_);
  const double spent = std::max(0.0, seconds - begin_[phase_]);
  double all = 0;  // expected time up to the end of the present phase
  switch (phase_) {
    case kCut:
      // Once a tenth of the stage is done, its fraction gives a better estimate than the size of the mesh.
      if (charts_part_ > 0.1) {
        const double cut = charts_began_ + (charts_told_ - charts_began_) / charts_part_;
        all = std::max(cut, seconds) * (1 + weights.cuts);
      } else {
        all = seconds + Left(kStart + weights.cut * bytes_, seconds) + weights.solve * bytes_;
      }
      break;
    case kSolve:
      // Once a tenth of the only chart's solve is done, its residual gives a better estimate.
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
      // A lost job that is submitted again starts over.
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
    worker_began = elapsed_seconds - progress.elapsed.count();
    if (progress.chart != chart) residuals.clear();
    chart = progress.chart;
    chart_count = progress.chart_count;
    stage_fraction = progress.stage_fraction;
    newton_iteration = progress.newton_iteration;
    linear_iterations = progress.linear_iterations;
    if (progress.tolerance > 0) tolerance = progress.tolerance;
    const double worst = progress.residual.Worst();
    if (stage >= Stage::kSolve && worst > 0 && std::isfinite(worst)) {
      // Events may be skipped: iterations without an event take the value of the next one.
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
  // The event of a new solve comes before its first residual.
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
  return line + ", " + Duration(progress.elapsed.count());
}

namespace {

constexpr std::size_t kSparklineLength = 16;
constexpr int kLongestBar = 32;
constexpr int kShortestBar = 8;
constexpr int kNarrowestBar = 24;  // columns that a bar keeps beside its name
constexpr int kShortestName = 8;
constexpr char kEraseLine[] = "\x1b[K";
constexpr char kEraseBelow[] = "\x1b[J";

const char kBold[] = "\x1b[1m";
const char kDim[] = "\x1b[2m";
const char kCyan[] = "\x1b[36m";
const char kGreen[] = "\x1b[32m";
const char kYellow[] = "\x1b[33m";

std::string Repeat(const std::string& text, int count) {
  std::string result;
  for (int i = 0; i < count; ++i) result += text;
  return result;
}

std::string Mark(const JobProgress& progress, const Terminal& terminal, int frame) {
  if (progress.has_succeeded) return Colored(terminal, kGreen, terminal.utf8 ? "✓" : "+");
  static constexpr std::array<const char*, 10> kDots = {"⠋", "⠙", "⠹", "⠸", "⠼", "⠴", "⠦", "⠧", "⠇", "⠏"};
  static constexpr std::array<const char*, 4> kTurns = {"|", "/", "-", "\\"};
  const auto at = static_cast<std::size_t>(frame);
  return Colored(terminal, kCyan, terminal.utf8 ? kDots[at % kDots.size()] : kTurns[at % kTurns.size()]);
}

std::string StageText(const JobProgress& progress) {
  if (progress.has_succeeded) return "done";
  if (!progress.notice.empty()) return progress.notice;
  if (!progress.image.empty()) return progress.image;
  if (progress.stage == Stage::kQueue && progress.queue_position > 0) {
    return "queue (" + std::to_string(progress.queue_position) + " ahead)";
  }
  if (progress.stage == Stage::kDownload && progress.total_bytes > 0) {
    return "download " + std::to_string(100 * progress.received_bytes / progress.total_bytes) + " %";
  }
  std::string text = ToString(progress.stage);
  if (progress.stage == Stage::kCharts && progress.stage_fraction > 0) {
    text += " " + std::to_string(static_cast<int>(100 * progress.stage_fraction)) + " %";
  } else if (progress.chart_count > 1) {
    text += " " + std::to_string(progress.chart + 1) + "/" + std::to_string(progress.chart_count);
  }
  return text;
}

std::string Bar(const JobProgress& progress, const Terminal& terminal, int width) {
  const double filled = std::max(progress.Fraction(), progress.image_fraction) * width;
  const int whole = static_cast<int>(filled);
  const char* color = progress.has_succeeded ? kGreen : kCyan;
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
  int rank;  // when space is short, pieces of the highest rank are left out first
};

std::string TotalsLine(const ProgressState& state, std::size_t hidden) {
  std::string text = WithCommas(state.ended) + " of " + Counted(state.jobs_in_all, "file", "files");
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

std::string ImageText(const ImageProgress& progress) {
  return "Resampling " + Printable(progress.name, true) + " (" + std::to_string(progress.number) + " of " +
         std::to_string(progress.count) + ")";
}

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

std::string RenderBar(const JobProgress& progress, const Terminal& terminal, int frame) {
  const int width = terminal.width - 1;  // the last column would wrap on some terminals
  const char* stage_color = !progress.notice.empty() && !progress.has_succeeded ? kYellow : kBold;
  std::vector<Piece> pieces;
  pieces.push_back(
      {Mark(progress, terminal, frame) + " " + Colored(terminal, stage_color, Padded(StageText(progress), 8)), 0});
  const std::size_t bar_at = pieces.size();
  pieces.push_back({"", 2});
  // Once the job has succeeded, the details of the last chart are left out, because the summary describes the result.
  if (!progress.residuals.empty() && !progress.has_succeeded && progress.image.empty()) {
    std::string residual = Scientific(progress.residuals.back());
    if (progress.tolerance > 0) {
      residual += Colored(terminal, kDim, (terminal.utf8 ? " → " : " -> ") + Scientific(progress.tolerance));
    }
    pieces.push_back({residual, 3});
    if (terminal.utf8)
      pieces.push_back({Colored(terminal, kCyan, Sparkline(progress.residuals, progress.tolerance)), 5});
    pieces.push_back({"newton " + std::to_string(progress.newton_iteration), 1});
    if (progress.linear_iterations > 0) {
      pieces.push_back({Colored(terminal, kDim, WithCommas(progress.linear_iterations) + " linear"), 4});
    }
  }
  // Hundredths would flicker while the clock ticks.
  const double seconds = progress.elapsed_seconds;
  const bool ticking = !progress.has_succeeded && seconds < 59.95;
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
  if (bar_width >= kShortestBar) pieces[bar_at].text = Bar(progress, terminal, bar_width);

  std::string line;
  for (const Piece& piece : pieces) {
    if (piece.text.empty()) continue;
    const std::string next = (line.empty() ? "" : "  ") + piece.text;
    if (DisplayWidth(line) + DisplayWidth(next) <= width) line += next;
  }
  return line;
}

std::vector<std::string> RenderBatch(const ProgressState& state, const Terminal& terminal, int frame) {
  // Two rows are reserved for the totals and the cursor. Rows that scroll off the top cannot be repainted.
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
    if (rest.width > 1) line += "  " + RenderBar(state.jobs[j].progress, rest, frame);
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
  // Overwrites lines and erases only what is left of the old ones, to avoid flicker.
  for (const std::string& line : ended) text += line + kEraseLine + "\n";
  for (const std::string& line : live) text += line + kEraseLine + "\n";
  return text + kEraseBelow;
}

}  // namespace planish::cli
