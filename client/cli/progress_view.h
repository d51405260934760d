// Where the progress of jobs is shown: of one, or of the files of a batch.
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

// Jobs are told apart by the numbers of their names. Every function may be called from any thread, also several at a
// time.
class ProgressView {
 public:
  // `names`: the files, or the job, being worked on.
  ProgressView(std::vector<std::string> names, bool is_batch) : names_(std::move(names)), is_batch_(is_batch) {}
  virtual ~ProgressView() = default;
  // A job is taken up; its End comes later. OnEvent, OnDownload and OnNotice are about jobs in between.
  virtual void Begin(std::size_t /*job*/) {}
  virtual void OnEvent(std::size_t /*job*/, const Event& /*event*/) {}
  virtual void OnDownload(std::size_t /*job*/, std::int64_t /*received*/, std::int64_t /*total*/) {}
  // An image of the job's result is drawn next.
  virtual void OnImage(std::size_t /*job*/, const ImageProgress& /*progress*/) {}
  // Something people should know until the next event of the job.
  virtual void OnNotice(std::size_t /*job*/, const std::string& /*notice*/) {}
  // Something people should know about the whole batch until its end.
  virtual void OnNotice(const std::string& /*notice*/) {}
  // A line that stays, for --verbose: without line break, and printable.
  virtual void Say(const std::string& /*line*/) {}
  // For a single job, only the row's result is used.
  virtual void End(std::size_t /*job*/, const BatchRow& /*row*/) {}
  // No more of it. Leaves stderr at the beginning of a line.
  virtual void Finish() {}

  // Callbacks that update this view, which must outlive the call. With `verbose` they also report the size sent and the
  // reason of a lost connection.
  Callbacks CallbacksOf(std::size_t job, bool verbose);

 protected:
  const std::vector<std::string> names_;
  const bool is_batch_;
};

// ProgressMode::kAuto becomes a bar for each job on a terminal. Elsewhere a batch shows a line for each file that ended
// and a single job nothing (a build farm's log gets the summary only) or, on a dumb terminal, lines; with --verbose
// both show all lines.
std::unique_ptr<ProgressView> NewProgressView(const TerminalArguments& terminal, const std::vector<std::string>& names,
                                              bool is_batch);

}  // namespace planish::cli
