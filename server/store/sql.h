// Statements in the one dialect that SQLite and PostgreSQL share, and the databases that run them.
//
// A statement is written once: `?` is the next parameter; the words below stand for what the engines say differently.
//   {lock}         after a SELECT within a transaction: nobody else changes these rows before it ends
//   {skip}         likewise, and rows that somebody else has locked are left out
//   {with_jobs}    after FROM (SELECT ... {skip}) AS heads: each of these works beside each of its live jobs, AS jobs
//                  (as they are once the work is locked)
//   {next_number}  a number for a new job, above all earlier ones; `column6` of the statement counts such jobs
//   {outcome}      the state of a job, where the statement says that it has ended
//   {anywhere}     true of each row, where all rows of a small table are wanted: they are read as they lie
//   {now}          the database's own time, nanoseconds since 1970; 0 without a clock (SqlDatabase::has_clock())
//   {elapsed}      likewise, since the transaction began
#pragma once

#include <cstdint>
#include <deque>
#include <functional>
#include <memory>
#include <string>
#include <string_view>
#include <utility>
#include <variant>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"

namespace planish {

// When a transaction outlives what.
enum class Durability {
  kNow,    // synced to the disk before Commit() returns: outlives a loss of power
  kLater,  // outlives the process at once, and a loss of power after the next commit that is durable now
};

// Bytes rather than text.
struct SqlBytes {
  std::string_view bytes;
};

// A parameter; std::monostate is NULL, of a text. A statement has parameters of the same types each time. Text and
// bytes are only looked at during the call.
using SqlValue = std::variant<std::monostate, std::int64_t, std::string_view, SqlBytes>;

// What a statement returns: cells by row and column, both from 0. NULL reads as 0 and as "".
class SqlRows {
 public:
  struct Cell {
    std::int64_t integer = 0;
    std::string bytes;
  };

  std::size_t size() const { return rows_.size(); }
  bool empty() const { return rows_.empty(); }
  std::int64_t Int(std::size_t row, std::size_t column) const { return rows_[row][column].integer; }
  const std::string& Bytes(std::size_t row, std::size_t column) const { return rows_[row][column].bytes; }

  void Add(std::vector<Cell> row) { rows_.push_back(std::move(row)); }

 private:
  std::vector<std::vector<Cell>> rows_;
};

// One connection. Not thread-safe. Errors of all functions:
//   RESOURCE_EXHAUSTED with STORAGE_FULL      the disk is full
//   UNAVAILABLE with STORE_UNAVAILABLE        the database is away, or gave up this transaction for another one; a
//                                             Commit() that ends so may or may not have been done
//   INTERNAL                                  a bug, or damage
class SqlConnection {
 public:
  virtual ~SqlConnection() = default;

  virtual absl::Status Begin(Durability durability) = 0;
  virtual absl::Status Commit() = 0;
  // Also after an error, whatever was begun.
  virtual void Rollback() = 0;

  // Runs one statement, within the transaction that was begun or as one of its own. After it all that RunLater() was
  // given has run.
  virtual absl::StatusOr<SqlRows> Run(const std::string& sql, const std::vector<SqlValue>& values) = 0;

  // As Run(), for a statement whose rows nobody wants yet. It may be sent together with those that follow, which saves
  // a journey to the database: its error may be that of the next Run(), Serialize() or Commit(), and `rows` (null:
  // nobody wants them) are filled after that, and outlive it. Without a transaction it runs at once. Values are copied.
  virtual absl::Status RunLater(const std::string& sql, const std::vector<SqlValue>& values, SqlRows* rows = nullptr) {
    absl::StatusOr<SqlRows> result = Run(sql, values);
    if (result.ok() && rows != nullptr) *rows = *std::move(result);
    return result.status();
  }

  // Sends what RunLater() was given, and fills its rows.
  virtual absl::Status Flush() { return absl::OkStatus(); }

  // Until the end of the transaction nobody else passes Serialize() with any of these keys. Call it once at most,
  // before anything else is locked: several keys are taken in one order everywhere.
  virtual absl::Status Serialize(const std::vector<std::string>& keys) = 0;
  // Likewise for one key, without waiting: false if somebody else has passed.
  virtual absl::StatusOr<bool> TrySerialize(std::string_view key) = 0;

  // Waits, at the begin of a transaction, until only a few others are between here and their ends: for transactions
  // that all want the head of one queue. The more there are at the same time, the more rows each passes by that others
  // have locked, and the less any of them gets done. `number`: as even as can be over those who come. It may be sent as
  // RunLater() is. Nobody waits for long: HasTurn() is false, once it was sent, if the turn did not come in time. Then
  // the transaction should end, and its caller come again later.
  virtual absl::Status TakeTurn(std::uint64_t) { return absl::OkStatus(); }
  virtual bool HasTurn() const { return true; }

  // A small number, for this transaction, that those which write at the same time seldom share: of the row to add to,
  // where all of them add to one sum. Those that took a turn share theirs with no others, which may hold a row until
  // their commit is on the disk.
  virtual std::int64_t Slot() const { return 0; }
};

// Connections to one database. Thread-safe.
class SqlDatabase {
 public:
  enum class Use { kRead, kWrite };

