#include "client/cli/batch_run.h"

#include <algorithm>
#include <iostream>
#include <thread>

#include "core/base/timer.h"

namespace planish::cli {
namespace {

// Files in flight are in memory as they are, as meshes and as what was sent: some five times as much.
constexpr std::int64_t kMostBytesInFlight = std::int64_t{512} << 20;
constexpr double kLongestPauseSeconds = 5;

}  // namespace

BatchRun::BatchRun(const BatchContext& context, const BatchPlan& plan, const BatchRunOptions& options,
                   ProgressView& view)
    : context_(context),
      plan_(plan),
      options_(options),
      view_(view),
      flight_(options.workers, kMostBytesInFlight),
      rows_(plan.items.size()) {}

std::vector<BatchRow> BatchRun::Run() {
  const std::stop_callback on_stop(context_.stop, [this] { flight_.Stop(); });
  {
    std::vector<std::jthread> threads;
    const auto count = std::min(plan_.items.size(), static_cast<std::size_t>(flight_.most()));
    for (std::size_t t = 0; t < count; ++t) threads.emplace_back([this] { Work(); });
  }
  for (; next_ < plan_.items.size(); ++next_) Record(next_, NotTried(plan_.items[next_]));
  return std::move(rows_);
}

void BatchRun::Work() {
  for (;;) {
    std::size_t file;
    {
      // Files are taken up in order, so whoever waits for room waits with the next one in hand.
      const std::lock_guard lock(mutex_);
      if (next_ == plan_.items.size() || ShouldStop()) return;
      file = next_++;
    }
    const std::int64_t bytes = plan_.items[file].bytes;
    if (!flight_.Enter(bytes)) return Record(file, NotTried(plan_.items[file]));
    view_.Begin(file);
    const BatchEnd end = DoWithPatience(file);
    Record(file, end);
    flight_.Leave(bytes);
  }
}

BatchEnd BatchRun::DoWithPatience(std::size_t file) {
  Callbacks callbacks = view_.CallbacksOf(file, context_.arguments.verbose);
  const auto told = callbacks.on_reconnect;
  callbacks.on_reconnect = [this, told](const Error& why, double seconds) {
    if (why.reason() == "QUEUE_FULL") flight_.OnQueueFull();
    told(why, seconds);
  };
  const Timer timer;
  double pause = 0.5;
  for (;;) {
    BatchEnd end = DoBatchItem(context_, plan_.items[file], callbacks);
    if (end.queue_seconds) flight_.OnDone(*end.queue_seconds);
    if (!end.server_error || ShouldStop()) return end;
    if (timer.Seconds() + pause > options_.server_patience_seconds) {
      server_lost_ = true;
      flight_.Stop();
      return end;
    }
    view_.OnNotice(file, "no server, waiting");
    if (!PauseUnlessStopped(context_.stop, pause)) return end;
    pause = std::min(kLongestPauseSeconds, 2 * pause);
  }
}

void BatchRun::Record(std::size_t file, const BatchEnd& end) {
  view_.End(file, end.row);
  const std::lock_guard lock(mutex_);
  rows_[file] = end.row;
  if (options_.print_json) std::cout << ToLine(end.json) + "\n" << std::flush;
}

}  // namespace planish::cli
