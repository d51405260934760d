// The rows beside those of jobs: pieces of work, and the accounts of tenants.
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

// New works, for InsertWork().
RowBatch WorkInserts();
void InsertWork(const WorkRow& work, RowBatch* inserts);
absl::Status DeleteWork(SqlConnection* sql, const std::string& name);
// Works that change, for UpdateWork().
RowBatch WorkUpdates();
void UpdateWork(const WorkRow& work, RowBatch* updates);

// What a transaction adds to accounts, written at its end: whoever holds rows of tenants takes no other locks, so that
// no two transactions wait for each other.
class AccountChanges {
 public:
  TenantAccount& of(const std::string& tenant) { return changes_[tenant]; }
  void RaiseVirtualTime(std::int64_t value) { virtual_time_ = std::max(virtual_time_, value); }
  absl::Status Write(SqlConnection* sql) const;

 private:
  std::map<std::string, TenantAccount> changes_;
  std::int64_t virtual_time_ = 0;
};

// Of all tenants that have something waiting or running or received something, and where `all`, of all that have
// records.
absl::StatusOr<FairAccounts> ReadAccounts(SqlConnection* sql, bool all = false);
// The same in two halves, for RunLater(): what to ask, and what the rows say.
const std::string& AccountsSql(bool all = false);
FairAccounts AccountsOf(const SqlRows& rows);
// What to ask for the account of one tenant, the only parameter.
const std::string& OwnAccountSql();

// Accounts as this process read them last: of a long queue, which a moment does not change much, that is enough for
// most decisions. Thread-safe.
class RecentAccounts {
 public:
  // As they are now.
  void Put(const FairAccounts& accounts);
  // Empty: they are older than a tenth of a second, or fewer than a thousand pieces of work were waiting.
  std::optional<FairAccounts> Get() const;

 private:
  mutable std::mutex mutex_;
  // Guarded by mutex_.
  FairAccounts accounts_;
  std::chrono::steady_clock::time_point read_;
  bool is_long_ = false;  // the queue
};

// If there is no work at all, what tenants received is forgotten.
absl::Status BeginAnew(SqlConnection* sql);

}  // namespace planish