  // Gives the connection back.
  using Lease = std::unique_ptr<SqlConnection, std::function<void(SqlConnection*)>>;

  virtual ~SqlDatabase() = default;

  // Waits for a connection that nobody else uses. Errors as of SqlConnection.
  virtual absl::StatusOr<Lease> Connect(Use use) = 0;

  // Tells all other processes that listen, soon and coalesced; each message is lines of text, and some may be lost. No
  // effect where there can be no other process.
  virtual void Publish(std::string_view message) = 0;
  // Calls `listener` with what other processes publish, on a thread of its own, until the object goes; with the line
  // "*" after something may have been lost. At most once.
  virtual void Listen(std::function<void(std::string_view message)> listener) = 0;
  // How many processes use the database, and how many of those must hear (PostgresOptions::must_hear), as far as is
  // known: at first this one alone. The more there are, the less often each publishes.
  virtual void SetProcesses(int /*all*/, int /*must_hear*/) {}
  // Whether what others publish comes in at all; false where there are too many for one that need not hear.
  virtual bool hears() const { return true; }

  // Of the data, made with the schema, the same for ever.
  virtual const std::string& id() const = 0;

  // Whether {now} works: several machines then go by one clock.
  virtual bool has_clock() const = 0;

  // Whether other processes may use it at the same time.
  virtual bool is_shared() const = 0;

  // After STORAGE_FULL: whether there is more room than before, so that a transaction that failed may be tried again.
  virtual bool GiveUpReserve() { return false; }

  // Whether rows outlive the process.
  virtual bool outlives_process() const = 0;
};

// UNAVAILABLE with STORE_UNAVAILABLE.
absl::Status StoreUnavailable(const std::string& why);

// The same change of many rows, or the same question of them, by as few statements as there can be: each costs a
// database more than the rows it reads and writes.
class RowBatch {
 public:
  // `{rows}` in the statement stands for the rows of values: (?, ?), (?, ?), ...
  static RowBatch Of(std::string statement);
  // Sets these columns of the rows that have the key; the key comes last in the rows of values.
  static RowBatch Update(const std::string& table, const std::vector<std::string>& columns, const std::string& key);
  // What the SELECT finds for each row of values, together.
  static RowBatch Select(std::string select);

  // Values are copied.
  void Add(const std::vector<SqlValue>& row);
  // Has the statements run (RunLater()), and forgets the rows. `answers`, unless it is null, gets what each returns.
  absl::Status Send(SqlConnection* sql, std::deque<SqlRows>* answers = nullptr);

 private:
  // The statement for so many rows of so many values.
  using Text = std::function<std::string(std::size_t rows, std::size_t columns)>;

  static constexpr std::size_t kMostRows = 16, kMostSelects = 4;  // of a statement; each SELECT has to be planned

  explicit RowBatch(Text text, std::size_t most = kMostRows) : text_(std::move(text)), most_(most) {}

  Text text_;
  std::size_t most_;
  std::vector<std::vector<SqlValue>> rows_;
  std::deque<std::string> bytes_;  // of the values; each stays where it is
};

// Runs `body` in a transaction: commits if it returns OK, otherwise leaves everything as it was. Where the disk is full
// and there is a reserve, `body` runs again.
absl::Status Transact(SqlDatabase* database, Durability durability,
                      const std::function<absl::Status(SqlConnection&)>& body);

// `sql` with what `replace` says in place of each word in braces. For implementations.
std::string ReplaceWords(std::string_view sql, const std::function<std::string(std::string_view word)>& replace);

struct PostgresOptions {
  std::string url;      // as libpq takes it: postgresql://USER@HOST:PORT/DATABASE?sslmode=verify-full, or KEY=VALUE ...
  int connections = 8;  // at most, >= 1
  std::string password = {};  // beside what the URL says; empty: none
  // Whether Listen() hears of everything even where many processes would be woken by each message: somebody watches.
  bool must_hear = true;
};

// PostgreSQL 15 or later. Sets up the tables of JobStore, one process at a time. Any number of processes
// may use it. A connection that is lost is made anew; no transaction-mode pooler between. Of several hosts in the URL
// (target_session_attrs=read-write) the primary is used that was promoted last, as far as this process has seen; at the
// start it looks at all hosts.
// INVALID_ARGUMENT if libpq cannot read the URL; FAILED_PRECONDITION with STORE_VERSION if the schema is of a newer
// version of planish than the next one (sql_schema.h).
absl::StatusOr<std::unique_ptr<SqlDatabase>> OpenPostgresDatabase(const PostgresOptions& options);

// SQLite at `path`, or ":memory:" for one that lives as long as the object. Sets up the tables of JobStore.
// FAILED_PRECONDITION with STORE_VERSION if the file was written by a newer version of planish. One process
// at a time; writers take turns. `give_up_reserve`: of SqlDatabase, null: there is none.
absl::StatusOr<std::unique_ptr<SqlDatabase>> OpenSqliteDatabase(const std::string& path,
                                                                std::function<bool()> give_up_reserve = nullptr);

}  // namespace planish
