#include "client/cli/progress.h"

#include "client/cli/progress_bar.h"
#include "client/cli/progress_lines.h"
#include "client/cli/terminal.h"

namespace planish::cli {
namespace {

class NoView : public ProgressView {
 public:
  void OnEvent(const Event&) override {}
};

}  // namespace

Callbacks ProgressView::AsCallbacks() {
  Callbacks callbacks;
  callbacks.on_event = [this](const Event& event) { OnEvent(event); };
  callbacks.on_download = [this](std::int64_t received, std::int64_t total) { OnDownload(received, total); };
  callbacks.on_reconnect = [this](const Error& why, Seconds) {
    OnNotice(why.reason() == "QUEUE_FULL" ? "the queue is full, waiting" : "connection lost, re-attaching");
  };
  return callbacks;
}

std::unique_ptr<ProgressView> NewProgressView(ProgressMode mode, const std::string& title) {
  if (mode == ProgressMode::kAuto) {
    const Terminal terminal = StderrTerminal();
    mode = !terminal.is_tty ? ProgressMode::kNone : terminal.is_dumb ? ProgressMode::kPlain : ProgressMode::kBar;
  }
  switch (mode) {
    case ProgressMode::kBar:
      return std::make_unique<ProgressBar>();
    case ProgressMode::kPlain:
      return std::make_unique<PlainProgress>(title);
    case ProgressMode::kJson:
      return std::make_unique<JsonProgress>();
    default:
      return std::make_unique<NoView>();
  }
}

}  // namespace planish::cli
