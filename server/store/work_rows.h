// Rows of `works` and `tenants`.
#pragma once

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <map>
#include <mutex>
#include <optional>
#include <string>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "server/store/fair_share.h"
#include "server/store/job_store.h"
#include "server/store/sql.h"

namespace planish {

inline constexpr char kWorkColumns[] =
    "name, tenant, number, running, turn_time, memory_bytes, mesh_bytes, run_time, alone, wish, owner, attempt, "
    "lease_until, start_time, charge, share";
inline constexpr std::size_t kWorkColumnCount = 16;

std::vector<WorkRow> WorkRowsOf(const SqlRows& rows);

// A batch for InsertWork().
RowBatch WorkInserts();
void InsertWork(const WorkRow& work, RowBatch* inserts);
absl::Status DeleteWork(SqlConnection* sql, const std::string& name);
// A batch for UpdateWork().
RowBatch WorkUpdates();
void UpdateWork(const WorkRow& work, RowBatch* updates);

// The changes of a transaction to the accounts. They are written last: a transaction that has locked rows of tenants
// takes no other locks, which prevents deadlocks.
class AccountChanges {
 public:
  TenantAccount& of(const std::string& tenant) { return changes_[tenant]; }
  void RaiseVirtualTime(std::int64_t value) { virtual_time_ = std::max(virtual_time_, value); }
  absl::Status Write(SqlConnection* sql) const;

 private:
  std::map<std::string, TenantAccount> changes_;
  std::int64_t virtual_time_ = 0;
};

// Reads the accounts of all tenants with waiting or running work or received time; with `all`, also of those that only
// have records.
absl::StatusOr<FairAccounts> ReadAccounts(SqlConnection* sql, bool all = false);
// The two halves of ReadAccounts(), for RunLater(): the statement, and the reader of its rows.
const std::string& AccountsSql(bool all = false);
FairAccounts AccountsOf(const SqlRows& rows);
// The statement for the account of one tenant, its only parameter.
const std::string& OwnAccountSql();

// The accounts that this process read last. In a long queue they change little within a moment, so they suffice for
// most decisions. Thread-safe.
class RecentAccounts {
 public:
  // Remembers accounts that were just read.
  void Put(const FairAccounts& accounts);
  // The remembered accounts; nullopt if they are older than 0.1 s, or if fewer than 1,000 pieces of work were waiting.
  std::optional<FairAccounts> Get() const;

 private:
  mutable std::mutex mutex_;
  // Guarded by mutex_.
  FairAccounts accounts_;
  std::chrono::steady_clock::time_point read_;
  bool is_long_ = false;  // whether the queue was long
};

// Sets the received time of all tenants to 0 if no work waits or runs.
absl::Status BeginAnew(SqlConnection* sql);

}  // namespace planish
