// What all servers that share a store have together.
#pragma once

#include <mutex>
#include <string>
#include <vector>

#include "absl/status/status.h"
#include "server/jobs/job_options.h"
#include "server/store/server_registry.h"

namespace planish {

// This server among the others. Thread-safe.
class Farm {
 public:
  // `registry` outlives the object.
  Farm(ServerRegistry* registry, ServerEntry self) : registry_(*registry), self_(std::move(self)) {}

  // Announces this server and asks for the others. Call it every kInterval; it waits for the database.
  absl::Status Tick();
  // What the last Tick() returned.
  absl::Status LastTick() const;
  // This server takes no more jobs and answers no more callers.
  absl::Status Leave();

  // As of the last Tick(): a server that comes or goes counts up to kInterval late. Until then a mesh that only that
  // server could take is refused or waits, and the queue's limits are off by its workers; nothing else goes by it.
  std::vector<ServerEntry> Servers() const;
  JobCapacity Capacity() const;

  static constexpr absl::Duration kInterval = absl::Seconds(5);

 private:
  absl::Status AnnounceAndAsk();

  ServerRegistry& registry_;
  const ServerEntry self_;

  mutable std::mutex mutex_;
  // Guarded by mutex_.
  absl::Status last_tick_;
  std::vector<ServerEntry> servers_;
  JobCapacity capacity_ = {0, 0, JobCapacity().memory_bytes, 0};
};

}  // namespace planish
