// New settings for a server that runs.
#pragma once

#include <functional>
#include <mutex>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "absl/status/statusor.h"
#include "absl/time/time.h"
#include "server/config/setting.h"
#include "server/flags.h"

namespace planish {

// Makes ready what a part of the server needs for new settings, changing nothing yet: reads and checks files, for
// instance. An error keeps the whole server as it is. The function that it returns puts the new settings in force; it
// is called if all parts are ready, and must not fail.
using ReloadHook = std::function<absl::StatusOr<std::function<void()>>(const ServerFlags& flags)>;

// What the server runs with.
struct ConfigInForce {
  std::vector<Setting> settings;
  absl::Time load_time;
};

// Hooks are added before the first Reload(); InForce() is thread-safe, the rest for one thread.
class Reloader {
 public:
  explicit Reloader(std::vector<Setting> settings);

  // `keys`: the settings that the hook takes care of. It is called at every reload, whether they changed or not: files
  // that they name may have.
  void AddHook(const std::vector<std::string>& keys, ReloadHook hook);

  // All or nothing: puts what hooks take care of in force, and names in the log every other setting that changed. These
  // stay as they were until a restart. The log also says how it ended.
  void Reload(const absl::StatusOr<ServerConfig>& config);

  ConfigInForce InForce() const;

 private:
  // Names what changed in the log; the settings in force then.
  std::vector<Setting> Merge(const std::vector<Setting>& wanted) const;

  std::set<std::string> keys_;
  std::vector<ReloadHook> hooks_;
  mutable std::mutex mutex_;
  ConfigInForce in_force_;  // guarded by mutex_
};

}  // namespace planish
