// Statements in the one dialect that SQLite and PostgreSQL share, and the databases that run them.
//
// Statements are written once. `?` is the next parameter; the words below stand for what differs between the engines.
//   {lock}         after a SELECT within a transaction: locks these rows until it ends
//   {skip}         the same, leaving out rows that others have locked
//   {with_jobs}    after FROM (SELECT ... {skip}) AS heads: joins each of these works with its unfinished jobs, AS jobs
//                  (as they are once the work is locked)
//   {next_number}  a number for a new job, above all earlier ones; `column6` of the statement counts such jobs
//   {outcome}      the state of a job, where the statement says that it has ended
//   {anywhere}     true for each row, to read all rows of a small table in storage order
//   {now}          the database's time, nanoseconds since 1970; 0 without a clock (SqlDatabase::has_clock())
//   {elapsed}      the database's time since the transaction began, nanoseconds; 0 without a clock
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

// What a transaction survives.
enum class Durability {
  kNow,    // synced to disk before Commit() returns: survives a loss of power
  kLater,  // survives the process at once, and a loss of power after the next durable commit
};

// Bytes rather than text.
struct SqlBytes {
  std::string_view bytes;
};

// A parameter; std::monostate is NULL, as text. A statement must have parameters of the same types each time. Text and
// bytes must live until the call returns.
using SqlValue = std::variant<std::monostate, std::int64_t, std::string_view, SqlBytes>;

// The result of a statement: cells by row and column, both from 0. NULL reads as 0 and as "".
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
//   UNAVAILABLE with STORE_UNAVAILABLE        the database is unavailable, or gave up this transaction for another; a
//                                             Commit() with this error may or may not have been done
//   INTERNAL                                  a bug, or damage
class SqlConnection {
 public:
  virtual ~SqlConnection() = default;

  virtual absl::Status Begin(Durability durability) = 0;
  virtual absl::Status Commit() = 0;
  // Ends the transaction without changes. Also allowed after an error, and without a transaction.
  virtual void Rollback() = 0;

  // Runs one statement, within the current transaction or as its own. Statements given to RunLater() have run when it
  // returns.
  virtual absl::StatusOr<SqlRows> Run(const std::string& sql, const std::vector<SqlValue>& values) = 0;

  // Like Run(), for a statement whose rows are not needed yet. It may be sent together with those that follow, which
  // saves a round trip. Its error may then be reported by the next Run(), Serialize() or Commit(). `rows` (null: not
  // needed) are filled after that, and must live until then. Without a transaction the statement runs at once. Values
  // are copied.
  virtual absl::Status RunLater(const std::string& sql, const std::vector<SqlValue>& values, SqlRows* rows = nullptr) {
    absl::StatusOr<SqlRows> result = Run(sql, values);
    if (result.ok() && rows != nullptr) *rows = *std::move(result);
    return result.status();
  }

  // Sends the statements given to RunLater(), and fills their rows.
  virtual absl::Status Flush() { return absl::OkStatus(); }

  // Until the end of the transaction no other transaction passes Serialize() with any of these keys. Call it at most
  // once, before anything else is locked: the keys are locked in the same order everywhere.
  virtual absl::Status Serialize(const std::vector<std::string>& keys) = 0;
  // Serialize() for one key, without waiting: false if another transaction holds the key.
  virtual absl::StatusOr<bool> TrySerialize(std::string_view key) = 0;

  // Limits the number of transactions that want the head of the same queue: the more run at the same time, the more
  // locked rows each skips, and the less any of them gets done. Call it at the begin of a transaction. Waits until only
  // a few other transactions are between this call and their ends, but only for a short time: if the wait timed out,
  // HasTurn() is false once the call was sent, and the transaction should end and be tried again later. May be sent
  // like RunLater(). The argument should be evenly distributed over callers.
  virtual absl::Status TakeTurn(std::uint64_t) { return absl::OkStatus(); }
  virtual bool HasTurn() const { return true; }

  // A small number that concurrent writing transactions seldom share: it selects one of several rows that together hold
  // a sum. No other transactions have the numbers of those that called TakeTurn(), since the others may hold a row
  // until their commit is on the disk.
  virtual std::int64_t Slot() const { return 0; }
};

// Connections to one database. Thread-safe.
class SqlDatabase {
 public:
  enum class Use { kRead, kWrite };

  // A connection of the pool, which the destructor returns to it.
  using Lease = std::unique_ptr<SqlConnection, std::function<void(SqlConnection*)>>;

  virtual ~SqlDatabase() = default;

  // Waits for a free connection. Errors as of SqlConnection.
  virtual absl::StatusOr<Lease> Connect(Use use) = 0;

