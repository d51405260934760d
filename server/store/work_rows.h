// The rows beside those of jobs: pieces of work, and the accounts of tenants.
#pragma once

#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "server/store/fair_share.h"
#include "server/store/job_store.h"
#include "server/store/sql.h"

namespace planish {

// A piece of work that has not ended. Times in nanoseconds since 1970.
struct WorkRow {
  std::string name, tenant;
  std::int64_t number = 0;  // lowest of its jobs
  bool running = false;     // there is a lease, which may be over
  std::int64_t turn_time = 0;
  std::int64_t memory_bytes = 0;
  std::int64_t mesh_bytes = 0;
  std::int64_t run_time = 0;  // expected; a duration
  bool alone = false;         // nothing else may run on the same owner
  Wish wish = Wish::kGoOn;
  // While it runs, but for the attempt, which stays.
  std::string owner;
  int attempt = 0;
  std::int64_t lease_until = 0;
  std::int64_t start_time = 0;
  std::int64_t charge = 0;         // TenantAccount::charged
  std::int64_t share = 1'000'000;  // the tenant's when it was claimed, millionths

  bool operator==(const WorkRow&) const = default;
};

inline constexpr char kWorkColumns[] =
    "name, tenant, number, running, turn_time, memory_bytes, mesh_bytes, run_time, alone, wish, owner, attempt, "
    "lease_until, start_time, charge, share";

std::vector<WorkRow> WorkRowsOf(const SqlRows& rows);

absl::Status InsertWork(SqlConnection* sql, const WorkRow& work);
absl::Status UpdateWork(SqlConnection* sql, const WorkRow& work);
absl::Status DeleteWork(SqlConnection* sql, const std::string& name);

// What a transaction adds to accounts, written at its end: whoever holds rows of tenants takes no other locks, so that
// no two transactions wait for each other.
class AccountChanges {
 public:
  TenantAccount& of(const std::string& tenant) { return changes_[tenant]; }
  void RaiseVirtualTime(std::int64_t value) { virtual_time_ = std::max(virtual_time_, value); }
  // Work is gone: if there is none left, all tenants begin anew.
  void NoteEndOfWork() { work_ended_ = true; }

  absl::Status Write(SqlConnection* sql) const;

 private:
  std::map<std::string, TenantAccount> changes_;
  std::int64_t virtual_time_ = 0;
  bool work_ended_ = false;
};

// Of all tenants that have something waiting or running, and where `all`, of all that have records.
absl::StatusOr<FairAccounts> ReadAccounts(SqlConnection* sql, bool all = false);

}  // namespace planish
