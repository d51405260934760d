// The servers that share a store, so that each server can report on all of them.
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
  std::string name;               // unique
  bool answers = false;           // whether it accepts callers
  int workers = 0;                // jobs that it runs at the same time
  std::int64_t memory_bytes = 0;  // total memory that its jobs may reserve
  std::string version;            // of planishd
};

// How far one clock is ahead of another.
struct ClockOffset {
  absl::Duration ahead;  // negative: it is behind
  absl::Duration error;  // bound of the error of `ahead`
};

// A table with a row for each server. A row expires, by the database's clock, unless the server is announced again.
// Thread-safe. Errors as of SqlConnection.
class ServerRegistry {
 public:
  // Sets up the table. `database` (PostgreSQL; FAILED_PRECONDITION with STORE_UNFIT otherwise) outlives the object.
  // Errors of SetUpTables().
  static absl::StatusOr<std::unique_ptr<ServerRegistry>> Make(SqlDatabase* database);

  // The server is present for `time` from now on. Durable later. Deletes expired servers.
  absl::Status Announce(const ServerEntry& server, absl::Duration time);
  // How far `clock` is ahead of the database's.
  absl::StatusOr<ClockOffset> Compare(const std::function<absl::Time()>& clock);
  // Removes the row of a server that ends.
  absl::Status Withdraw(const std::string& name);
  // The present servers, by name. Also passes their number to the database (SqlDatabase::SetProcesses).
  absl::StatusOr<std::vector<ServerEntry>> List();

 private:
  explicit ServerRegistry(SqlDatabase* database) : database_(database) {}

  SqlDatabase* const database_;
};

}  // namespace planish
