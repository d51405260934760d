// Where the progress of a batch is shown.
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "client/cli/arguments.h"
#include "client/cli/batch_table.h"
#include "planish/client.h"

namespace planish::cli {

// Files are told apart by their numbers in the plan. Every function may be called from any thread, also several at a
// time.
class BatchView {
 public:
  virtual ~BatchView() = default;
  // A file is taken up; its End comes later. OnEvent, OnDownload and OnNotice are about files in between.
  virtual void Begin(std::size_t /*file*/) {}
  virtual void OnEvent(std::size_t /*file*/, const Event& /*event*/) {}
  virtual void OnDownload(std::size_t /*file*/, std::int64_t /*received*/, std::int64_t /*total*/) {}
  // Something people should know until the next event of the file.
  virtual void OnNotice(std::size_t /*file*/, const std::string& /*notice*/) {}
  // Something people should know about the whole batch until its end.
  virtual void OnNotice(const std::string& /*notice*/) {}
  virtual void End(std::size_t /*file*/, const BatchRow& /*row*/) {}
  // No more of it. Leaves stderr at the beginning of a line.
  virtual void Finish() {}

  // Callbacks that feed this view, which must outlive the call.
  Callbacks CallbacksOf(std::size_t file);
};

// kAuto becomes bars on a terminal, elsewhere (and on a dumb one) a line per file that ended.
std::unique_ptr<BatchView> NewBatchView(ProgressMode mode, const std::vector<std::string>& names);

}  // namespace planish::cli
