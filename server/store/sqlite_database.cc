// SQLite as a SqlDatabase: the schema, its versions, and who may use which connection.
#include <array>
#include <atomic>
#include <condition_variable>
#include <cstddef>
#include <cstdint>
#include <iterator>
#include <mutex>
#include <optional>
#include <unordered_map>

#include "absl/strings/str_cat.h"
#include "core/base/error.h"
#include "core/base/status_macros.h"
#include "google/protobuf/util/time_util.h"
#include "planish/store/v1/store.pb.h"
#include "server/store/ids.h"
#include "server/store/sql.h"
#include "server/store/sqlite.h"
#include "server/store/work_schema.h"

namespace planish {
namespace {

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
    // Leases. Which work a job belongs to, who has it, and since when it waits.
    R"sql(
      ALTER TABLE jobs ADD COLUMN work TEXT NOT NULL DEFAULT '';
      ALTER TABLE jobs ADD COLUMN owner TEXT NOT NULL DEFAULT '';
      ALTER TABLE jobs ADD COLUMN attempt INTEGER NOT NULL DEFAULT 0;
      ALTER TABLE jobs ADD COLUMN lease_until INTEGER NOT NULL DEFAULT 0;
      ALTER TABLE jobs ADD COLUMN turn_time INTEGER NOT NULL DEFAULT 0;
      ALTER TABLE jobs ADD COLUMN memory_bytes INTEGER NOT NULL DEFAULT 0;
      CREATE INDEX jobs_by_live_work ON jobs (work) WHERE ended = 0;
      DROP INDEX jobs_by_end;
      DROP INDEX jobs_by_state;
      DROP INDEX jobs_by_tenant_end;
      DROP INDEX jobs_by_tenant_state;
      CREATE INDEX jobs_by_end ON jobs (end_time, number) WHERE ended = 1;
      CREATE INDEX jobs_by_state ON jobs (state, end_time, number) WHERE ended = 1;
      CREATE INDEX jobs_by_tenant_end ON jobs (tenant, end_time, number) WHERE ended = 1;
      CREATE INDEX jobs_by_tenant_state ON jobs (tenant, state, end_time, number) WHERE ended = 1;
      DROP INDEX jobs_by_uv;
      CREATE INDEX jobs_by_uv ON jobs (uv_sha256) WHERE ended = 1;
    )sql",
    kWorkMigration,
    // What ended jobs take; indexes for the newest work and the newest result with one key, however many jobs had it.
    R"sql(
      ALTER TABLE tenants ADD COLUMN record_bytes BIGINT NOT NULL DEFAULT 0;
      DROP INDEX jobs_by_work;
      DROP INDEX jobs_by_uv;
      CREATE INDEX jobs_by_live_key ON jobs (work_key, tenant, number) WHERE ended = 0;
      CREATE INDEX jobs_by_result ON jobs (work_key, number) WHERE ended = 1 AND state = 4;
      CREATE INDEX jobs_by_uv ON jobs (uv_sha256, tenant) WHERE ended = 1 AND state = 4 AND uv_sha256 != '';
    )sql",
};
constexpr std::int64_t kVersion = std::size(kMigrations);
constexpr std::int64_t kWithoutCreateTimes = 3;  // the last version
constexpr std::int64_t kWithoutLeases = 4;       // likewise

// Pages of the log that are collected before they are copied into the database, which takes two more syncs.
//
// FULL: a commit syncs the log before it returns, so that what a caller is told outlives a loss of power. Writes that
// may be lost with the power and are then made again (deletions) run with NORMAL: Begin().
constexpr char kPragmas[] =
    "PRAGMA journal_mode = WAL; PRAGMA synchronous = FULL; PRAGMA wal_autocheckpoint = 4000; PRAGMA busy_timeout = "
    "10000";

// The path of a database without a file.
constexpr std::string_view kInMemory = ":memory:";

// Statements that a connection keeps prepared; filters of lists make new ones without end.
constexpr std::size_t kMostStatements = 200;

std::string SqliteWord(std::string_view word) {
  if (word == "next_number") return "(SELECT coalesce(max(number), 0) + 1 FROM jobs) + column6";
  if (word == "outcome") return "state";
  if (word == "with_jobs") return "LEFT JOIN jobs ON jobs.work = heads.name AND jobs.ended = 0";
  if (word == "anywhere") return "TRUE";
  if (word == "now" || word == "elapsed") return "0";
  return "";  // a writer has the database to itself
}

class SqliteConnection : public SqlConnection {
 public:
  static absl::StatusOr<std::unique_ptr<SqliteConnection>> Open(const std::string& path) {
    PLANISH_ASSIGN_OR_RETURN(Database database, Database::Open(path));
    return std::unique_ptr<SqliteConnection>(new SqliteConnection(std::move(database), path != kInMemory));
  }

  Database& database() { return database_; }

