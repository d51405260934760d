// Shared by unwrap and jobs watch: reads the mesh files of a job, writes copies of them with the result, and reports
// errors with the ids of the files.
#pragma once

#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "client/cli/arguments.h"
#include "client/cli/progress_view.h"
#include "client/cli/unwrap_files.h"
#include "core/base/timer.h"
#include "planish/client.h"

namespace planish::cli {

class Interrupts;

struct DeliveryArguments {
  int texcoord = 0;  // glTF: UV are read from TEXCOORD_n
  OutputArguments output;
  ServerArguments server;
  double timeout_seconds = 0;  // 0: none
  TerminalArguments terminal;
  bool json = false;
};

class Delivery {
 public:
  // Starts the clock. `arguments` must outlive this object.
  explicit Delivery(const DeliveryArguments& arguments) : arguments_(arguments) {}

  // Reads the files, which become one mesh (UnwrapFiles).
  void Load(const std::vector<std::string>& inputs, const MapArguments& map);

  const UnwrapFiles& files() const { return *files_; }
  // Sets how long it took to start the private server.
  void SetStart(double seconds) { start_seconds_ = seconds; }
  // How much of --timeout is left, for the call to the server; 0: no limit.
  Seconds TimeLeft() const;

  // Redraws images, showing progress in `view`, writes the output files, all or none, and ends the view. Then writes
  // the preview, calls `draw`, which draws other pictures, and stops the clock. If the first signal comes while images
  // are drawn, nothing is written and CANCELLED is thrown.
  void Write(UnwrapResult& result, Interrupts& interrupts, ProgressView& view, const std::function<void()>& draw = {});
  // Prints the summary and the JSON report, and returns the exit code.
  int Tell(const UnwrapResult& result) const;

  // Both print the error, also as JSON with --json, and return the exit code.
  int Fail(const Error& sent_error) const;
  int Interrupted(const std::string& what_happened, const Error& error) const;

 private:
  const DeliveryArguments& arguments_;
  Timer timer_;
  double start_seconds_ = 0;
  std::optional<UnwrapFiles> files_;
};

// Ends the only job of `view`, and the view.
void End(ProgressView& view, bool succeeded);

}  // namespace planish::cli
