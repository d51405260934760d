// Shows the progress of one job, or of the jobs of a batch, on stderr.
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "client/cli/arguments.h"
#include "client/cli/batch_table.h"
#include "client/files/mesh_output.h"
#include "planish/client.h"

namespace planish::cli {

// A job is known by its index in `names`. All functions are thread-safe.
class ProgressView {
 public:
  // `names`: the names of the jobs' files or, for jobs watch, of the job.
  ProgressView(std::vector<std::string> names, bool is_batch) : names_(std::move(names)), is_batch_(is_batch) {}
  virtual ~ProgressView() = default;
  // Work on a job begins. Functions about this job are called only between Begin() and End().
  virtual void Begin(std::size_t /*job*/) {}
  virtual void OnEvent(std::size_t /*job*/, const Event& /*event*/) {}
  virtual void OnDownload(std::size_t /*job*/, std::int64_t /*received*/, std::int64_t /*total*/) {}
  // Drawing of an image of the job's result begins.
  virtual void OnImage(std::size_t /*job*/, const ImageProgress& /*progress*/) {}
  // Shows a notice about the job until its next event.
  virtual void OnNotice(std::size_t /*job*/, const std::string& /*notice*/) {}
  // Shows a notice about the whole batch until its end.
  virtual void OnNotice(const std::string& /*notice*/) {}
  // Prints a line that stays, for --verbose. It must be printable and without line break.
  virtual void Say(const std::string& /*line*/) {}
  // Work on a job has ended. If there is only one job, only the row's result is used.
  virtual void End(std::size_t /*job*/, const BatchRow& /*row*/) {}
  // Ends the view. Leaves stderr at the beginning of a line.
  virtual void Finish() {}

  // Callbacks that update this view, which must outlive the call. With `verbose` they also report the size sent and the
  // reason of a lost connection.
  Callbacks CallbacksOf(std::size_t job, bool verbose);

 protected:
  const std::vector<std::string> names_;
  const bool is_batch_;
};

// The view for --progress. ProgressMode::kAuto is a bar for each job on a terminal. Elsewhere it is a line for each
// file of a batch that ended, and for a single job nothing (so that a log has the summary only) or, on a dumb terminal,
// the lines of kPlain. With --verbose it is the lines of kPlain in both cases.
std::unique_ptr<ProgressView> NewProgressView(const TerminalArguments& terminal, const std::vector<std::string>& names,
                                              bool is_batch);

}  // namespace planish::cli
