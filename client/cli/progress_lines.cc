#include "client/cli/progress_lines.h"

#include <iostream>

#include "client/cli/json.h"
#include "client/cli/numbers.h"

namespace planish::cli {

std::string PlainLine(const Event& event, Stage& stage, int& newton_iteration) {
  if (event.job) {
    std::string line = event.job->name + " " + ToString(event.job->state);
    if (event.job->queue_position > 0) line += ", " + std::to_string(event.job->queue_position) + " ahead";
    return line;
  }
  if (!event.progress) return "";
  const Progress& progress = *event.progress;
  // The solve is announced before its first residual is known.
  const bool is_solving = progress.stage == Stage::kSolve && progress.residual.Worst() > 0;
  if (progress.stage == stage && (!is_solving || progress.newton_iteration == newton_iteration)) return "";
  stage = progress.stage;
  newton_iteration = is_solving ? progress.newton_iteration : -1;
  std::string line = ToString(stage);
  if (progress.chart_count > 1) {
    line += " " + std::to_string(progress.chart + 1) + "/" + std::to_string(progress.chart_count);
  }
  if (is_solving) {
    line += ": newton " + std::to_string(newton_iteration) + ", residual " + Scientific(progress.residual.Worst()) +
            " (tolerance " + Scientific(progress.tolerance) + "), " +
            Counted(progress.linear_iterations, "linear iteration", "linear iterations");
  }
  return line + ", " + Duration(progress.elapsed.count());
}

void PlainProgress::OnEvent(const Event& event) {
  const std::string line = PlainLine(event, stage_, newton_iteration_);
  if (!line.empty()) std::cerr << title_ + ": " + line + "\n" << std::flush;
}

void PlainProgress::OnNotice(const std::string& notice) {
  std::cerr << title_ + ": " + notice + "\n" << std::flush;
}

void JsonProgress::OnEvent(const Event& event) {
  std::cerr << ToLine(ToJson(event)) + "\n" << std::flush;
}

}  // namespace planish::cli
