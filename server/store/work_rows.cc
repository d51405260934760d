#include "server/store/work_rows.h"

#include <string_view>

#include "absl/strings/str_cat.h"
#include "core/base/status_macros.h"

namespace planish {
namespace {

// RecentAccounts keeps accounts for kRecent, if at least kLongQueue pieces of work wait.
constexpr std::int64_t kLongQueue = 1000;
constexpr std::chrono::milliseconds kRecent(100);

constexpr char kSums[] =
    "SELECT tenant, CAST(sum(waiting) AS BIGINT), CAST(sum(waiting_bytes) AS BIGINT), CAST(sum(running) AS BIGINT), "
    "CAST(sum(started) AS BIGINT), CAST(sum(charged) AS BIGINT), CAST(sum(received) AS BIGINT), "
    "CAST(sum(ended) AS BIGINT), CAST(sum(result_bytes) AS BIGINT), CAST(sum(record_bytes) AS BIGINT), max(received) "
    "FROM tenants WHERE ";

}  // namespace

std::vector<WorkRow> WorkRowsOf(const SqlRows& rows) {
  std::vector<WorkRow> works(rows.size());
  for (std::size_t i = 0; i < rows.size(); ++i) {
    WorkRow& work = works[i];
    std::size_t column = 0;
    const auto text = [&] { return rows.Bytes(i, column++); };
    const auto integer = [&] { return rows.Int(i, column++); };
    work.name = text();
    work.tenant = text();
    work.number = integer();
    work.running = integer() != 0;
    work.turn_time = integer();
    work.memory_bytes = integer();
    work.mesh_bytes = integer();
    work.run_time = integer();
    work.alone = integer() != 0;
    work.wish = static_cast<Wish>(integer());
    work.owner = text();
    work.attempt = static_cast<int>(integer());
    work.lease_until = integer();
    work.start_time = integer();
    work.charge = integer();
    work.share = integer();
  }
  return works;
}

RowBatch WorkInserts() {
  return RowBatch::Of(absl::StrCat("INSERT INTO works (", kWorkColumns, ") VALUES {rows}"));
}

void InsertWork(const WorkRow& work, RowBatch* inserts) {
  inserts->Add({std::string_view(work.name), std::string_view(work.tenant), work.number, work.running ? 1 : 0,
                work.turn_time, work.memory_bytes, work.mesh_bytes, work.run_time, work.alone ? 1 : 0,
                static_cast<std::int64_t>(work.wish), std::string_view(work.owner), work.attempt, work.lease_until,
                work.start_time, work.charge, work.share});
}

RowBatch WorkUpdates() {
  return RowBatch::Update("works",
                          {"number", "running", "turn_time", "memory_bytes", "alone", "wish", "owner", "attempt",
                           "lease_until", "start_time", "charge", "share"},
                          "name");
}

void UpdateWork(const WorkRow& work, RowBatch* updates) {
  updates->Add({work.number, work.running ? 1 : 0, work.turn_time, work.memory_bytes, work.alone ? 1 : 0,
                static_cast<std::int64_t>(work.wish), std::string_view(work.owner), work.attempt, work.lease_until,
                work.start_time, work.charge, work.share, std::string_view(work.name)});
}

absl::Status DeleteWork(SqlConnection* sql, const std::string& name) {
  return sql->RunLater("DELETE FROM works WHERE name = ?", {std::string_view(name)});
}

absl::Status AccountChanges::Write(SqlConnection* sql) const {
  RowBatch sums = RowBatch::Of(
      "INSERT INTO tenants (tenant, slot, waiting, waiting_bytes, running, started, charged, received, ended, "
      "result_bytes, record_bytes) VALUES {rows} ON CONFLICT (tenant, slot) DO UPDATE SET "
      "waiting = tenants.waiting + excluded.waiting, waiting_bytes = tenants.waiting_bytes + excluded.waiting_bytes, "
      "running = tenants.running + excluded.running, started = tenants.started + excluded.started, "
      "charged = tenants.charged + excluded.charged, "
      "received = CASE WHEN tenants.tenant != '' THEN tenants.received + excluded.received "
      "WHEN excluded.received > tenants.received THEN excluded.received ELSE tenants.received END, "
      "ended = tenants.ended + excluded.ended, result_bytes = tenants.result_bytes + excluded.result_bytes, "
      "record_bytes = tenants.record_bytes + excluded.record_bytes");
  const auto add = [&](const std::string& tenant, const TenantAccount& change) {
    if (change == TenantAccount()) return;
    sums.Add({std::string_view(tenant), sql->Slot(), change.waiting, change.waiting_bytes, change.running,
              change.started, change.charged, change.received, change.ended, change.result_bytes, change.record_bytes});
  };
  TenantAccount virtual_time;
  virtual_time.received = virtual_time_;
  add("", virtual_time);
  for (const auto& [tenant, change] : changes_) add(tenant, change);
  return sums.Send(sql);
}

absl::Status BeginAnew(SqlConnection* sql) {
  return sql->RunLater(
      "UPDATE tenants SET received = 0 WHERE (tenant, slot) IN (SELECT tenant, slot FROM tenants "
      "WHERE received != 0 AND NOT EXISTS (SELECT 1 FROM works) {skip})",
      {});
}

const std::string& AccountsSql(bool all) {
  static const std::string everything = absl::StrCat(kSums, "{anywhere} GROUP BY tenant");
  static const std::string busy =
      absl::StrCat(everything, " HAVING sum(waiting) > 0 OR sum(running) > 0 OR sum(received) > 0");
  return all ? everything : busy;
}

const std::string& OwnAccountSql() {
  static const std::string sql = absl::StrCat(kSums, "tenant = ? GROUP BY tenant");
  return sql;
}

void RecentAccounts::Put(const FairAccounts& accounts) {
  std::int64_t waiting = 0;
  for (const auto& [tenant, account] : accounts.tenants) waiting += account.waiting;
  const std::lock_guard lock(mutex_);
  is_long_ = waiting >= kLongQueue;
  if (!is_long_) return;
  accounts_ = accounts;
  read_ = std::chrono::steady_clock::now();
}

std::optional<FairAccounts> RecentAccounts::Get() const {
  const std::lock_guard lock(mutex_);
  if (!is_long_ || std::chrono::steady_clock::now() - read_ > kRecent) return std::nullopt;
  return accounts_;
}

absl::StatusOr<FairAccounts> ReadAccounts(SqlConnection* sql, bool all) {
  PLANISH_ASSIGN_OR_RETURN(const SqlRows rows, sql->Run(AccountsSql(all), {}));
  return AccountsOf(rows);
}

FairAccounts AccountsOf(const SqlRows& rows) {
  FairAccounts accounts;
  for (std::size_t i = 0; i < rows.size(); ++i) {
    const std::string& tenant = rows.Bytes(i, 0);
    if (tenant.empty()) {
      accounts.virtual_time = rows.Int(i, 10);
      continue;
    }
    accounts.tenants[tenant] = {rows.Int(i, 1), rows.Int(i, 2), rows.Int(i, 3), rows.Int(i, 4), rows.Int(i, 5),
                                rows.Int(i, 6), rows.Int(i, 7), rows.Int(i, 8), rows.Int(i, 9)};
  }
  return accounts;
}

}  // namespace planish
