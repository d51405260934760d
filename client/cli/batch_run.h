// The jobs of a batch, several at a time.
#pragma once

#include <atomic>
#include <mutex>
#include <string>
#include <vector>

#include "client/cli/batch_flight.h"
#include "client/cli/batch_job.h"
#include "client/cli/progress_view.h"

namespace planish::cli {

struct BatchRunOptions {
  int workers = 1;                     // of the server
  double server_patience_seconds = 0;  // for a server that went away to come back
  bool print_json = false;             // a line on stdout per file as it ends
};

class BatchRun {
 public:
  // All must outlive the run.
  BatchRun(const BatchContext& context, const BatchPlan& plan, const BatchRunOptions& options, ProgressView& view);

  // A row per item of the plan, in its order. Once.
  std::vector<BatchRow> Run();

  // After the run: the server went away and did not come back; the rest of the files was not tried.
  bool server_lost() const { return server_lost_; }

 private:
  void Work();
  BatchEnd DoWithPatience(std::size_t file);
  void Record(std::size_t file, const BatchEnd& end);
  bool ShouldStop() const { return server_lost_ || context_.stop.stop_requested(); }

  const BatchContext& context_;
  const BatchPlan& plan_;
  const BatchRunOptions options_;
  ProgressView& view_;
  BatchFlight flight_;
  std::atomic<bool> server_lost_ = false;
  std::mutex mutex_;  // guards what follows, and stdout
  std::size_t next_ = 0;
  std::vector<BatchRow> rows_;
};

}  // namespace planish::cli