  // Sends a message to all other listening processes, soon and coalesced. Messages are lines of text, and some may be
  // lost. No effect if there can be no other process.
  virtual void Publish(std::string_view message) = 0;
  // Calls `listener` with what other processes publish, on its own thread, until the object is destroyed; with the line
  // "*" after messages may have been lost. Call at most once.
  virtual void Listen(std::function<void(std::string_view message)> listener) = 0;
  // The number of processes that use the database, and of those that must hear (PostgresOptions::must_hear), as far as
  // known; initially only this one. The more there are, the less often each publishes.
  virtual void SetProcesses(int /*all*/, int /*must_hear*/) {}
  // Whether messages of other processes are received; false if there are too many processes and this one need not hear.
  virtual bool hears() const { return true; }

  // Identifies the data; created with the schema and never changed.
  virtual const std::string& id() const = 0;

  // Whether {now} works, so that all machines use the same clock.
  virtual bool has_clock() const = 0;

  // Whether other processes may use the database at the same time.
  virtual bool is_shared() const = 0;

  // Call it after STORAGE_FULL: frees reserved room. Returns whether there is more room, so that the transaction can be
  // repeated.
  virtual bool GiveUpReserve() { return false; }

  // Whether rows survive the process.
  virtual bool outlives_process() const = 0;
};

// The error UNAVAILABLE with STORE_UNAVAILABLE; `why` is for people.
absl::Status StoreUnavailable(const std::string& why);

// Combines equal changes of (or queries for) many rows into as few statements as possible: a statement costs a database
// more than the rows that it reads and writes.
class RowBatch {
 public:
  // `{rows}` in the statement stands for the rows of values: (?, ?), (?, ?), ...
  static RowBatch Of(std::string statement);
  // Updates these columns of the rows with the key; the key is last in each row of values.
  static RowBatch Update(const std::string& table, const std::vector<std::string>& columns, const std::string& key);
  // Combines what the SELECT finds for each row of values.
  static RowBatch Select(std::string select);

  // Adds a row of values, which are copied.
  void Add(const std::vector<SqlValue>& row);
  // Queues the statements (RunLater()), and clears the rows. `answers`, unless null, gets the result of each.
  absl::Status Send(SqlConnection* sql, std::deque<SqlRows>* answers = nullptr);

 private:
  // The statement for this many rows and columns.
  using Text = std::function<std::string(std::size_t rows, std::size_t columns)>;

  static constexpr std::size_t kMostRows = 16, kMostSelects = 4;  // in one statement; each SELECT has to be planned

  explicit RowBatch(Text text, std::size_t most = kMostRows) : text_(std::move(text)), most_(most) {}

  Text text_;
  std::size_t most_;
  std::vector<std::vector<SqlValue>> rows_;
  std::deque<std::string> bytes_;  // the copied texts and bytes of the values; never moved
};

// Runs `body` in a transaction: commits if it returns OK, otherwise rolls back. If the disk is full and there is a
// reserve, runs `body` again.
absl::Status Transact(SqlDatabase* database, Durability durability,
                      const std::function<absl::Status(SqlConnection&)>& body);

// Replaces each word in braces in `sql` by `replace(word)`. For implementations.
std::string ReplaceWords(std::string_view sql, const std::function<std::string(std::string_view word)>& replace);

struct PostgresOptions {
  std::string url;            // for libpq: postgresql://USER@HOST:PORT/DATABASE?sslmode=verify-full, or KEY=VALUE ...
  int connections = 8;        // maximal number, >= 1
  std::string password = {};  // if not in the URL; empty: none
  // Whether Listen() is notified even if each message wakes many processes: set if the process has watchers.
  bool must_hear = true;
};

// PostgreSQL 15 or later. Sets up the tables of JobStore, one process at a time. Any number of processes may use it.
// Lost connections are replaced; transaction-mode poolers do not work. Of several hosts in the URL
// (target_session_attrs=read-write) it uses the primary that was promoted last, as far as this process knows; at the
// start it checks all hosts.
// INVALID_ARGUMENT if libpq cannot read the URL; FAILED_PRECONDITION with STORE_VERSION if the schema is of a newer
// version of planish than the next one (sql_schema.h).
absl::StatusOr<std::unique_ptr<SqlDatabase>> OpenPostgresDatabase(const PostgresOptions& options);

// SQLite at `path`, or ":memory:" for one that lives as long as the object. Sets up the tables of JobStore.
// FAILED_PRECONDITION with STORE_VERSION if a newer version of planish wrote the file. One process at a time; one
// writer at a time. `give_up_reserve` implements SqlDatabase::GiveUpReserve(); null: there is no reserve.
absl::StatusOr<std::unique_ptr<SqlDatabase>> OpenSqliteDatabase(const std::string& path,
                                                                std::function<bool()> give_up_reserve = nullptr);

}  // namespace planish
