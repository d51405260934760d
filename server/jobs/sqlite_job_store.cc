#include <algorithm>
#include <iterator>
#include <mutex>
#include <utility>

#include "absl/strings/str_cat.h"
#include "core/base/error.h"
#include "core/base/status_macros.h"
#include "google/protobuf/util/time_util.h"
#include "server/access/caller.h"
#include "server/jobs/ids.h"
#include "server/jobs/job_store.h"
#include "server/jobs/lifecycle.h"
#include "server/jobs/sqlite.h"

namespace planish {
namespace {

using google::protobuf::util::TimeUtil;

// Steps from each version of the schema to the next; PRAGMA user_version says how many were taken. Never change one
// that was released: add another.
constexpr const char* kMigrations[] = {
    R"sql(
      CREATE TABLE meta (id TEXT NOT NULL);
      CREATE TABLE jobs (
        number INTEGER PRIMARY KEY,
        name TEXT NOT NULL UNIQUE,
        request_id TEXT UNIQUE,
        state INTEGER NOT NULL,
        ended INTEGER NOT NULL,
        end_time INTEGER NOT NULL,
        label TEXT NOT NULL,
        work_key BLOB NOT NULL,
        mesh_sha256 BLOB NOT NULL,
        seams_sha256 BLOB NOT NULL,
        uv_sha256 BLOB NOT NULL,
        uv_bytes INTEGER NOT NULL,
        record BLOB NOT NULL,
        report BLOB
      );
      CREATE INDEX jobs_by_end ON jobs (ended, end_time, number);
      CREATE INDEX jobs_by_state ON jobs (state, end_time, number);
      CREATE INDEX jobs_by_work ON jobs (work_key);
      CREATE INDEX jobs_by_mesh ON jobs (mesh_sha256) WHERE ended = 0;
      CREATE INDEX jobs_by_seams ON jobs (seams_sha256) WHERE ended = 0;
      CREATE INDEX jobs_by_uv ON jobs (uv_sha256);
      CREATE TABLE events (
        job INTEGER NOT NULL,
        sequence INTEGER NOT NULL,
        event BLOB NOT NULL,
        PRIMARY KEY (job, sequence)
      ) WITHOUT ROWID;
    )sql",
    // Tenants. Request ids are unique within each, which takes a new table: SQLite cannot drop a constraint.
    R"sql(
      CREATE TABLE tenants_jobs (
        number INTEGER PRIMARY KEY,
        name TEXT NOT NULL UNIQUE,
        tenant TEXT NOT NULL,
        request_id TEXT,
        state INTEGER NOT NULL,
        ended INTEGER NOT NULL,
        end_time INTEGER NOT NULL,
        label TEXT NOT NULL,
        work_key BLOB NOT NULL,
        mesh_sha256 BLOB NOT NULL,
        seams_sha256 BLOB NOT NULL,
        uv_sha256 BLOB NOT NULL,
        uv_bytes INTEGER NOT NULL,
        record BLOB NOT NULL,
        report BLOB,
        UNIQUE (tenant, request_id)
      );
      INSERT INTO tenants_jobs
        SELECT number, name, 'default', request_id, state, ended, end_time, label, work_key, mesh_sha256, seams_sha256,
               uv_sha256, uv_bytes, record, report FROM jobs;
      DROP TABLE jobs;
      ALTER TABLE tenants_jobs RENAME TO jobs;
      CREATE INDEX jobs_by_end ON jobs (ended, end_time, number);
      CREATE INDEX jobs_by_state ON jobs (state, end_time, number);
      CREATE INDEX jobs_by_tenant ON jobs (tenant, number);
      CREATE INDEX jobs_by_tenant_end ON jobs (tenant, ended, end_time, number);
      CREATE INDEX jobs_by_tenant_state ON jobs (tenant, state, end_time, number);
      CREATE INDEX jobs_by_work ON jobs (work_key);
      CREATE INDEX jobs_by_mesh ON jobs (mesh_sha256) WHERE ended = 0;
      CREATE INDEX jobs_by_seams ON jobs (seams_sha256) WHERE ended = 0;
      CREATE INDEX jobs_by_uv ON jobs (uv_sha256);
    )sql",
    // Small blobs, which are committed with the records that refer to them.
    R"sql(
      CREATE TABLE blobs (
        tenant TEXT NOT NULL,
        sha256 BLOB NOT NULL,
        bytes BLOB NOT NULL,
        UNIQUE (tenant, sha256)
      );
    )sql",
    // Labels with keys, and what else lists are filtered by. The text that was a job's label before is given up.
    R"sql(
      ALTER TABLE jobs DROP COLUMN label;
      ALTER TABLE jobs ADD COLUMN create_time INTEGER NOT NULL DEFAULT 0;
      CREATE TABLE labels (
        job INTEGER NOT NULL,
        key TEXT NOT NULL,
        value TEXT NOT NULL,
        PRIMARY KEY (job, key)
      ) WITHOUT ROWID;
    )sql",
};
constexpr std::int64_t kVersion = std::size(kMigrations);
constexpr std::int64_t kWithoutCreateTimes = 3;  // the last version

