// Reloads the settings of a running server.
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

// Prepares one part of the server for new settings without changing anything, for instance by reading and checking
// files. If any hook fails, nothing in the server changes. The returned function puts the new settings in force; it is
// called once all hooks have succeeded, and must not fail.
using ReloadHook = std::function<absl::StatusOr<std::function<void()>>(const ServerFlags& flags)>;

// The settings in force.
struct ConfigInForce {
  std::vector<Setting> settings;
  absl::Time load_time;
};

// Add hooks before the first Reload(). InForce() is thread-safe; use the other functions on one thread.
class Reloader {
 public:
  explicit Reloader(std::vector<Setting> settings);

  // `keys`: the settings that the hook handles. The hook is called at every reload, even if none of them changed, since
  // the contents of files that they name may have changed.
  void AddHook(const std::vector<std::string>& keys, ReloadHook hook);

  // Reloads all or nothing. Puts the settings that hooks handle in force, and logs every setting that changed; those
  // that no hook handles take effect after a restart. Also logs the outcome.
  void Reload(const absl::StatusOr<ServerConfig>& config);

  ConfigInForce InForce() const;

 private:
  // The settings in force after a reload that wants `wanted`. Logs every setting that changed.
  std::vector<Setting> Merge(const std::vector<Setting>& wanted) const;

  std::set<std::string> keys_;
  std::vector<ReloadHook> hooks_;
  mutable std::mutex mutex_;
  ConfigInForce in_force_;  // guarded by mutex_
};

}  // namespace planish
