// What a server knows about all servers that share its store.
#pragma once

#include <functional>
#include <mutex>
#include <string>
#include <vector>

#include "absl/status/status.h"
#include "absl/time/clock.h"
#include "absl/time/time.h"
#include "server/jobs/job_options.h"
#include "server/store/server_registry.h"

namespace planish {

// Announces this server to the others, and keeps a list of all of them. Thread-safe.
class Farm {
 public:
  // `registry` outlives the object. `on_skew`, unless null, is called within Tick() when this machine's clock is off by
  // more than kSkewLimit, and with zero when it is right again. `clock`: that of this machine.
  Farm(ServerRegistry* registry, ServerEntry self, std::function<void(absl::Duration ahead)> on_skew = nullptr,
       std::function<absl::Time()> clock = absl::Now)
      : registry_(*registry), self_(std::move(self)), on_skew_(std::move(on_skew)), clock_(std::move(clock)) {}
  // Tells the others that this server takes no more jobs and answers no more callers.
  ~Farm();
  Farm(const Farm&) = delete;
  Farm& operator=(const Farm&) = delete;

  // Announces this server and asks for the others. Call it every kInterval; it waits for the database.
  absl::Status Tick();
  // What the last Tick() returned.
  absl::Status LastTick() const;

  // The present servers and their capacity as of the last Tick(). So a server that starts or ends is noticed up to
  // kInterval late. Until then a mesh that only that server has memory for is refused or waits, and the queue's limits
  // are off by its workers; there are no other effects.
  std::vector<ServerEntry> Servers() const;
  JobCapacity Capacity() const;

  // How far this machine's clock was ahead of the database's at the last Tick(). This machine's clock is used only for
  // certificates, for the expiry of credentials, and for times in logs.
  absl::Duration ClockSkew() const;

  static constexpr absl::Duration kInterval = absl::Seconds(5);
  static constexpr absl::Duration kSkewLimit = absl::Seconds(2);

 private:
  absl::Status CompareClocks();
  absl::Status AnnounceAndAsk();

  ServerRegistry& registry_;
  const ServerEntry self_;
  const std::function<void(absl::Duration ahead)> on_skew_;
  const std::function<absl::Time()> clock_;

  mutable std::mutex mutex_;
  // Guarded by mutex_.
  absl::Status last_tick_;
  std::vector<ServerEntry> servers_;
  JobCapacity capacity_ = {0, 0, JobCapacity().memory_bytes, 0};
  absl::Duration skew_;
};

}  // namespace planish