// Pages of the log that are collected before they are copied into the database, which takes two more syncs.
constexpr char kPragmas[] =
    "PRAGMA journal_mode = WAL; PRAGMA synchronous = FULL; PRAGMA wal_autocheckpoint = 4000; PRAGMA busy_timeout = "
    "10000";

class SqliteJobStore : public JobStore, private BlobRows {
 public:
  static absl::StatusOr<std::unique_ptr<JobStore>> Open(const std::string& path) {
    PLANISH_ASSIGN_OR_RETURN(Database database, Database::Open(path));
    std::unique_ptr<SqliteJobStore> store(new SqliteJobStore(std::move(database)));
    PLANISH_RETURN_IF_ERROR(store->SetUp(path));
    return store;
  }

  const std::string& id() const override { return id_; }

  absl::Status Write(const std::vector<JobWrite>& writes, Durability durability) override {
    PLANISH_RETURN_IF_ERROR(Begin(durability));
    absl::Status status;
    for (const JobWrite& write : writes) {
      for (const BlobRow& blob : write.blobs) {
        if (status.ok()) status = PutBlob(blob);
      }
      if (status.ok()) status = PutRecord(*write.record);
      if (status.ok() && write.event != nullptr) status = PutEvent(write.record->number(), *write.event);
    }
    return End(std::move(status));
  }

  absl::StatusOr<std::optional<JobRecord>> Find(const std::string& name) override { return One(find_.BindText(name)); }

  absl::StatusOr<std::optional<JobRecord>> FindByRequestId(const std::string& tenant,
                                                           const std::string& request_id) override {
    return One(find_by_request_id_.BindText(tenant).BindText(request_id));
  }

  absl::StatusOr<std::optional<JobRecord>> FindResult(const std::string& work_key) override {
    return One(find_result_.BindBlob(work_key).Bind(v1::JOB_STATE_SUCCEEDED));
  }

  absl::StatusOr<std::vector<JobRecord>> List(const JobQuery& query) override {
    PLANISH_ASSIGN_OR_RETURN(Statement list, database_.Prepare(ListSql(query).c_str()));
    if (query.before_number > 0) list.Bind(query.before_number);
    if (!query.filter.tenant.empty()) list.BindText(query.filter.tenant);
    if (query.filter.from.has_value()) list.Bind(absl::ToUnixNanos(*query.filter.from));
    if (query.filter.before.has_value()) list.Bind(absl::ToUnixNanos(*query.filter.before));
    for (const StateCondition& condition : query.filter.states) list.Bind(condition.state);
    for (const LabelCondition& condition : query.filter.labels) {
      list.BindText(condition.key);
      if (condition.kind == LabelCondition::Kind::kBeginsWith) list.BindText(condition.value);
      if (condition.kind != LabelCondition::Kind::kExists) list.BindText(condition.value);
    }
    return All(list.Bind(query.limit > 0 ? query.limit : -1));
  }

