// Where the progress of a job is shown.
#pragma once

#include <cstdint>
#include <memory>
#include <string>

#include "client/cli/arguments.h"
#include "planish/client.h"

namespace planish::cli {

// The notice that stays until the end.
inline constexpr char kCancelling[] = "cancelling";

// Every function may be called from any thread, one call at a time.
class ProgressView {
 public:
  virtual ~ProgressView() = default;
  virtual void OnEvent(const Event& event) = 0;
  virtual void OnDownload(std::int64_t /*received*/, std::int64_t /*total*/) {}
  // Something people should know until the next event.
  virtual void OnNotice(const std::string& /*notice*/) {}
  // No more of it; `succeeded` says how it went. Leaves stderr at the beginning of a line.
  virtual void Finish(bool /*succeeded*/) {}

  // Callbacks that feed this view, which must outlive the call.
  Callbacks AsCallbacks();
};

// `title` is what is being worked on: a file or a job. kAuto becomes bar on a terminal (plain on a dumb one), else
// none: a build farm's log gets the summary only.
std::unique_ptr<ProgressView> NewProgressView(ProgressMode mode, const std::string& title);

}  // namespace planish::cli