  absl::Status Begin(Durability durability) override {
    if (has_file_ && durability != durability_) {
      PLANISH_RETURN_IF_ERROR(database_.Execute(durability == Durability::kNow ? "PRAGMA synchronous = FULL"
                                                                               : "PRAGMA synchronous = NORMAL"));
      durability_ = durability;
    }
    return Run("BEGIN IMMEDIATE", {}).status();
  }

  absl::Status Commit() override { return Run("COMMIT", {}).status(); }
  // An error where nothing was begun, or where SQLite rolled back by itself, says nothing new.
  void Rollback() override { Run("ROLLBACK", {}).status().IgnoreError(); }
  absl::Status Serialize(const std::vector<std::string>&) override { return absl::OkStatus(); }
  absl::StatusOr<bool> TrySerialize(std::string_view) override { return true; }

  absl::StatusOr<SqlRows> Run(const std::string& sql, const std::vector<SqlValue>& values) override {
    auto found = statements_.find(sql);
    if (found == statements_.end()) {
      if (statements_.size() >= kMostStatements) statements_.clear();
      PLANISH_ASSIGN_OR_RETURN(Statement prepared, database_.Prepare(ReplaceWords(sql, SqliteWord).c_str()));
      found = statements_.emplace(sql, std::move(prepared)).first;
    }
    Statement& statement = found->second;
    for (const SqlValue& value : values) {
      if (const auto* integer = std::get_if<std::int64_t>(&value)) {
        statement.Bind(*integer);
      } else if (const auto* text = std::get_if<std::string_view>(&value)) {
        statement.BindText(*text);
      } else if (const auto* bytes = std::get_if<SqlBytes>(&value)) {
        statement.BindBlob(bytes->bytes);
      } else {
        statement.BindNull();
      }
    }
    SqlRows rows;
    absl::StatusOr<bool> row = statement.Step();
    for (; row.ok() && *row; row = statement.Step()) {
      std::vector<SqlRows::Cell> cells(static_cast<std::size_t>(statement.columns()));
      for (int i = 0; i < statement.columns(); ++i) {
        SqlRows::Cell& cell = cells[static_cast<std::size_t>(i)];
        if (statement.IsInt(i)) {
          cell.integer = statement.Int(i);
        } else {
          cell.bytes = statement.Bytes(i);
        }
      }
      rows.Add(std::move(cells));
    }
    statement.Reset();
    PLANISH_RETURN_IF_ERROR(row.status());
    return rows;
  }

 private:
  SqliteConnection(Database database, bool has_file) : database_(std::move(database)), has_file_(has_file) {}

  Database database_;
  const bool has_file_;
  std::unordered_map<std::string, Statement> statements_;
  Durability durability_ = Durability::kNow;  // of the present setting
};

absl::StatusOr<std::int64_t> SchemaVersion(SqliteConnection* connection) {
  PLANISH_ASSIGN_OR_RETURN(const SqlRows rows, connection->Run("PRAGMA user_version", {}));
  return rows.Int(0, 0);
}

// Of records from before there was a column for it.
absl::Status FillInCreateTimes(SqliteConnection* connection) {
  PLANISH_ASSIGN_OR_RETURN(const SqlRows rows, connection->Run("SELECT number, record FROM jobs", {}));
  for (std::size_t i = 0; i < rows.size(); ++i) {
    store::v1::JobRecord record;
    if (!record.ParseFromString(rows.Bytes(i, 1))) return InternalError("the job store: a row that cannot be read");
    const std::int64_t time = google::protobuf::util::TimeUtil::TimestampToNanoseconds(record.job().create_time());
    PLANISH_RETURN_IF_ERROR(
        connection->Run("UPDATE jobs SET create_time = ? WHERE number = ?", {time, rows.Int(i, 0)}).status());
  }
  return absl::OkStatus();
}

// Jobs that had not ended shared their work by its key. Those that ran are taken over as any others whose server is
// gone.
absl::Status FillInLeases(SqliteConnection* connection) {
  PLANISH_ASSIGN_OR_RETURN(
      const SqlRows rows,
      connection->Run("SELECT number, record, work_key FROM jobs WHERE ended = 0 ORDER BY number", {}));
  std::unordered_map<std::string, std::string> works;
  for (std::size_t i = 0; i < rows.size(); ++i) {
    store::v1::JobRecord record;
    if (!record.ParseFromString(rows.Bytes(i, 1))) return InternalError("the job store: a row that cannot be read");
    const std::string& name = record.job().name();
    record.set_work(record.job().scheduling().fresh() ? name : works.emplace(rows.Bytes(i, 2), name).first->second);
    PLANISH_ASSIGN_OR_RETURN(
        const SqlRows last,
        connection->Run("SELECT coalesce(max(sequence), 0) FROM events WHERE job = ?", {rows.Int(i, 0)}));
    record.set_last_sequence(last.Int(0, 0));
    const std::string bytes = record.SerializeAsString();
    PLANISH_RETURN_IF_ERROR(
        connection
            ->Run("UPDATE jobs SET work = ?, owner = ?, turn_time = create_time, memory_bytes = ?, record = ? "
                  "WHERE number = ?",
                  {std::string_view(record.work()), std::string_view(record.owner()), record.job().memory_bytes(),
                   SqlBytes{bytes}, rows.Int(i, 0)})
            .status());
  }
  return absl::OkStatus();
}