  absl::StatusOr<std::vector<JobRecord>> Unfinished() override { return All(unfinished_); }

  absl::StatusOr<std::optional<JobRecord>> FirstEnded(const std::string& tenant, v1::JobState state) override {
    const bool any_state = state == v1::JOB_STATE_UNSPECIFIED;
    if (tenant.empty()) return any_state ? One(first_ended_) : One(first_in_state_.Bind(state));
    return any_state ? One(first_ended_of_.BindText(tenant)) : One(first_in_state_of_.BindText(tenant).Bind(state));
  }

  absl::StatusOr<JobTotals> Totals() override {
    JobTotals totals;
    totals_.Bind(v1::JOB_STATE_SUCCEEDED);
    absl::StatusOr<bool> row = totals_.Step();
    for (; row.ok() && *row; row = totals_.Step()) {
      totals.tenants[totals_.Bytes(0)] = {totals_.Int(1), totals_.Int(2)};
      totals.last_number = std::max(totals.last_number, totals_.Int(3));
    }
    totals_.Reset();
    PLANISH_RETURN_IF_ERROR(row.status());
    return totals;
  }

  absl::StatusOr<std::vector<v1::JobEvent>> Events(std::int64_t number) override {
    return Rows<v1::JobEvent>(events_.Bind(number));
  }

  absl::Status Delete(std::int64_t number) override {
    PLANISH_RETURN_IF_ERROR(Begin(Durability::kLater));
    absl::Status status = delete_events_.Bind(number).Run();
    if (status.ok()) status = delete_labels_.Bind(number).Run();
    if (status.ok()) status = delete_.Bind(number).Run();
    return End(std::move(status));
  }

  absl::StatusOr<bool> UsesBlob(const BlobId& id) override {
    uses_blob_.BindBlob(id.sha256).BindText(id.tenant).Bind(v1::JOB_STATE_SUCCEEDED);
    const absl::StatusOr<bool> row = uses_blob_.Step();
    uses_blob_.Reset();
    return row;
  }

  BlobRows* rows() override { return reader_.has_value() ? this : nullptr; }

 private:
  explicit SqliteJobStore(Database database) : database_(std::move(database)) {}

  // ---- BlobRows

  absl::StatusOr<std::vector<std::pair<BlobId, std::int64_t>>> List() override {
    std::vector<std::pair<BlobId, std::int64_t>> rows;
    absl::StatusOr<bool> row = list_blobs_.Step();
    for (; row.ok() && *row; row = list_blobs_.Step()) {
      rows.push_back({{list_blobs_.Bytes(0), list_blobs_.Bytes(1)}, list_blobs_.Int(2)});
    }
    list_blobs_.Reset();
    PLANISH_RETURN_IF_ERROR(row.status());
    return rows;
  }

  absl::StatusOr<std::string> Read(const BlobId& id) override {
    const std::lock_guard lock(reader_mutex_);
    read_blob_.BindText(id.tenant).BindBlob(id.sha256);
    const absl::StatusOr<bool> row = read_blob_.Step();
    std::string bytes;
    if (row.ok() && *row) bytes = read_blob_.Bytes(0);
    read_blob_.Reset();
    PLANISH_RETURN_IF_ERROR(row.status());
    if (*row) return bytes;
    return MakeError(absl::StatusCode::kNotFound, "BLOB_NOT_FOUND", "the job store does not have the bytes any more");
  }

  absl::Status Remove(const BlobId& id) override {
    PLANISH_RETURN_IF_ERROR(Begin(Durability::kLater));
    return End(delete_blob_.BindText(id.tenant).BindBlob(id.sha256).Run());
  }

