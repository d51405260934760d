#include <algorithm>
#include <iterator>
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
};
constexpr std::int64_t kVersion = std::size(kMigrations);

class SqliteJobStore : public JobStore {
 public:
  static absl::StatusOr<std::unique_ptr<JobStore>> Open(const std::string& path) {
    PLANISH_ASSIGN_OR_RETURN(Database database, Database::Open(path));
    std::unique_ptr<SqliteJobStore> store(new SqliteJobStore(std::move(database)));
    PLANISH_RETURN_IF_ERROR(store->SetUp(path));
    return store;
  }

  const std::string& id() const override { return id_; }

  absl::Status Put(const JobRecord& record, const v1::JobEvent* event) override {
    PLANISH_RETURN_IF_ERROR(begin_.Run());
    absl::Status status = PutRecord(record);
    if (status.ok() && event != nullptr) status = PutEvent(record.number(), *event);
    if (status.ok()) status = commit_.Run();
    if (!status.ok()) rollback_.Run().IgnoreError();
    return status;
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
    return All(list_.Bind(query.before_number)
                   .Bind(query.state)
                   .BindText(query.label_prefix)
                   .BindText(query.tenant)
                   .Bind(query.limit > 0 ? query.limit : -1));
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
    PLANISH_RETURN_IF_ERROR(begin_.Run());
    absl::Status status = delete_events_.Bind(number).Run();
    if (status.ok()) status = delete_.Bind(number).Run();
    if (status.ok()) status = commit_.Run();
    if (!status.ok()) rollback_.Run().IgnoreError();
    return status;
  }

  absl::StatusOr<bool> UsesBlob(const BlobId& id) override {
    uses_blob_.BindBlob(id.sha256).BindText(id.tenant).Bind(v1::JOB_STATE_SUCCEEDED);
    const absl::StatusOr<bool> row = uses_blob_.Step();
    uses_blob_.Reset();
    return row;
  }

 private:
  explicit SqliteJobStore(Database database) : database_(std::move(database)) {}

  absl::Status SetUp(const std::string& path) {
    // NORMAL: what was written survives the death of this process, not always a loss of power, which never leaves more
    // than a missing end.
    PLANISH_RETURN_IF_ERROR(database_.Execute("PRAGMA journal_mode = WAL; PRAGMA synchronous = NORMAL"));
    PLANISH_RETURN_IF_ERROR(Migrate(path));
    PLANISH_RETURN_IF_ERROR(PrepareAll());
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
      absl::StrAppend(&step, "PRAGMA user_version = ", version + 1, "; COMMIT");
      if (absl::Status status = database_.Execute(step.c_str()); !status.ok()) {
        database_.Execute("ROLLBACK").IgnoreError();
        return status;
      }
    }
    return absl::OkStatus();
  }

  absl::Status PrepareAll() {
    const std::pair<Statement*, const char*> statements[] = {
        {&begin_, "BEGIN IMMEDIATE"},
        {&commit_, "COMMIT"},
        {&rollback_, "ROLLBACK"},
        {&put_, "INSERT OR REPLACE INTO jobs VALUES (?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?)"},
        {&put_event_, "INSERT INTO events VALUES (?, ?, ?)"},
        {&find_, "SELECT record, report FROM jobs WHERE name = ?"},
        {&find_by_request_id_, "SELECT record, report FROM jobs WHERE tenant = ? AND request_id = ?"},
        {&find_result_,
         "SELECT record, report FROM jobs WHERE work_key = ? AND state = ? ORDER BY number DESC LIMIT 1"},
        {&list_,
         "SELECT record, NULL FROM jobs WHERE (?1 = 0 OR number < ?1) AND (?2 = 0 OR state = ?2) "
         "AND substr(label, 1, length(?3)) = ?3 AND (?4 = '' OR tenant = ?4) ORDER BY number DESC LIMIT ?5"},
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
    return put_.Bind(job.state())
        .Bind(IsTerminal(job.state()) ? 1 : 0)
        .Bind(TimeUtil::TimestampToNanoseconds(job.end_time()))
        .BindText(job.label())
        .BindBlob(record.work_key())
        .BindBlob(record.mesh_sha256())
        .BindBlob(record.seams_sha256())
        .BindBlob(job.uv().uv_sha256())
        .Bind(job.uv().total_bytes())
        .BindBlob(WithoutReport(record).SerializeAsString())
        .BindBlob(job.report().SerializeAsString())
        .Run();
  }

  // Lists do without reports, which may be hundreds of KB each.
  static JobRecord WithoutReport(const JobRecord& record) {
    JobRecord lean = record;
    lean.mutable_job()->clear_report();
    return lean;
  }

  // What was written before there were tenants.
  static void FillIn(v1::Job* job) {
    if (job->tenant().empty()) job->set_tenant(kDefaultTenant);
  }

  static bool Read(const Statement& row, v1::JobEvent* event) {
    if (!event->ParseFromString(row.Bytes(0))) return false;
    if (event->has_job()) FillIn(event->mutable_job());
    return true;
  }

  static bool Read(const Statement& row, JobRecord* record) {
    if (!record->ParseFromString(row.Bytes(0))) return false;
    FillIn(record->mutable_job());
    const std::string report = row.Bytes(1);
    return report.empty() || record->mutable_job()->mutable_report()->ParseFromString(report);
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
  Statement begin_, commit_, rollback_, put_, put_event_, find_, find_by_request_id_, find_result_, list_, unfinished_,
      first_ended_, first_in_state_, first_ended_of_, first_in_state_of_, totals_, events_, delete_, delete_events_,
      uses_blob_;
};

}  // namespace

absl::StatusOr<std::unique_ptr<JobStore>> OpenJobStore(const std::string& path) {
  return SqliteJobStore::Open(path);
}

}  // namespace planish