absl::Status Migrate(const std::string& path, SqliteConnection* connection) {
  PLANISH_ASSIGN_OR_RETURN(const std::int64_t found, SchemaVersion(connection));
  if (found > kVersion) {
    return MakeError(absl::StatusCode::kFailedPrecondition, "STORE_VERSION",
                     absl::StrCat(path, " was written by a newer planish (its version is ", found, ", this one knows ",
                                  kVersion, "): use that one, or another data directory"));
  }
  Database& database = connection->database();
  for (std::int64_t version = found; version < kVersion; ++version) {
    std::string step = absl::StrCat("BEGIN IMMEDIATE;", kMigrations[version]);
    if (version == 0) absl::StrAppend(&step, "INSERT INTO meta VALUES ('", RandomId(), "');");
    absl::StrAppend(&step, "PRAGMA user_version = ", version + 1);
    absl::Status status = database.Execute(step.c_str());
    if (status.ok() && version == kWithoutCreateTimes) status = FillInCreateTimes(connection);
    if (status.ok() && version == kWithoutLeases) status = FillInLeases(connection);
    if (status.ok()) status = connection->Commit();
    if (!status.ok()) {
      connection->Rollback();
      return status;
    }
  }
  return absl::OkStatus();
}

// A lock that is taken in the order in which it was asked for. std::mutex favours the thread that gave it back.
class FairMutex {
 public:
  void lock() {
    std::unique_lock lock(mutex_);
    const std::uint64_t ticket = next_++;
    changed_.wait(lock, [&] { return served_ == ticket; });
  }
  void unlock() {
    const std::lock_guard lock(mutex_);
    ++served_;
    changed_.notify_all();
  }

 private:
  std::mutex mutex_;
  std::condition_variable changed_;
  // Guarded by mutex_.
  std::uint64_t next_ = 0, served_ = 0;
};

// Some connections: SQLite has one writer at a time, and those who only read need not wait for it. A database that
// lives in memory has one connection, as another could not see it.
class SqliteDatabase : public SqlDatabase {
 public:
  static absl::StatusOr<std::unique_ptr<SqlDatabase>> Open(const std::string& path) {
    std::unique_ptr<SqliteDatabase> database(new SqliteDatabase);
    PLANISH_ASSIGN_OR_RETURN(database->writer_.connection, SqliteConnection::Open(path));
    PLANISH_RETURN_IF_ERROR(database->writer_.connection->database().Execute(kPragmas));
    PLANISH_RETURN_IF_ERROR(Migrate(path, database->writer_.connection.get()));
    for (Place& reader : database->readers_) {
      if (path == kInMemory) break;
      PLANISH_ASSIGN_OR_RETURN(reader.connection, SqliteConnection::Open(path));
      PLANISH_RETURN_IF_ERROR(reader.connection->database().Execute("PRAGMA busy_timeout = 10000"));
    }
    PLANISH_ASSIGN_OR_RETURN(const SqlRows id, database->writer_.connection->Run("SELECT id FROM meta", {}));
    if (id.empty()) return InternalError(absl::StrCat(path, " has no identity: it is no job store of planish"));
    database->id_ = id.Bytes(0, 0);
    return database;
  }

  absl::StatusOr<Lease> Connect(Use use) override {
    const bool reads = use == Use::kRead && outlives_process();
    Place& place = reads ? readers_[next_reader_++ % kReaders] : writer_;
    place.mutex.lock();
    return Lease(place.connection.get(), [&place](SqlConnection*) { place.mutex.unlock(); });
  }

  void Publish(std::string_view) override {}
  void Listen(std::function<void(std::string_view)>) override {}
  const std::string& id() const override { return id_; }
  bool has_clock() const override { return false; }
  bool is_shared() const override { return false; }
  bool outlives_process() const override { return readers_[0].connection != nullptr; }

 private:
  struct Place {
    FairMutex mutex;
    std::unique_ptr<SqliteConnection> connection;  // guarded by mutex after Open()
  };
  static constexpr std::size_t kReaders = 3;

  std::string id_;
  Place writer_;
  std::array<Place, kReaders> readers_;  // null in memory
  std::atomic<std::size_t> next_reader_ = 0;
};

}  // namespace

absl::StatusOr<std::unique_ptr<SqlDatabase>> OpenSqliteDatabase(const std::string& path) {
  return SqliteDatabase::Open(path);
}

}  // namespace planish
