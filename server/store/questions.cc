// JobStore's read-only functions.

#include <algorithm>
#include <limits>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"
#include "core/base/status_macros.h"
#include "server/store/job_store_parts.h"
#include "server/store/job_transaction.h"
#include "server/store/sql_blob_rows.h"
#include "server/store/work_rows.h"

namespace planish {
namespace {

// Selects whole jobs WHERE `condition`.
std::string JobsWhere(const std::string& condition) {
  return absl::StrCat("SELECT ", kJobColumns, " FROM jobs WHERE ", condition);
}

// The statement of List(). Has a parameter for each condition, in the order of ListValues().
std::string ListSql(const JobQuery& query) {
  std::string sql =
      absl::StrCat("SELECT ", query.with_reports ? kJobColumns : kLeanJobColumns, " FROM jobs WHERE number < ?");
  if (!query.filter.tenant.empty()) absl::StrAppend(&sql, " AND tenant = ?");
  if (query.filter.from.has_value()) absl::StrAppend(&sql, " AND create_time >= ?");
  if (query.filter.before.has_value()) absl::StrAppend(&sql, " AND create_time < ?");
  for (const StateCondition& condition : query.filter.states) {
    absl::StrAppend(&sql, " AND state ", condition.negated ? "!=" : "=", " ?");
  }
  for (const LabelCondition& condition : query.filter.labels) {
    absl::StrAppend(&sql, " AND ", condition.negated ? "NOT " : "",
                    "EXISTS (SELECT 1 FROM labels WHERE job = number AND key = ?");
    if (condition.kind == LabelCondition::Kind::kEquals) absl::StrAppend(&sql, " AND value = ?");
    if (condition.kind == LabelCondition::Kind::kBeginsWith) {
      absl::StrAppend(&sql, " AND substr(value, 1, length(?)) = ?");
    }
    absl::StrAppend(&sql, ")");
  }
  return absl::StrCat(sql, " ORDER BY number DESC LIMIT ?");
}

std::vector<SqlValue> ListValues(const JobQuery& query) {
  constexpr std::int64_t kMost = std::numeric_limits<std::int64_t>::max();
  std::vector<SqlValue> values = {query.before_number > 0 ? query.before_number : kMost};
  if (!query.filter.tenant.empty()) values.emplace_back(std::string_view(query.filter.tenant));
  if (query.filter.from.has_value()) values.emplace_back(absl::ToUnixNanos(*query.filter.from));
  if (query.filter.before.has_value()) values.emplace_back(absl::ToUnixNanos(*query.filter.before));
  for (const StateCondition& condition : query.filter.states) values.emplace_back(std::int64_t{condition.state});
  for (const LabelCondition& condition : query.filter.labels) {
    values.emplace_back(std::string_view(condition.key));
    if (condition.kind == LabelCondition::Kind::kBeginsWith) values.emplace_back(std::string_view(condition.value));
    if (condition.kind != LabelCondition::Kind::kExists) values.emplace_back(std::string_view(condition.value));
  }
  values.emplace_back(query.limit > 0 ? std::int64_t{query.limit} : kMost);
  return values;
}

absl::StatusOr<SqlRows> Ask(SqlDatabase* database, const std::string& sql, const std::vector<SqlValue>& values) {
  PLANISH_ASSIGN_OR_RETURN(const SqlDatabase::Lease connection, database->Connect(SqlDatabase::Use::kRead));
  return connection->Run(sql, values);
}

absl::StatusOr<std::vector<JobRecord>> All(SqlDatabase* database, const std::string& sql,
                                           const std::vector<SqlValue>& values) {
  PLANISH_ASSIGN_OR_RETURN(const SqlRows rows, Ask(database, sql, values));
  PLANISH_ASSIGN_OR_RETURN(std::vector<JobRow> jobs, JobRowsOf(rows));
  std::vector<JobRecord> records;
  records.reserve(jobs.size());
  for (JobRow& job : jobs) records.push_back(std::move(job.record));
  return records;
}

absl::StatusOr<std::optional<JobRecord>> One(SqlDatabase* database, const std::string& sql,
                                             const std::vector<SqlValue>& values) {
  PLANISH_ASSIGN_OR_RETURN(std::vector<JobRecord> records, All(database, sql, values));
  if (records.empty()) return std::nullopt;
  return std::move(records.front());
}

}  // namespace

absl::StatusOr<std::optional<JobRecord>> JobStore::Find(const std::string& name) {
  return One(parts_->database.get(), JobsWhere("name = ?"), {std::string_view(name)});
}

absl::StatusOr<std::optional<JobRecord>> JobStore::FindByRequestId(const std::string& tenant,
                                                                   const std::string& request_id) {
  return One(parts_->database.get(), JobsWhere("tenant = ? AND request_id = ?"),
             {std::string_view(tenant), std::string_view(request_id)});
}

absl::StatusOr<std::optional<JobRecord>> JobStore::FindResult(const std::string& work_key) {
  static const std::string sql = JobsWhere(
      absl::StrCat("work_key = ? AND ended = 1 AND {outcome} = ", kSucceeded, " ORDER BY number DESC LIMIT 1"));
  return One(parts_->database.get(), sql, {SqlBytes{work_key}});
}

absl::StatusOr<std::vector<JobRecord>> JobStore::List(const JobQuery& query) {
  return All(parts_->database.get(), ListSql(query), ListValues(query));
}

absl::StatusOr<std::vector<JobRecord>> JobStore::Unfinished() {
  return All(parts_->database.get(), JobsWhere("ended = 0 ORDER BY number"), {});
}

absl::StatusOr<std::optional<JobRecord>> JobStore::FirstEnded(const std::string& tenant, v1::JobState state) {
  std::string condition = "ended = 1";
  std::vector<SqlValue> values;
  if (!tenant.empty()) {
    condition += " AND tenant = ?";
    values.emplace_back(std::string_view(tenant));
  }
  if (state != v1::JOB_STATE_UNSPECIFIED) {
    condition += " AND {outcome} = ?";
    values.emplace_back(std::int64_t{state});
  }
  return One(parts_->database.get(), JobsWhere(condition + " ORDER BY end_time, number LIMIT 1"), values);
}

absl::StatusOr<JobTotals> JobStore::Totals() {
  PLANISH_ASSIGN_OR_RETURN(const SqlDatabase::Lease connection, parts_->database->Connect(SqlDatabase::Use::kRead));
  PLANISH_ASSIGN_OR_RETURN(const FairAccounts accounts, ReadAccounts(connection.get(), /*all=*/true));
  JobTotals totals;
  for (const auto& [tenant, account] : accounts.tenants) {
    totals.tenants[tenant] = {account.ended, account.result_bytes, account.record_bytes};
  }
  return totals;
}

absl::StatusOr<FairAccounts> JobStore::Accounts() {
  PLANISH_ASSIGN_OR_RETURN(const SqlDatabase::Lease connection, parts_->database->Connect(SqlDatabase::Use::kRead));
  return ReadAccounts(connection.get());
}

absl::StatusOr<absl::Time> JobStore::Now() {
  if (parts_->clock != nullptr) return parts_->clock();
  PLANISH_ASSIGN_OR_RETURN(const SqlRows now, Ask(parts_->database.get(), "SELECT {now}", {}));
  return absl::FromUnixNanos(now.Int(0, 0));
}

absl::StatusOr<QueueState> JobStore::Queue() {
  static const std::string all = absl::StrCat("SELECT ", kWorkColumns, " FROM works");
  PLANISH_ASSIGN_OR_RETURN(const SqlDatabase::Lease connection, parts_->database->Connect(SqlDatabase::Use::kRead));
  QueueState state;
  PLANISH_ASSIGN_OR_RETURN(state.accounts, ReadAccounts(connection.get()));
  PLANISH_ASSIGN_OR_RETURN(const SqlRows works, connection->Run(all, {}));
  state.works = WorkRowsOf(works);
  const VerbContext context;
  PLANISH_ASSIGN_OR_RETURN(const std::int64_t now, JobTransaction(connection.get(), &context, &parts_->clock).Now());
  state.now = absl::FromUnixNanos(now);
  return state;
}

absl::StatusOr<QueueCounts> JobStore::Counts(const std::string& owner) {
  PLANISH_ASSIGN_OR_RETURN(const SqlDatabase::Lease connection, parts_->database->Connect(SqlDatabase::Use::kRead));
  QueueCounts counts;
  PLANISH_ASSIGN_OR_RETURN(
      const SqlRows jobs,
      connection->Run("SELECT tenant, state, priority, count(*), min(create_time) FROM jobs WHERE ended = 0 "
                      "GROUP BY tenant, state, priority",
                      {}));
  for (std::size_t i = 0; i < jobs.size(); ++i) {
    counts.jobs.push_back({jobs.Bytes(i, 0), static_cast<v1::JobState>(jobs.Int(i, 1)),
                           static_cast<v1::Priority>(jobs.Int(i, 2)), jobs.Int(i, 3),
                           absl::FromUnixNanos(jobs.Int(i, 4))});
  }
  PLANISH_ASSIGN_OR_RETURN(const SqlRows works,
                           connection->Run("SELECT running, CASE WHEN owner = ? THEN 1 ELSE 0 END AS own, count(*), "
                                           "CAST(sum(memory_bytes) AS BIGINT) FROM works GROUP BY running, own",
                                           {std::string_view(owner)}));
  for (std::size_t i = 0; i < works.size(); ++i) {
    if (works.Int(i, 0) == 0) {
      counts.waiting_works += works.Int(i, 2);
      continue;
    }
    counts.running_works += works.Int(i, 2);
    counts.reserved_bytes += works.Int(i, 3);
    if (works.Int(i, 1) == 0) continue;
    counts.own_running_works += works.Int(i, 2);
    counts.own_reserved_bytes += works.Int(i, 3);
  }
  const VerbContext context;
  PLANISH_ASSIGN_OR_RETURN(const std::int64_t now, JobTransaction(connection.get(), &context, &parts_->clock).Now());
  counts.now = absl::FromUnixNanos(now);
  return counts;
}

absl::StatusOr<std::vector<std::pair<std::string, Wish>>> JobStore::Wishes(const std::string& owner) {
  // kGoOn is not a parameter, or PostgreSQL would not know that the partial index works_by_wish suffices.
  static_assert(static_cast<int>(Wish::kGoOn) == 0);
  PLANISH_ASSIGN_OR_RETURN(
      const SqlRows rows,
      Ask(parts_->database.get(), "SELECT name, wish FROM works WHERE running = 1 AND owner = ? AND wish != 0",
          {std::string_view(owner)}));
  std::vector<std::pair<std::string, Wish>> wishes;
  for (std::size_t i = 0; i < rows.size(); ++i)
    wishes.emplace_back(rows.Bytes(i, 0), static_cast<Wish>(rows.Int(i, 1)));
  return wishes;
}

absl::StatusOr<bool> JobStore::IsUnderWay(const std::string& tenant, const std::string& work_key) {
  PLANISH_ASSIGN_OR_RETURN(
      const SqlRows rows,
      Ask(parts_->database.get(), "SELECT 1 FROM jobs WHERE work_key = ? AND tenant = ? AND ended = 0 LIMIT 1",
          {SqlBytes{work_key}, std::string_view(tenant)}));
  return !rows.empty();
}

absl::StatusOr<std::optional<JobRecord>> JobStore::LastEnded(const std::string& tenant) {
  static const std::string sql = JobsWhere("ended = 1 AND tenant = ? ORDER BY end_time DESC, number DESC LIMIT 1");
  return One(parts_->database.get(), sql, {std::string_view(tenant)});
}

absl::StatusOr<std::optional<v1::Progress>> JobStore::LastProgress(std::int64_t number) {
  PLANISH_ASSIGN_OR_RETURN(
      const SqlRows rows,
      Ask(parts_->database.get(),
          "SELECT kind, event FROM events WHERE job = ? AND kind = 2 ORDER BY sequence DESC LIMIT 1", {number}));
  PLANISH_ASSIGN_OR_RETURN(const std::vector<v1::JobEvent> events, EventsOf(rows, 0));
  if (events.empty()) return std::nullopt;
  return events.back().progress();
}

absl::StatusOr<std::vector<v1::JobEvent>> JobStore::Events(std::int64_t number, std::int64_t after) {
  PLANISH_ASSIGN_OR_RETURN(
      const SqlRows rows,
      Ask(parts_->database.get(), "SELECT kind, event FROM events WHERE job = ? AND sequence > ? ORDER BY sequence",
          {number, after}));
  return EventsOf(rows, after);
}

absl::StatusOr<std::vector<JobPosition>> JobStore::Positions(const std::vector<std::int64_t>& numbers) {
  // The statement is the same for any number of jobs, so that a connection prepares it once.
  constexpr std::size_t kAtOnce = 64;
  static const std::string sql = absl::StrCat(
      "SELECT number, ended, COALESCE((SELECT max(sequence) FROM events WHERE job = number), 0) "
      "FROM jobs WHERE number IN (",
      absl::StrJoin(std::vector<std::string>(kAtOnce, "?"), ", "), ")");
  std::vector<JobPosition> positions;
  for (std::size_t begin = 0; begin < numbers.size(); begin += kAtOnce) {
    std::vector<SqlValue> values(kAtOnce, std::int64_t{0});  // no job has that number
    for (std::size_t i = begin; i < std::min(begin + kAtOnce, numbers.size()); ++i) values[i - begin] = numbers[i];
    PLANISH_ASSIGN_OR_RETURN(const SqlRows rows, Ask(parts_->database.get(), sql, values));
    for (std::size_t i = 0; i < rows.size(); ++i) {
      positions.push_back({rows.Int(i, 0), rows.Int(i, 2), rows.Int(i, 1) != 0});
    }
  }
  return positions;
}

absl::StatusOr<bool> JobStore::UsesBlob(const BlobId& id) {
  PLANISH_ASSIGN_OR_RETURN(const SqlDatabase::Lease connection, parts_->database->Connect(SqlDatabase::Use::kRead));
  return UsesBlobRow(connection.get(), id);
}

}  // namespace planish
