// Progress as lines: for logs, and for programs.
#pragma once

#include <string>

#include "client/cli/progress.h"

namespace planish::cli {

// A line per change of state, stage and Newton iteration.
class PlainProgress : public ProgressView {
 public:
  explicit PlainProgress(const std::string& title) : title_(title) {}
  void OnEvent(const Event& event) override;
  void OnNotice(const std::string& notice) override;

 private:
  const std::string title_;
  Stage stage_ = Stage::kUnspecified;
  int newton_iteration_ = -1;
};

// A JSON object per event: {"sequence", "time", "skipped", "job" or "progress"}.
class JsonProgress : public ProgressView {
 public:
  void OnEvent(const Event& event) override;
};

// The line for an event, without line break; empty if it has nothing new to say. Updates what was said last.
std::string PlainLine(const Event& event, Stage& stage, int& newton_iteration);

}  // namespace planish::cli
