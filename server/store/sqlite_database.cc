// SQLite as a SqlDatabase: the version of its tables, and its connections.
#include <algorithm>
#include <array>
#include <atomic>
#include <condition_variable>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <mutex>
#include <optional>
#include <system_error>
#include <unordered_map>

#include "absl/strings/str_cat.h"
#include "core/base/error.h"
#include "core/base/status_macros.h"
#include "server/store/ids.h"
#include "server/store/job_schema.h"
#include "server/store/sql.h"
#include "server/store/sqlite.h"

namespace planish {
namespace {

// PRAGMA user_version of a file with the tables of job_schema.h.
constexpr std::int64_t kVersion = 1;

// FULL: a commit syncs the log before it returns, so that what callers were told survives a loss of power. Writes that
// are simply repeated if they were lost, such as deletions, run with NORMAL: see Begin().
//
// auto_vacuum: for GiveBackPages(); takes effect only in a new file.
constexpr char kPragmas[] =
    "PRAGMA auto_vacuum = INCREMENTAL; PRAGMA journal_mode = WAL; PRAGMA synchronous = FULL; "
    "PRAGMA busy_timeout = 10000";

// The number of pages at which the log is copied into the database, which takes two more syncs. At most a 64th of the
// disk.
std::int64_t LogPages(const std::string& path) {
  std::error_code error;
  const std::filesystem::space_info space = std::filesystem::space(path, error);
  const std::uintmax_t pages = error ? 4000 : space.capacity / 64 / 4096;
  return static_cast<std::int64_t>(std::clamp<std::uintmax_t>(pages, 16, 4000));
}

// A database keeps kMostFreePages free pages. kGiveBackPages returns 256 others to the file system.
constexpr std::int64_t kMostFreePages = 1024;
constexpr char kGiveBackPages[] = "PRAGMA incremental_vacuum(256)";

// The path of a database without a file.
constexpr std::string_view kInMemory = ":memory:";

// Statements that a connection keeps prepared. Filters of lists make an unlimited number of statements.
constexpr std::size_t kMostStatements = 200;

std::string SqliteWord(std::string_view word) {
  if (word == "next_number") return "(SELECT coalesce(max(number), 0) + 1 FROM jobs) + column6";
  if (word == "outcome") return "state";
  if (word == "rowid") return "INTEGER";
  if (word == "text") return "TEXT";
  if (word == "bytes") return "BLOB";
  if (word == "clustered") return "WITHOUT ROWID";
  if (word == "with_jobs") return "LEFT JOIN jobs ON jobs.work = heads.name AND jobs.ended = 0";
  if (word == "anywhere") return "TRUE";
  if (word == "now" || word == "elapsed") return "0";
  return "";  // {lock} and {skip}: a writer has the database for itself
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

  absl::Status Commit() override {
    PLANISH_RETURN_IF_ERROR(Run("COMMIT", {}).status());
    if (has_file_ && durability_ == Durability::kLater) GiveBackPages();
    return absl::OkStatus();
  }
  // Fails only if there is no transaction, or SQLite has rolled back already.
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
  // Returns free pages to the file system. Call it after deletions. After an error the pages are reused later.
  void GiveBackPages() {
    const absl::StatusOr<SqlRows> free = Run("PRAGMA freelist_count", {});
    if (!free.ok() || free->Int(0, 0) <= kMostFreePages || !Run(kGiveBackPages, {}).ok()) return;
    Run("PRAGMA wal_checkpoint(PASSIVE)", {}).status().IgnoreError();  // shortens the file
  }

  SqliteConnection(Database database, bool has_file) : database_(std::move(database)), has_file_(has_file) {}

  Database database_;
  const bool has_file_;
  std::unordered_map<std::string, Statement> statements_;
  Durability durability_ = Durability::kNow;  // the durability that is set now
};

absl::StatusOr<std::int64_t> SchemaVersion(SqliteConnection* connection) {
  PLANISH_ASSIGN_OR_RETURN(const SqlRows rows, connection->Run("PRAGMA user_version", {}));
  return rows.Int(0, 0);
}

absl::Status SetUp(const std::string& path, SqliteConnection* connection) {
  PLANISH_ASSIGN_OR_RETURN(const std::int64_t found, SchemaVersion(connection));
  if (found == kVersion) return absl::OkStatus();
  if (found > kVersion) {
    return MakeError(absl::StatusCode::kFailedPrecondition, "STORE_VERSION",
                     absl::StrCat(path, " was written by a newer planish (its version is ", found, ", this one knows ",
                                  kVersion, "): use that one, or another data directory"));
  }
  const std::string script =
      absl::StrCat("BEGIN IMMEDIATE; CREATE TABLE meta (id TEXT NOT NULL); INSERT INTO meta VALUES ('", RandomId(),
                   "');", ReplaceWords(kJobSchema, SqliteWord), "PRAGMA user_version = ", kVersion);
  absl::Status status = connection->database().Execute(script.c_str());
  if (status.ok()) status = connection->Commit();
  if (!status.ok()) connection->Rollback();
  return status;
}

// A lock that is granted in the order of requests. std::mutex favours the thread that released it.
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

// A pool of connections: SQLite allows one writer at a time, and readers need not wait for it. A database in memory has
// one connection, since other connections could not see it.
class SqliteDatabase : public SqlDatabase {
 public:
  static absl::StatusOr<std::unique_ptr<SqlDatabase>> Open(const std::string& path,
                                                           const std::function<bool()>& give_up_reserve) {
    std::unique_ptr<SqliteDatabase> database(new SqliteDatabase);
    database->give_up_reserve_ = give_up_reserve;
    database->path_ = path;
    PLANISH_ASSIGN_OR_RETURN(database->writer_.connection, SqliteConnection::Open(path));
    PLANISH_RETURN_IF_ERROR(database->writer_.connection->database().Execute(kPragmas));
    if (path != kInMemory) {
      const std::string log = absl::StrCat("PRAGMA wal_autocheckpoint = ", LogPages(path));
      PLANISH_RETURN_IF_ERROR(database->writer_.connection->database().Execute(log.c_str()));
    }
    PLANISH_RETURN_IF_ERROR(SetUp(path, database->writer_.connection.get()));
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
  // First shortens the log, which has many versions of few pages. If that fails, because it needs a little room itself,
  // gives up the reserve and tries again.
  bool GiveUpReserve() override {
    if (give_up_reserve_ == nullptr) return false;
    if (ShortenLog()) return true;
    if (!give_up_reserve_()) return false;
    ShortenLog();
    return true;
  }
  bool outlives_process() const override { return readers_[0].connection != nullptr; }

 private:
  struct Place {
    FairMutex mutex;
    std::unique_ptr<SqliteConnection> connection;  // guarded by mutex after Open()
  };
  static constexpr std::size_t kReaders = 3;

  // Copies the log into the database and truncates it. Returns whether that freed room.
  bool ShortenLog() {
    const std::lock_guard lock(writer_.mutex);
    const std::int64_t before = LogBytes();
    writer_.connection->Run("PRAGMA wal_checkpoint(TRUNCATE)", {}).status().IgnoreError();
    return LogBytes() < before;
  }

  std::int64_t LogBytes() const {
    std::error_code error;
    const std::uintmax_t bytes = std::filesystem::file_size(path_ + "-wal", error);
    return error ? 0 : static_cast<std::int64_t>(bytes);
  }

  std::string path_;
  std::string id_;
  std::function<bool()> give_up_reserve_;
  Place writer_;
  std::array<Place, kReaders> readers_;  // without connections for a database in memory
  std::atomic<std::size_t> next_reader_ = 0;
};

}  // namespace

absl::StatusOr<std::unique_ptr<SqlDatabase>> OpenSqliteDatabase(const std::string& path,
                                                                std::function<bool()> give_up_reserve) {
  // Opening a database may write, too: it completes what the last process left undone.
  for (;;) {
    absl::StatusOr<std::unique_ptr<SqlDatabase>> database = SqliteDatabase::Open(path, give_up_reserve);
    if (database.ok() || ErrorInfoOf(database.status()).reason != "STORAGE_FULL") return database;
    if (give_up_reserve == nullptr || !give_up_reserve()) return database;
  }
}

}  // namespace planish
