#include "server/store/job_questions.h"

#include <algorithm>
#include <limits>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"
#include "core/base/error.h"
#include "core/base/status_macros.h"
#include "server/store/job_transaction.h"
#include "server/store/work_rows.h"

namespace planish {
namespace {

// Written into statements, not a parameter of them: the indexes of results are partial.
constexpr int kSucceeded = 4;
static_assert(kSucceeded == v1::JOB_STATE_SUCCEEDED);

// SELECT of whole jobs WHERE `condition`.
std::string JobsWhere(const std::string& condition) {
  return absl::StrCat("SELECT ", kJobColumns, " FROM jobs WHERE ", condition);
}

// With a parameter for each condition, in the order of ListValues().
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

// Whether a record needs the blob.
absl::StatusOr<bool> UsesBlobIn(SqlConnection* sql, const BlobId& id) {
  const std::string_view tenant = id.tenant;
  const SqlBytes sha256 = {id.sha256};
  PLANISH_ASSIGN_OR_RETURN(
      const SqlRows rows,
      sql->Run(
          absl::StrCat(
              "SELECT 1 FROM jobs WHERE ended = 0 AND mesh_sha256 = ? AND tenant = ? UNION ALL "
              "SELECT 1 FROM jobs WHERE ended = 0 AND seams_sha256 = ? AND seams_sha256 != '' AND tenant = ? UNION ALL "
              "SELECT 1 FROM jobs WHERE ended = 1 AND {outcome} = ",
              kSucceeded,
              " AND uv_sha256 = ? AND uv_sha256 != '' "
              "AND tenant = ? LIMIT 1"),
          {sha256, tenant, sha256, tenant, sha256, tenant}));
  return !rows.empty();
}

}  // namespace

absl::StatusOr<SqlRows> JobQuestions::Ask(const std::string& sql, const std::vector<SqlValue>& values) {
  PLANISH_ASSIGN_OR_RETURN(const SqlDatabase::Lease connection, database_->Connect(SqlDatabase::Use::kRead));
  return connection->Run(sql, values);
}

absl::StatusOr<std::vector<JobRecord>> JobQuestions::All(const std::string& sql, const std::vector<SqlValue>& values) {
  PLANISH_ASSIGN_OR_RETURN(const SqlRows rows, Ask(sql, values));
  PLANISH_ASSIGN_OR_RETURN(std::vector<JobRow> jobs, JobRowsOf(rows));
  std::vector<JobRecord> records;
  records.reserve(jobs.size());
  for (JobRow& job : jobs) records.push_back(std::move(job.record));
  return records;
}

absl::StatusOr<std::optional<JobRecord>> JobQuestions::One(const std::string& sql,
                                                           const std::vector<SqlValue>& values) {
  PLANISH_ASSIGN_OR_RETURN(std::vector<JobRecord> records, All(sql, values));
  if (records.empty()) return std::nullopt;
  return std::move(records.front());
}

absl::StatusOr<std::optional<JobRecord>> JobQuestions::Find(const std::string& name) {
  return One(JobsWhere("name = ?"), {std::string_view(name)});
}

absl::StatusOr<std::optional<JobRecord>> JobQuestions::FindByRequestId(const std::string& tenant,
                                                                       const std::string& request_id) {
  return One(JobsWhere("tenant = ? AND request_id = ?"), {std::string_view(tenant), std::string_view(request_id)});
}

absl::StatusOr<std::optional<JobRecord>> JobQuestions::FindResult(const std::string& work_key) {
  static const std::string sql = JobsWhere(
      absl::StrCat("work_key = ? AND ended = 1 AND {outcome} = ", kSucceeded, " ORDER BY number DESC LIMIT 1"));
  return One(sql, {SqlBytes{work_key}});
}

absl::StatusOr<std::vector<JobRecord>> JobQuestions::List(const JobQuery& query) {
  return All(ListSql(query), ListValues(query));
}

absl::StatusOr<std::vector<JobRecord>> JobQuestions::Unfinished() {
  return All(JobsWhere("ended = 0 ORDER BY number"), {});
}

absl::StatusOr<std::optional<JobRecord>> JobQuestions::FirstEnded(const std::string& tenant, v1::JobState state) {
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
  return One(JobsWhere(condition + " ORDER BY end_time, number LIMIT 1"), values);
}

absl::StatusOr<JobTotals> JobQuestions::Totals() {
  PLANISH_ASSIGN_OR_RETURN(const SqlDatabase::Lease connection, database_->Connect(SqlDatabase::Use::kRead));
  PLANISH_ASSIGN_OR_RETURN(const FairAccounts accounts, ReadAccounts(connection.get(), /*all=*/true));
  JobTotals totals;
  for (const auto& [tenant, account] : accounts.tenants) {
    totals.tenants[tenant] = {account.ended, account.result_bytes, account.record_bytes};
  }
  return totals;
}

absl::StatusOr<FairAccounts> JobQuestions::Accounts() {
  PLANISH_ASSIGN_OR_RETURN(const SqlDatabase::Lease connection, database_->Connect(SqlDatabase::Use::kRead));
  return ReadAccounts(connection.get());
}

absl::StatusOr<absl::Time> JobQuestions::Now(const StoreClock& clock) {
  if (clock != nullptr) return clock();
  PLANISH_ASSIGN_OR_RETURN(const SqlRows now, Ask("SELECT {now}", {}));
  return absl::FromUnixNanos(now.Int(0, 0));
}

absl::StatusOr<QueueState> JobQuestions::Queue(const StoreClock& clock) {
  static const std::string all = absl::StrCat("SELECT ", kWorkColumns, " FROM works");
  PLANISH_ASSIGN_OR_RETURN(const SqlDatabase::Lease connection, database_->Connect(SqlDatabase::Use::kRead));
  QueueState state;
  PLANISH_ASSIGN_OR_RETURN(state.accounts, ReadAccounts(connection.get()));
  PLANISH_ASSIGN_OR_RETURN(const SqlRows works, connection->Run(all, {}));
  state.works = WorkRowsOf(works);
  const VerbContext context;
  PLANISH_ASSIGN_OR_RETURN(const std::int64_t now, JobTransaction(connection.get(), &context, &clock).Now());
  state.now = absl::FromUnixNanos(now);
  return state;
}

absl::StatusOr<std::vector<std::pair<std::string, Wish>>> JobQuestions::Wishes(const std::string& owner) {
  // Without kGoOn as a parameter: PostgreSQL would not know that the index works_by_wish has all that is wanted.
  static_assert(static_cast<int>(Wish::kGoOn) == 0);
  PLANISH_ASSIGN_OR_RETURN(
      const SqlRows rows,
      Ask("SELECT name, wish FROM works WHERE running = 1 AND owner = ? AND wish != 0", {std::string_view(owner)}));
  std::vector<std::pair<std::string, Wish>> wishes;
  for (std::size_t i = 0; i < rows.size(); ++i)
    wishes.emplace_back(rows.Bytes(i, 0), static_cast<Wish>(rows.Int(i, 1)));
  return wishes;
}

absl::StatusOr<bool> JobQuestions::IsUnderWay(const std::string& tenant, const std::string& work_key) {
  PLANISH_ASSIGN_OR_RETURN(const SqlRows rows,
                           Ask("SELECT 1 FROM jobs WHERE work_key = ? AND tenant = ? AND ended = 0 LIMIT 1",
                               {SqlBytes{work_key}, std::string_view(tenant)}));
  return !rows.empty();
}

absl::StatusOr<std::optional<JobRecord>> JobQuestions::LastEnded(const std::string& tenant) {
  static const std::string sql = JobsWhere("ended = 1 AND tenant = ? ORDER BY end_time DESC, number DESC LIMIT 1");
  return One(sql, {std::string_view(tenant)});
}

absl::StatusOr<std::optional<v1::Progress>> JobQuestions::LastProgress(std::int64_t number) {
  PLANISH_ASSIGN_OR_RETURN(
      const SqlRows rows,
      Ask("SELECT kind, event FROM events WHERE job = ? AND kind = 2 ORDER BY sequence DESC LIMIT 1", {number}));
  PLANISH_ASSIGN_OR_RETURN(const std::vector<v1::JobEvent> events, EventsOf(rows, 0));
  if (events.empty()) return std::nullopt;
  return events.back().progress();
}

absl::StatusOr<std::vector<v1::JobEvent>> JobQuestions::Events(std::int64_t number, std::int64_t after) {
  PLANISH_ASSIGN_OR_RETURN(
      const SqlRows rows,
      Ask("SELECT kind, event FROM events WHERE job = ? AND sequence > ? ORDER BY sequence", {number, after}));
  return EventsOf(rows, after);
}

absl::StatusOr<std::vector<JobPosition>> JobQuestions::Positions(const std::vector<std::int64_t>& numbers) {
  // One statement for any number of them, which a connection prepares once.
  constexpr std::size_t kAtOnce = 64;
  static const std::string sql = absl::StrCat(
      "SELECT number, ended, COALESCE((SELECT max(sequence) FROM events WHERE job = number), 0) "
      "FROM jobs WHERE number IN (",
      absl::StrJoin(std::vector<std::string>(kAtOnce, "?"), ", "), ")");
  std::vector<JobPosition> positions;
  for (std::size_t begin = 0; begin < numbers.size(); begin += kAtOnce) {
    std::vector<SqlValue> values(kAtOnce, std::int64_t{0});  // no job has that number
    for (std::size_t i = begin; i < std::min(begin + kAtOnce, numbers.size()); ++i) values[i - begin] = numbers[i];
    PLANISH_ASSIGN_OR_RETURN(const SqlRows rows, Ask(sql, values));
    for (std::size_t i = 0; i < rows.size(); ++i) {
      positions.push_back({rows.Int(i, 0), rows.Int(i, 2), rows.Int(i, 1) != 0});
    }
  }
  return positions;
}

absl::StatusOr<bool> JobQuestions::UsesBlob(const BlobId& id) {
  PLANISH_ASSIGN_OR_RETURN(const SqlDatabase::Lease connection, database_->Connect(SqlDatabase::Use::kRead));
  return UsesBlobIn(connection.get(), id);
}

absl::StatusOr<std::vector<std::pair<BlobId, std::int64_t>>> JobQuestions::List() {
  PLANISH_ASSIGN_OR_RETURN(const SqlRows rows,
                           Ask("SELECT tenant, sha256, CAST(length(bytes) AS BIGINT) FROM blobs", {}));
  std::vector<std::pair<BlobId, std::int64_t>> blobs;
  for (std::size_t i = 0; i < rows.size(); ++i) {
    blobs.push_back({{rows.Bytes(i, 0), rows.Bytes(i, 1)}, rows.Int(i, 2)});
  }
  return blobs;
}

absl::StatusOr<std::string> JobQuestions::Read(const BlobId& id) {
  PLANISH_ASSIGN_OR_RETURN(const SqlRows rows, Ask("SELECT bytes FROM blobs WHERE tenant = ? AND sha256 = ?",
                                                   {std::string_view(id.tenant), SqlBytes{id.sha256}}));
  if (!rows.empty()) return rows.Bytes(0, 0);
  return MakeError(absl::StatusCode::kNotFound, "BLOB_NOT_FOUND", "the job store does not have the bytes any more");
}

absl::StatusOr<bool> JobQuestions::Remove(const BlobId& id) {
  bool used = false;
  const absl::Status status = Transact(database_, Durability::kLater, [&](SqlConnection& sql) -> absl::Status {
    const std::vector<SqlValue> key = {std::string_view(id.tenant), SqlBytes{id.sha256}};
    // Whoever commits a record that refers to the blob writes its row in the same transaction: one waits for the other.
    PLANISH_RETURN_IF_ERROR(sql.Run("SELECT 1 FROM blobs WHERE tenant = ? AND sha256 = ? {lock}", key).status());
    PLANISH_ASSIGN_OR_RETURN(used, UsesBlobIn(&sql, id));
    return used ? absl::OkStatus() : sql.RunLater("DELETE FROM blobs WHERE tenant = ? AND sha256 = ?", key);
  });
  PLANISH_RETURN_IF_ERROR(status);
  return !used;
}

}  // namespace planish
