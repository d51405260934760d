// The servers that share a store, so that each can say what all of them have.
#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "absl/time/time.h"
#include "server/store/sql.h"

namespace planish {

struct ServerEntry {
  std::string name;               // no other server has it
  bool answers = false;           // callers
  int workers = 0;                // jobs that it runs at a time
  std::int64_t memory_bytes = 0;  // that its jobs may reserve together
  std::string version;            // of planishd
};

// How far one clock is ahead of another.
struct ClockOffset {
  absl::Duration ahead;  // negative: it is behind
  absl::Duration error;  // that may be wrong by as much
};

// A row for each server, which ends unless it is announced again. Ends go by the database's clock. Thread-safe. Errors
// as of SqlConnection.
class ServerRegistry {
 public:
  // Sets up the table. `database` (PostgreSQL; FAILED_PRECONDITION with STORE_UNFIT otherwise) outlives the object.
  // Errors of SetUpTables().
  static absl::StatusOr<std::unique_ptr<ServerRegistry>> Make(SqlDatabase* database);

  // The server is there for `time` from now on. Durable later. Forgets servers whose time is over.
  absl::Status Announce(const ServerEntry& server, absl::Duration time);
  // Of `clock` ahead of the database's.
  absl::StatusOr<ClockOffset> Compare(const std::function<absl::Time()>& clock);
  // The server ends.
  absl::Status Withdraw(const std::string& name);
  // Those that are there, by name. Tells the database how many (SqlDatabase::SetProcesses).
  absl::StatusOr<std::vector<ServerEntry>> List();

 private:
  explicit ServerRegistry(SqlDatabase* database) : database_(database) {}

  SqlDatabase* const database_;
};

}  // namespace planish
