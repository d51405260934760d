// The progress of jobs, from the events of their server, and its display on a terminal.
#pragma once

#include <array>
#include <cstdint>
#include <string>
#include <vector>

#include "client/cli/text.h"
#include "client/files/mesh_output.h"
#include "planish/client.h"

namespace planish::cli {

// ---- How far a job is

// The notice that stays until the end.
inline constexpr char kCancelling[] = "cancelling";

// Estimates the fraction of a job's time that is over. A job has four phases: everything before the first solve;
// solves, with rounds of cuts and joins between them; packing; the verifier and the rest. The time of a phase is
// estimated from the phases before it, so the speed of the machine does not matter. The first phase is estimated from
// the size of the mesh, until the stage of charts reports its progress (Progress::stage_fraction). Seconds are counted
// as in Progress::elapsed.
class WorkEstimate {
 public:
  void OnJob(const Job& job);
  // `chart_part`: JobProgress::ChartFraction().
  void OnProgress(const Progress& progress, double chart_part);
  // In [0, 1). Grows with `seconds` between two events, and ever slower when a phase takes longer than expected. An
  // event may reduce it.
  double Fraction(double seconds) const;

 private:
  enum Phase { kCut, kSolve, kPack, kVerify, kPhases };

  // Expected seconds of packing and of the verifier, if everything before them takes `seconds`.
  double PackSeconds(double seconds) const;
  double VerifySeconds(double seconds) const;

  UnwrapOptions options_;
  double bytes_ = 0;  // of the mesh as sent
  int charts_ = 0;    // 0 until the first report
  int phase_ = kCut;
  // In kCut: when the stage of charts began, the fraction that it last reported, and when. 0 before that.
  double charts_began_ = 0, charts_part_ = 0, charts_told_ = 0;
  std::array<double, kPhases> begin_ = {};  // of each phase reached
  Stage stage_ = Stage::kUnspecified;
  // In kSolve:
  double solve_seconds_ = 0;  // expected
  int rounds_ = 0;            // that are over
  double round_began_ = 0;
  double single_chart_part_ = 0;  // of the time of the only chart
};

// Everything a bar depends on.
struct JobProgress {
  Stage stage = Stage::kUpload;
  int queue_position = 0;  // jobs ahead
  int newton_iteration = 0;
  std::int64_t linear_iterations = 0;
  std::vector<double> residuals;  // worst one after 0, 1, 2, ... Newton iterations of the present chart
  double tolerance = 0;           // 0: not known yet
  int chart = 0;
  int chart_count = 0;
  double stage_fraction = 0;   // of the stage that is done; 0: not known
  double elapsed_seconds = 0;  // of the caller's clock, which sets it
  std::int64_t received_bytes = 0;
  std::int64_t total_bytes = 0;
  std::string notice;  // shown instead of the stage
  std::string image;   // shown in the end, instead of the stage: ImageText()
  double image_fraction = 0;
  bool has_succeeded = false;
  WorkEstimate estimate;
  double worker_began = 0;  // in elapsed_seconds
  double reached = 0;       // Fraction() when something was told last; it may not fall

  // Something was told at `elapsed_seconds`.
  void Apply(const Event& event);
  // What part of the job's time is over, in [0, 1]; never falls.
  double Fraction() const;
  // The way from the first residual of the present chart to the tolerance, on a logarithmic scale, in [0, 1].
  double ChartFraction() const;
};

// "Resampling wood.png (2 of 5)"
std::string ImageText(const ImageProgress& progress);

// What a line of PlainLine() has said last.
struct LastLine {
  Stage stage = Stage::kUnspecified;
  int newton_iteration = -1;
};

// The line for an event, without line break: one per change of state, stage and Newton iteration; empty if it has
// nothing new to say.
std::string PlainLine(const Event& event, LastLine& last);

// ---- What a terminal shows of jobs that run: a line for each, painted in place.
//
//   ✓ a.obj  23,062 triangles, 12 charts, 0.82 s
//   b.obj           ⠹ solve     ███████████▌········  3.2e-05 → 1.0e-09  █▇▅▃▂  newton 4  1,234 linear  3.2 s
//   props/lamp.glb  ⠹ queue (2 ahead)  0.4 s
//   1 of 12 files, 2 in flight, 4.1 s
//
// A job by itself has its line without name and totals. All functions are pure.

// The line of a job, without line break, at most terminal.width - 1 columns wide. `frame` counts paintings.
std::string RenderBar(const JobProgress& progress, const Terminal& terminal, int frame);

// One block character per value, high for the largest and low for `floor`, on a logarithmic scale.
std::string Sparkline(const std::vector<double>& values, double floor);

// Everything that the live lines of a batch depend on.
struct ProgressState {
  struct Job {
    std::string name;
    JobProgress progress;
  };
  std::vector<Job> jobs;  // in flight, in the order in which they were taken up
  int jobs_in_all = 0;
  int ended = 0;
  int bad = 0;  // of these: failed, cancelled or not usable
  double elapsed_seconds = 0;
  std::string notice;
};

// The live lines, each at most terminal.width - 1 columns wide: as many jobs as the terminal's height allows, how many
// more there are, and the totals.
std::vector<std::string> RenderBatch(const ProgressState& state, const Terminal& terminal, int frame);

// What to write to the terminal so that `ended` lines and then `live` ones stand where the live lines `before` stand,
// which end above the cursor. A terminal that has become narrower since has broken those.
std::string Repaint(const std::vector<std::string>& before, const std::vector<std::string>& ended,
                    const std::vector<std::string>& live, const Terminal& terminal);

}  // namespace planish::cli
