// What a terminal shows of jobs that run: a line for each, painted in place.
//
//   ✓ a.obj  23,062 triangles, 12 charts, 0.82 s
//   b.obj           ⠹ solve     ███████████▌········  3.2e-05 → 1.0e-09  █▇▅▃▂  newton 4  1,234 linear  3.2 s
//   props/lamp.glb  ⠹ queue (2 ahead)  0.4 s
//   1 of 12 files, 2 in flight, 4.1 s
//
// A job by itself has its line without name and totals. All functions are pure.
#pragma once

#include <string>
#include <vector>

#include "client/cli/progress.h"
#include "client/cli/terminal.h"

namespace planish::cli {

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