  // With a parameter for each condition, in the order of List().
  static std::string ListSql(const JobQuery& query) {
    std::string sql = absl::StrCat("SELECT record, ", query.with_reports ? "report" : "NULL", " FROM jobs WHERE 1");
    if (query.before_number > 0) absl::StrAppend(&sql, " AND number < ?");
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

  // ---- transactions

  absl::Status Begin(Durability durability) {
    if (durability != durability_) {
      PLANISH_RETURN_IF_ERROR(database_.Execute(durability == Durability::kNow ? "PRAGMA synchronous = FULL"
                                                                               : "PRAGMA synchronous = NORMAL"));
      durability_ = durability;
    }
    return begin_.Run();
  }

  // Commits if `status`, that of all statements, is OK; returns what went wrong first.
  absl::Status End(absl::Status status) {
    if (status.ok()) status = commit_.Run();
    if (!status.ok()) rollback_.Run().IgnoreError();
    return status;
  }

  absl::Status SetUp(const std::string& path) {
    // FULL: a commit syncs the log before it returns, so that what a caller is told outlives a loss of power. Writes
    // that may be lost with the power and are then made again (deletions) run with NORMAL: Begin().
    PLANISH_RETURN_IF_ERROR(database_.Execute(kPragmas));
    PLANISH_RETURN_IF_ERROR(Migrate(path));
    PLANISH_RETURN_IF_ERROR(PrepareAll());
    if (path != ":memory:") {
      PLANISH_ASSIGN_OR_RETURN(reader_, Database::Open(path));
      PLANISH_RETURN_IF_ERROR(reader_->Execute("PRAGMA busy_timeout = 10000"));
      PLANISH_ASSIGN_OR_RETURN(read_blob_, reader_->Prepare("SELECT bytes FROM blobs WHERE tenant = ? AND sha256 = ?"));
    }
    PLANISH_ASSIGN_OR_RETURN(Statement id, database_.Prepare("SELECT id FROM meta"));
    PLANISH_ASSIGN_OR_RETURN(const bool found, id.Step());
    if (!found) return InternalError(absl::StrCat(path, " has no identity: it is no job store of planish"));
    id_ = id.Bytes(0);
    return absl::OkStatus();
  }

  absl::StatusOr<std::int64_t> Version() {
    PLANISH_ASSIGN_OR_RETURN(Statement version, database_.Prepare("PRAGMA user_version"));
    PLANISH_RETURN_IF_ERROR(version.Step().status());
    return version.Int(0);
  }

  absl::Status Migrate(const std::string& path) {
    PLANISH_ASSIGN_OR_RETURN(const std::int64_t found, Version());
    if (found > kVersion) {
      return MakeError(absl::StatusCode::kFailedPrecondition, "STORE_VERSION",
                       absl::StrCat(path, " was written by a newer planish (its version is ", found,
                                    ", this one knows ", kVersion, "): use that one, or another data directory"));
    }
    for (std::int64_t version = found; version < kVersion; ++version) {
      std::string step = absl::StrCat("BEGIN IMMEDIATE;", kMigrations[version]);
      if (version == 0) absl::StrAppend(&step, "INSERT INTO meta VALUES ('", RandomId(), "');");
      absl::StrAppend(&step, "PRAGMA user_version = ", version + 1);
      absl::Status status = database_.Execute(step.c_str());
      if (status.ok() && version == kWithoutCreateTimes) status = FillInCreateTimes();
      if (status.ok()) status = database_.Execute("COMMIT");
      if (!status.ok()) {
        database_.Execute("ROLLBACK").IgnoreError();
        return status;
      }
    }
    return absl::OkStatus();
  }

  // Of records from before there was a column for it.
  absl::Status FillInCreateTimes() {
    PLANISH_ASSIGN_OR_RETURN(Statement all, database_.Prepare("SELECT record, NULL FROM jobs"));
    PLANISH_ASSIGN_OR_RETURN(Statement set, database_.Prepare("UPDATE jobs SET create_time = ? WHERE number = ?"));
    PLANISH_ASSIGN_OR_RETURN(const std::vector<JobRecord> records, All(all));
    for (const JobRecord& record : records) {
      const std::int64_t time = TimeUtil::TimestampToNanoseconds(record.job().create_time());
      PLANISH_RETURN_IF_ERROR(set.Bind(time).Bind(record.number()).Run());
    }
    return absl::OkStatus();
  }

  absl::Status PrepareAll() {
    const std::pair<Statement*, const char*> statements[] = {
        {&begin_, "BEGIN IMMEDIATE"},
        {&commit_, "COMMIT"},
        {&rollback_, "ROLLBACK"},
        {&put_, "INSERT OR REPLACE INTO jobs VALUES (?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?)"},
        {&put_label_, "INSERT OR IGNORE INTO labels VALUES (?, ?, ?)"},
        {&put_event_, "INSERT INTO events VALUES (?, ?, ?)"},
        {&find_, "SELECT record, report FROM jobs WHERE name = ?"},
        {&find_by_request_id_, "SELECT record, report FROM jobs WHERE tenant = ? AND request_id = ?"},
        {&find_result_,
         "SELECT record, report FROM jobs WHERE work_key = ? AND state = ? ORDER BY number DESC LIMIT 1"},
        {&unfinished_, "SELECT record, NULL FROM jobs WHERE ended = 0 ORDER BY number"},
        {&first_ended_, "SELECT record, report FROM jobs WHERE ended = 1 ORDER BY end_time, number LIMIT 1"},
        {&first_in_state_, "SELECT record, report FROM jobs WHERE state = ? ORDER BY end_time, number LIMIT 1"},
        {&first_ended_of_,
         "SELECT record, report FROM jobs WHERE tenant = ? AND ended = 1 ORDER BY end_time, number LIMIT 1"},
        {&first_in_state_of_,
         "SELECT record, report FROM jobs WHERE tenant = ? AND state = ? ORDER BY end_time, number LIMIT 1"},
        {&totals_,
         "SELECT tenant, sum(ended), sum(CASE WHEN state = ? THEN uv_bytes ELSE 0 END), max(number) FROM jobs "
         "GROUP BY tenant"},
        {&events_, "SELECT event FROM events WHERE job = ? ORDER BY sequence"},
        {&delete_, "DELETE FROM jobs WHERE number = ?"},
        {&delete_events_, "DELETE FROM events WHERE job = ?"},
        {&delete_labels_, "DELETE FROM labels WHERE job = ?"},
        {&put_blob_, "INSERT OR REPLACE INTO blobs VALUES (?, ?, ?)"},
        {&list_blobs_, "SELECT tenant, sha256, length(bytes) FROM blobs"},
        {&delete_blob_, "DELETE FROM blobs WHERE tenant = ? AND sha256 = ?"},
        {&uses_blob_,
         "SELECT 1 FROM jobs WHERE ended = 0 AND mesh_sha256 = ?1 AND tenant = ?2 UNION ALL "
         "SELECT 1 FROM jobs WHERE ended = 0 AND seams_sha256 = ?1 AND tenant = ?2 UNION ALL "
         "SELECT 1 FROM jobs WHERE uv_sha256 = ?1 AND tenant = ?2 AND state = ?3 LIMIT 1"},
    };
    for (const auto& [statement, sql] : statements) {
      PLANISH_ASSIGN_OR_RETURN(*statement, database_.Prepare(sql));
    }
    return absl::OkStatus();
  }

  absl::Status PutRecord(const JobRecord& record) {
    const v1::Job& job = record.job();
    put_.Bind(record.number()).BindText(job.name()).BindText(job.tenant());
    if (record.request_id().empty()) {
      put_.BindNull();
    } else {
      put_.BindText(record.request_id());
    }
    put_.Bind(job.state())
        .Bind(IsTerminal(job.state()) ? 1 : 0)
        .Bind(TimeUtil::TimestampToNanoseconds(job.end_time()))
        .BindBlob(record.work_key())
        .BindBlob(record.mesh_sha256())
        .BindBlob(record.seams_sha256())
        .BindBlob(job.uv().uv_sha256())
        .Bind(job.uv().total_bytes())
        .BindBlob(WithoutReport(record).SerializeAsString())
        .BindBlob(job.report().SerializeAsString())
        .Bind(TimeUtil::TimestampToNanoseconds(job.create_time()));
    PLANISH_RETURN_IF_ERROR(put_.Run());
    for (const auto& [key, value] : job.labels()) {
      PLANISH_RETURN_IF_ERROR(put_label_.Bind(record.number()).BindText(key).BindText(value).Run());
    }
    return absl::OkStatus();
  }

  absl::Status PutBlob(const BlobRow& blob) {
    return put_blob_.BindText(blob.id.tenant).BindBlob(blob.id.sha256).BindBlob(blob.bytes->memory()->bytes()).Run();
  }

  // Lists do without reports, which may be hundreds of KB each.
  static JobRecord WithoutReport(const JobRecord& record) {
    JobRecord lean = record;
    lean.mutable_job()->clear_report();
    return lean;
  }

  // What was written before there were tenants. Fields of earlier builds that this one does not know are dropped where
  // rows are read: passed on, they would puzzle clients that have another field of that number.
  static void FillIn(v1::Job* job) {
    if (job->tenant().empty()) job->set_tenant(kDefaultTenant);
  }

  static bool Read(const Statement& row, v1::JobEvent* event) {
    if (!event->ParseFromString(row.Bytes(0))) return false;
    event->DiscardUnknownFields();
    if (event->has_job()) FillIn(event->mutable_job());
    return true;
  }

  static bool Read(const Statement& row, JobRecord* record) {
    if (!record->ParseFromString(row.Bytes(0))) return false;
    FillIn(record->mutable_job());
    const std::string report = row.Bytes(1);
    const bool has_report = !report.empty();
    if (has_report && !record->mutable_job()->mutable_report()->ParseFromString(report)) return false;
    record->DiscardUnknownFields();
    return true;
  }

  absl::Status PutEvent(std::int64_t number, const v1::JobEvent& event) {
    v1::JobEvent lean = event;
    if (lean.has_job()) lean.mutable_job()->clear_report();
    return put_event_.Bind(number).Bind(event.sequence()).BindBlob(lean.SerializeAsString()).Run();
  }

  template <class Message>
  static absl::StatusOr<std::vector<Message>> Rows(Statement& statement) {
    std::vector<Message> rows;
    absl::StatusOr<bool> row = statement.Step();
    for (; row.ok() && *row; row = statement.Step()) {
      if (!Read(statement, &rows.emplace_back())) {
        row = InternalError("the job store: a row that cannot be read");
        break;
      }
    }
    statement.Reset();
    PLANISH_RETURN_IF_ERROR(row.status());
    return rows;
  }

  static absl::StatusOr<std::vector<JobRecord>> All(Statement& statement) { return Rows<JobRecord>(statement); }

  static absl::StatusOr<std::optional<JobRecord>> One(Statement& statement) {
    PLANISH_ASSIGN_OR_RETURN(std::vector<JobRecord> rows, All(statement));
    if (rows.empty()) return std::nullopt;
    return std::move(rows.front());
  }

  Database database_;
  std::string id_;
  Statement begin_, commit_, rollback_, put_, put_event_, find_, find_by_request_id_, find_result_, unfinished_,
      first_ended_, first_in_state_, first_ended_of_, first_in_state_of_, totals_, events_, delete_, delete_events_,
      uses_blob_, put_blob_, list_blobs_, delete_blob_, put_label_, delete_labels_;
  Durability durability_ = Durability::kNow;  // of the present setting

  // A connection of its own for those who read blobs while the other one is in use. Nothing for a store in memory.
  std::mutex reader_mutex_;
  std::optional<Database> reader_;  // guarded by reader_mutex_ after SetUp(), as is read_blob_
  Statement read_blob_;
};

}  // namespace

absl::StatusOr<std::unique_ptr<JobStore>> OpenJobStore(const std::string& path) {
  return SqliteJobStore::Open(path);
}

}  // namespace planish
