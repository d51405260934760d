#include "client/cli/image_work.h"

#include <filesystem>
#include <iostream>
#include <memory>
#include <utility>

#include "client/cli/exit_codes.h"
#include "client/cli/progress_view.h"
#include "client/cli/results.h"

namespace planish::cli {

void DrawImages(const TerminalArguments& terminal, const std::string& name, Interrupts& interrupts,
                std::vector<OutputOptions> outputs,
                const std::function<void(const std::vector<OutputOptions>&)>& work) {
  const std::unique_ptr<ProgressView> view =
      NewProgressView(terminal, {std::filesystem::path(name).filename()}, /*is_batch=*/false);
  std::atomic<bool> is_stopped = false;
  for (OutputOptions& output : outputs) {
    output.textures.stop = &is_stopped;
    output.textures.on_image = [&view](const ImageProgress& progress) { view->OnImage(0, progress); };
  }
  interrupts.SetCancel([&is_stopped] { is_stopped = true; });
  const auto end = [&] {
    interrupts.SetCancel({});  // is_stopped goes out of scope
    view->Finish();
  };
  try {
    work(outputs);
  } catch (...) {
    end();
    throw;
  }
  end();
  if (interrupts.interrupted()) throw Error(ErrorCode::kCancelled, "CANCELLED", "interrupted");
}

int Interrupted(bool json, const Error& error, double seconds) {
  std::cerr << "planish: interrupted; nothing was written\n";
  if (json) {
    Failure failure = FailureOf(error);
    failure.total_seconds = seconds;
    std::cout << ToText(ReportJson(failure)) << std::flush;
  }
  return kInterrupted;
}

}  // namespace planish::cli
