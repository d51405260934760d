// The progress of jobs, computed from the events of the server, and its display on a terminal.
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

// JobProgress::notice while a job is being cancelled. Unlike other notices, events do not remove it.
inline constexpr char kCancelling[] = "cancelling";

// Estimates the fraction of a job's time that is over. A job has four phases: everything before the first solve;
// solves, with cuts and joins between them; packing; the verifier and the rest. The time of a phase is estimated from
// the times of the phases before it, so the speed of the machine does not matter. The time of the first phase is
// estimated from the size of the mesh, until the stage CHARTS reports its progress (Progress::stage_fraction). Seconds
// are counted as in Progress::elapsed.
class WorkEstimate {
 public:
  void OnJob(const Job& job);
  // `chart_part`: JobProgress::ChartFraction().
  void OnProgress(const Progress& progress, double chart_part);
  // The estimated fraction, in [0, 1). Between two events it grows with `seconds`, ever more slowly when a phase takes
  // longer than expected. An event may reduce it.
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
  // In phase kCut: when the stage CHARTS began, the fraction that it last reported, and when it reported that. 0 before
  // that.
  double charts_began_ = 0, charts_part_ = 0, charts_told_ = 0;
  std::array<double, kPhases> begin_ = {};  // of each phase reached
  Stage stage_ = Stage::kUnspecified;
  // In phase kSolve:
  double solve_seconds_ = 0;  // expected time of the phase
  int rounds_ = 0;            // number of rounds that have ended
  double round_began_ = 0;
  double single_chart_part_ = 0;  // fraction of the solve that is done, if there is one chart; otherwise 0
};

// Everything that the progress bar of a job depends on.
struct JobProgress {
  Stage stage = Stage::kUpload;
  int queue_position = 0;  // jobs ahead
  int newton_iteration = 0;
  std::int64_t linear_iterations = 0;
  std::vector<double> residuals;  // largest residual after 0, 1, 2, ... Newton iterations of the present chart
  double tolerance = 0;           // 0: not known yet
  int chart = 0;
  int chart_count = 0;
  double stage_fraction = 0;   // fraction of the stage that is done; 0: not known
  double elapsed_seconds = 0;  // time since the start; set by the caller
  std::int64_t received_bytes = 0;
  std::int64_t total_bytes = 0;
  std::string notice;  // shown instead of the stage
  std::string image;   // ImageText() of the image being drawn after the job has ended; shown instead of the stage
  double image_fraction = 0;
  bool has_succeeded = false;
  WorkEstimate estimate;
  double worker_began = 0;  // value of elapsed_seconds when a worker began
  double reached = 0;       // Fraction() at the last event; later fractions are not smaller

  // Takes over an event that arrived at `elapsed_seconds`.
  void Apply(const Event& event);
  // The estimated fraction of the job's time that is over, in [0, 1]; never falls.
  double Fraction() const;
  // How much of the way from the first residual of the present chart to the tolerance is done, on a logarithmic scale,
  // in [0, 1].
  double ChartFraction() const;
};

// "Resampling wood.png (2 of 5)"
std::string ImageText(const ImageProgress& progress);

// What the last line of PlainLine() reported.
struct LastLine {
  Stage stage = Stage::kUnspecified;
  int newton_iteration = -1;
};

// The line for an event, without line break. Changes of state, stage and Newton iteration get a line; for other events
// it is empty.
std::string PlainLine(const Event& event, LastLine& last);

// ---- What a terminal shows while jobs run: a line for each job, repainted in place.
//
//   ✓ a.obj  23,062 triangles, 12 charts, 0.82 s
//   b.obj           ⠹ solve     ███████████▌········  3.2e-05 → 1.0e-09  █▇▅▃▂  newton 4  1,234 linear  3.2 s
//   props/lamp.glb  ⠹ queue (2 ahead)  0.4 s
//   1 of 12 files, 2 in flight, 4.1 s
//
// For a single job, only its line is shown, without a name. All functions are pure.

// The line of a job, without line break, at most terminal.width - 1 columns wide. `frame`: the number of the painting,
// which selects the frame of the animated mark.
std::string RenderBar(const JobProgress& progress, const Terminal& terminal, int frame);

// One block character per value, high for the largest and low for `floor`, on a logarithmic scale.
std::string Sparkline(const std::vector<double>& values, double floor);

// Everything that the live lines of a batch depend on.
struct ProgressState {
  struct Job {
    std::string name;
    JobProgress progress;
  };
  std::vector<Job> jobs;  // the jobs in flight
  int jobs_in_all = 0;
  int ended = 0;
  int bad = 0;  // number of ended jobs that failed, were cancelled or are not usable
  double elapsed_seconds = 0;
  std::string notice;
};

// The live lines, each at most terminal.width - 1 columns wide: as many jobs as the terminal's height allows, how many
// more there are, and the totals.
std::vector<std::string> RenderBatch(const ProgressState& state, const Terminal& terminal, int frame);

// What to write to the terminal to replace the live lines `before`, which end above the cursor, by the lines `ended`
// and `live`. Lines of `before` may have been broken by a terminal that has become narrower.
std::string Repaint(const std::vector<std::string>& before, const std::vector<std::string>& ended,
                    const std::vector<std::string>& live, const Terminal& terminal);

}  // namespace planish::cli
