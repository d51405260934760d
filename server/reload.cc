#include "server/reload.h"

#include "absl/strings/str_cat.h"
#include "absl/strings/str_split.h"
#include "absl/time/clock.h"
#include "server/log/log.h"

namespace planish {
namespace {

// Logs each line of the message as a line of its own.
void LogRefusal(const absl::Status& status) {
  for (const auto& line : absl::StrSplit(status.message(), '\n', absl::SkipEmpty())) {
    LogError(absl::StrCat("not reloaded: ", line));
  }
  LogError("the configuration stays as it was");
}

}  // namespace

Reloader::Reloader(std::vector<Setting> settings) : in_force_{std::move(settings), absl::Now()} {}

void Reloader::AddHook(const std::vector<std::string>& keys, ReloadHook hook) {
  keys_.insert(keys.begin(), keys.end());
  hooks_.push_back(std::move(hook));
}

void Reloader::Reload(const absl::StatusOr<ServerConfig>& config) {
  if (!config.ok()) return LogRefusal(config.status());
  std::vector<std::function<void()>> commits;
  for (const ReloadHook& hook : hooks_) {
    absl::StatusOr<std::function<void()>> commit = hook(config->flags);
    if (!commit.ok()) return LogRefusal(commit.status());
    commits.push_back(*std::move(commit));
  }
  std::vector<Setting> merged = Merge(config->settings);
  for (const std::function<void()>& commit : commits) commit();
  for (const std::string& warning : config->warnings) LogWarn(warning);
  {
    const std::lock_guard lock(mutex_);
    in_force_ = {std::move(merged), absl::Now()};
  }
  LogInfo("configuration reloaded");
}

ConfigInForce Reloader::InForce() const {
  const std::lock_guard lock(mutex_);
  return in_force_;
}

std::vector<Setting> Reloader::Merge(const std::vector<Setting>& wanted) const {
  std::vector<Setting> merged = InForce().settings;
  // Both lists have all settings, in the order of their definition.
  for (std::size_t i = 0; i < merged.size(); ++i) {
    const Setting& next = wanted[i];
    const std::string change = absl::StrCat(next.key, " changed from ", ValueText(merged[i]), " to ", ValueText(next));
    const bool changed = !merged[i].SameValue(next);
    if (changed && !keys_.contains(next.key)) {
      LogWarn(change + ": takes effect after a restart", {{"setting", next.key}});
      continue;
    }
    if (changed) LogInfo(change, {{"setting", next.key}});
    merged[i] = next;
  }
  return merged;
}

}  // namespace planish
