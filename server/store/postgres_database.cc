// PostgreSQL as a SqlDatabase: libpq and a pool of connections.
#include <endian.h>
#include <libpq-fe.h>

#include <algorithm>
#include <array>
#include <condition_variable>
#include <cstdlib>
#include <cstring>
#include <mutex>
#include <set>
#include <unordered_map>
#include <vector>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"
#include "absl/strings/str_split.h"
#include "core/base/error.h"
#include "core/base/status_macros.h"
#include "server/store/ids.h"
#include "server/store/job_schema.h"
#include "server/store/postgres_channel.h"
#include "server/store/postgres_schema.h"
#include "server/store/sql.h"
#include "server/store/sql_schema.h"

namespace planish {
namespace {

// meta.version of a database with the tables of job_schema.h.
constexpr std::int64_t kVersion = 1;

// Slots of transactions that did not call TakeTurn().
constexpr std::int64_t kSlots = 16;

// Advisory lock of migrations.
constexpr std::int64_t kMigrationKey = 0x706c616e697368;

// Statements that a connection keeps prepared. Filters of lists make an unlimited number of statements.
constexpr std::size_t kMostPrepared = 200;

// Types of parameters (pg_type.dat), which libpq's headers do not define.
constexpr Oid kInt8 = 20, kText = 25, kBytea = 17;

struct ResultDeleter {
  void operator()(PGresult* result) const { PQclear(result); }
};
using Result = std::unique_ptr<PGresult, ResultDeleter>;

std::string PostgresWord(std::string_view word) {
  if (word == "lock") return "FOR UPDATE";
  if (word == "skip") return "FOR UPDATE SKIP LOCKED";
  if (word == "with_jobs") return "LEFT JOIN LATERAL live_jobs_of(heads.name) AS jobs ON TRUE";
  if (word == "next_number") return "nextval('job_numbers')";
  if (word == "outcome") return "outcome";
  if (word == "outcome_column") {
    return "\n    outcome BIGINT GENERATED ALWAYS AS (CASE WHEN ended = 1 THEN state ELSE 0 END) STORED,";
  }
  if (word == "rowid") return "BIGINT";
  if (word == "text") return "TEXT COLLATE \"C\"";  // byte order, as in SQLite, whatever the machine's locale
  if (word == "bytes") return "BYTEA";
  if (word == "anywhere") return "ctid >= '(0,0)'";  // else an index would be used, since sequential scans are off
  if (word == "now") return "CAST(extract(epoch FROM clock_timestamp()) * 1000000000 AS BIGINT)";
  if (word == "elapsed") {
    return "CAST(extract(epoch FROM clock_timestamp() - transaction_timestamp()) * 1000000000 AS BIGINT)";
  }
  return "";
}

// Replaces each `?` by $1, $2, ...
std::string WithNumbers(const std::string& sql) {
  std::string text;
  int number = 0;
  for (const char c : sql) c == '?' ? absl::StrAppend(&text, "$", ++number) : text.push_back(c);
  return text;
}

// FNV-1a, which gives the same hash in every process.
std::int64_t HashOf(std::string_view key) {
  std::uint64_t hash = 14695981039346656037u;
  for (const char c : key) hash = (hash ^ static_cast<unsigned char>(c)) * 1099511628211u;
  return static_cast<std::int64_t>(hash);
}

std::string OneLine(std::string text) {
  std::replace(text.begin(), text.end(), '\n', ' ');
  while (text.ends_with(' ')) text.pop_back();
  return text;
}

std::int64_t IntegerOf(const char* bytes, int size) {
  std::uint64_t eight = 0;
  std::uint32_t four = 0;
  if (size == 8) std::memcpy(&eight, bytes, 8);
  if (size == 4) std::memcpy(&four, bytes, 4);
  return size == 4 ? static_cast<std::int32_t>(be32toh(four)) : static_cast<std::int64_t>(be64toh(eight));
}

// A libpq URL as KEY='VALUE' ..., with the password. One string for each host, with that host first.
absl::StatusOr<std::vector<std::string>> ConnectionStrings(const PostgresOptions& options) {
  struct Free {
    void operator()(PQconninfoOption* entries) const { PQconninfoFree(entries); }
  };
  char* error = nullptr;
  const std::unique_ptr<PQconninfoOption, Free> entries(PQconninfoParse(options.url.c_str(), &error));
  const std::unique_ptr<char, decltype(&PQfreemem)> message(error, &PQfreemem);
  if (entries == nullptr) {
    return absl::InvalidArgumentError(
        absl::StrCat("--store: ", message == nullptr ? "out of memory" : OneLine(message.get())));
  }
  std::vector<std::string> hosts = {""};
  for (const PQconninfoOption* entry = entries.get(); entry->keyword != nullptr; ++entry) {
    if (std::string_view(entry->keyword) == "host" && entry->val != nullptr) hosts = absl::StrSplit(entry->val, ',');
  }
  std::vector<std::string> all;
  for (std::size_t first = 0; first < hosts.size(); ++first) {
    std::string text;
    const auto add = [&text](const std::string& key, const std::string& value) {
      absl::StrAppend(&text, text.empty() ? "" : " ", key, "='");
      for (const char c : value) {
        if (c == '\'' || c == '\\') text.push_back('\\');
        text.push_back(c);
      }
      text.push_back('\'');
    };
    for (const PQconninfoOption* entry = entries.get(); entry->keyword != nullptr; ++entry) {
      if (entry->val == nullptr) continue;
      const std::string_view key = entry->keyword;
      std::vector<std::string> parts = {entry->val};
      // These are lists with an entry for each host.
      if (key == "host" || key == "hostaddr" || key == "port") parts = absl::StrSplit(entry->val, ',');
      if (parts.size() == hosts.size())
        std::rotate(parts.begin(), parts.begin() + static_cast<std::ptrdiff_t>(first), parts.end());
      add(entry->keyword, absl::StrJoin(parts, ","));
    }
    if (!options.password.empty()) add("password", options.password);
    all.push_back(std::move(text));
  }
  return all;
}

// Decides which of several primaries is current: the one promoted last. Each promotion begins a timeline with a higher
// number. A primary that was cut off, and returns after a standby was promoted in its place, still accepts writes,
// which would be lost. Thread-safe.
class Primary {
 public:
  // The cluster and the timeline that a server reports.
  struct Identity {
    std::string cluster;
    std::int64_t timeline = 0;
  };

  // Whether no server was admitted yet.
  bool IsUnknown() {
    const std::lock_guard lock(mutex_);
    return cluster_.empty();
  }

  // OK if this server may be used; then remembers its identity.
  absl::Status Admit(const Identity& found) {
    const std::lock_guard lock(mutex_);
    if (cluster_.empty()) cluster_ = found.cluster;
    if (found.cluster != cluster_) {
      return StoreUnavailable(absl::StrCat("the database is another one (system identifier ", found.cluster,
                                           ") than before (", cluster_, ")"));
    }
    if (found.timeline < timeline_) {
      return StoreUnavailable(absl::StrCat("an old primary has come back (timeline ", found.timeline,
                                           "; a standby was promoted "
                                           "to ",
                                           timeline_, "): it is not used. Stop it, or make it a standby"));
    }
    timeline_ = found.timeline;
    return absl::OkStatus();
  }

 private:
  std::mutex mutex_;
  // Guarded by mutex_.
  std::string cluster_;
  std::int64_t timeline_ = 0;
};

class PostgresConnection : public SqlConnection {
 public:
  // Connects to the first host that `primary` admits. A process that has not connected yet checks all hosts, and begins
  // with the one promoted last.
  static absl::StatusOr<std::unique_ptr<PostgresConnection>> Open(const std::vector<std::string>& urls,
                                                                  Primary* primary, const char* name = "planishd") {
    if (urls.size() > 1 && primary->IsUnknown()) {
      Primary::Identity newest;
      for (const std::string& url : urls) {
        PLANISH_ASSIGN_OR_RETURN(const std::unique_ptr<PostgresConnection> connection, Open(url, name));
        PLANISH_ASSIGN_OR_RETURN(const Primary::Identity found, connection->Identify());
        if (found.timeline > newest.timeline) newest = found;
      }
      PLANISH_RETURN_IF_ERROR(primary->Admit(newest));
    }
    absl::Status refused;
    for (const std::string& url : urls) {
      PLANISH_ASSIGN_OR_RETURN(std::unique_ptr<PostgresConnection> connection, Open(url, name));
      PLANISH_ASSIGN_OR_RETURN(const Primary::Identity found, connection->Identify());
      refused = primary->Admit(found);
      if (refused.ok()) return connection;
    }
    return refused;
  }

  static absl::StatusOr<std::unique_ptr<PostgresConnection>> Open(const std::string& url, const char* name) {
    // Settings in the URL override these. A server that vanishes silently is noticed within some seconds.
    const std::array<const char*, 6> keys = {"connect_timeout", "tcp_user_timeout", "application_name",
                                             "client_encoding", "dbname",           nullptr};
    const std::array<const char*, 6> values = {"5", "10000", name, "UTF8", url.c_str(), nullptr};
    std::unique_ptr<PostgresConnection> connection(
        new PostgresConnection(PQconnectdbParams(keys.data(), values.data(), /*expand_dbname=*/1)));
    PGconn* raw = connection->connection_.get();
    if (!connection->IsGood()) {
      return StoreUnavailable(absl::StrCat("PostgreSQL cannot be reached: ", OneLine(PQerrorMessage(raw))));
    }
    PQsetNoticeProcessor(
        raw, [](void*, const char*) {}, nullptr);
    // The timeouts end a session that hangs within a transaction, since it holds locks that others wait for. Every
    // frequent query has an index, so other scans are off: with no or old statistics, for instance of a queue that has
    // just grown, PostgreSQL would read whole tables, or sort all waiting rows to get one (bitmaps have no order). With
    // generic plans a statement is planned once; its LIMIT would otherwise have it planned each time.
    PLANISH_RETURN_IF_ERROR(connection->Execute(
        "SET idle_in_transaction_session_timeout = 30000; SET statement_timeout = 30000; SET enable_bitmapscan = off; "
        "SET enable_seqscan = off; SET plan_cache_mode = force_generic_plan"));
    return connection;
  }

  // Gives the connection to the caller.
  PGconn* Release() { return connection_.release(); }

  bool IsGood() const { return PQstatus(connection_.get()) == CONNECTION_OK; }
  bool IsIdle() const { return PQtransactionStatus(connection_.get()) == PQTRANS_IDLE; }

  // Runs several statements without parameters.
  absl::Status Execute(const std::string& script) {
    PLANISH_RETURN_IF_ERROR(Flush());
    return Check(Result(PQexec(connection_.get(), script.c_str()))).status();
  }

  absl::Status Begin(Durability durability) override {
    in_transaction_ = true;
    slot_ = PQbackendPID(connection_.get()) % kSlots;
    turn_ = {};
    waiting_.push_back({"BEGIN", {}});
    if (durability == Durability::kLater) waiting_.push_back({"SET LOCAL synchronous_commit = off", {}});
    return absl::OkStatus();
  }

  absl::Status Commit() override {
    in_transaction_ = false;
    PLANISH_ASSIGN_OR_RETURN(const Result result, Send({"COMMIT", {}}));
    // The server rolls back a failed transaction without reporting an error.
    if (std::string_view(PQcmdStatus(result.get())) == "COMMIT") return absl::OkStatus();
    return InternalError("the job store: a transaction that failed cannot be committed");
  }

  void Rollback() override {
    in_transaction_ = false;
    waiting_.clear();
    if (!IsIdle()) Execute("ROLLBACK").IgnoreError();
  }

  absl::Status Serialize(const std::vector<std::string>& keys) override {
    std::set<std::int64_t> hashes;
    for (const std::string& key : keys) hashes.insert(HashOf(key));
    RowBatch locks = RowBatch::Of("SELECT pg_advisory_xact_lock(column1) FROM (VALUES {rows}) AS hashes");
    for (const std::int64_t hash : hashes) locks.Add({hash});
    return locks.Send(this);
  }

  absl::StatusOr<bool> TrySerialize(std::string_view key) override {
    PLANISH_ASSIGN_OR_RETURN(const SqlRows rows,
                             Run("SELECT CAST(pg_try_advisory_xact_lock(?) AS INTEGER)", {HashOf(key)}));
    return rows.Int(0, 0) != 0;
  }

  absl::Status TakeTurn(std::uint64_t number) override {
    const auto lane = static_cast<std::int64_t>(number % kTurns);
    slot_ = kSlots + lane;
    return RunLater("SELECT take_turn(?)", {lane}, &turn_);
  }

  bool HasTurn() const override { return turn_.empty() || turn_.Int(0, 0) != 0; }

  std::int64_t Slot() const override { return slot_; }

  absl::Status RunLater(const std::string& sql, const std::vector<SqlValue>& values, SqlRows* rows) override {
    if (!in_transaction_) return SqlConnection::RunLater(sql, values, rows);
    waiting_.push_back({sql, Encoded(values), rows});
    return absl::OkStatus();
  }

  absl::Status Flush() override {
    if (waiting_.empty()) return absl::OkStatus();
    Statement last = std::move(waiting_.back());
    waiting_.pop_back();
    return Send(std::move(last)).status();
  }

  absl::StatusOr<SqlRows> Run(const std::string& sql, const std::vector<SqlValue>& values) override {
    PLANISH_ASSIGN_OR_RETURN(const Result result, Send({sql, Encoded(values)}));
    return RowsOf(result);
  }

 private:
  struct Closer {
    void operator()(PGconn* connection) const { PQfinish(connection); }
  };

  explicit PostgresConnection(PGconn* connection) : connection_(connection) {}

  absl::StatusOr<Primary::Identity> Identify() {
    PLANISH_ASSIGN_OR_RETURN(
        const SqlRows rows,
        Run("SELECT CAST(system_identifier AS TEXT), substr(pg_walfile_name(pg_current_wal_lsn()), 1, 8) "
            "FROM pg_control_system()",
            {}));
    return Primary::Identity{rows.Bytes(0, 0), std::strtoll(rows.Bytes(0, 1).c_str(), nullptr, 16)};
  }

  static SqlRows RowsOf(const Result& result) {
    SqlRows rows;
    const int columns = PQnfields(result.get());
    for (int row = 0; row < PQntuples(result.get()); ++row) {
      std::vector<SqlRows::Cell> cells(static_cast<std::size_t>(columns));
      for (int column = 0; column < columns; ++column) {
        const char* const bytes = PQgetvalue(result.get(), row, column);
        const int size = PQgetlength(result.get(), row, column);
        const Oid type = PQftype(result.get(), column);
        SqlRows::Cell& cell = cells[static_cast<std::size_t>(column)];
        if (type == kText || type == kBytea) {
          cell.bytes.assign(bytes, static_cast<std::size_t>(size));
        } else {
          cell.integer = IntegerOf(bytes, size);
        }
      }
      rows.Add(std::move(cells));
    }
    return rows;
  }

  // A value in the format of the protocol.
  struct Parameter {
    Oid type = kText;
    bool is_null = false;
    std::string bytes;
  };
  struct Statement {
    std::string sql;
    std::vector<Parameter> parameters;
    SqlRows* rows = nullptr;  // where its rows go; may be null
  };

  static std::vector<Parameter> Encoded(const std::vector<SqlValue>& values) {
    std::vector<Parameter> parameters(values.size());
    for (std::size_t i = 0; i < values.size(); ++i) {
      Parameter& parameter = parameters[i];
      if (const auto* integer = std::get_if<std::int64_t>(&values[i])) {
        parameter.type = kInt8;
        const std::uint64_t bits = htobe64(static_cast<std::uint64_t>(*integer));
        parameter.bytes.resize(sizeof bits);
        std::memcpy(parameter.bytes.data(), &bits, sizeof bits);
      } else if (const auto* text = std::get_if<std::string_view>(&values[i])) {
        parameter.bytes = *text;
      } else if (const auto* bytes = std::get_if<SqlBytes>(&values[i])) {
        parameter.type = kBytea;
        parameter.bytes = bytes->bytes;
      } else {
        parameter.is_null = true;
      }
    }
    return parameters;
  }

  // Runs the waiting statements and then `last`, in one round trip (libpq's pipeline mode). Returns the result of
  // `last`, or the first error.
  absl::StatusOr<Result> Send(Statement last) {
    std::vector<Statement> batch = std::exchange(waiting_, {});
    batch.push_back(std::move(last));
    PGconn* const raw = connection_.get();
    if (prepared_.size() + batch.size() > kMostPrepared) {
      PLANISH_RETURN_IF_ERROR(Execute("DEALLOCATE ALL"));
      prepared_.clear();
    }
    if (PQenterPipelineMode(raw) == 0) return StoreUnavailable(OneLine(PQerrorMessage(raw)));
    std::vector<std::string> fresh;  // statements prepared in this batch
    bool sent = true;
    std::vector<SqlRows*> results;  // for each statement that was sent, where its rows go
    for (const Statement& statement : batch) {
      if (statement.parameters.empty() && !statement.sql.starts_with("SELECT") &&
          !statement.sql.starts_with("UPDATE")) {
        // BEGIN, COMMIT, ...
        sent = sent && PQsendQueryParams(raw, WithNumbers(ReplaceWords(statement.sql, PostgresWord)).c_str(), 0,
                                         nullptr, nullptr, nullptr, nullptr, /*resultFormat=*/1) != 0;
        results.push_back(statement.rows);
        continue;
      }
      std::string& name = prepared_[statement.sql];
      if (name.empty()) {
        name = absl::StrCat("s", ++last_name_);
        fresh.push_back(statement.sql);
        std::vector<Oid> types;
        for (const Parameter& parameter : statement.parameters) types.push_back(parameter.type);
        const std::string text = WithNumbers(ReplaceWords(statement.sql, PostgresWord));
        sent =
            sent && PQsendPrepare(raw, name.c_str(), text.c_str(), static_cast<int>(types.size()), types.data()) != 0;
        results.push_back(nullptr);
      }
      std::vector<const char*> pointers;
      std::vector<int> sizes;
      for (const Parameter& parameter : statement.parameters) {
        pointers.push_back(parameter.is_null ? nullptr : parameter.bytes.c_str());
        sizes.push_back(static_cast<int>(parameter.bytes.size()));
      }
      const std::vector<int> formats(pointers.size(), 1);
      sent = sent && PQsendQueryPrepared(raw, name.c_str(), static_cast<int>(pointers.size()), pointers.data(),
                                         sizes.data(), formats.data(), /*resultFormat=*/1) != 0;
      results.push_back(statement.rows);
    }
    sent = sent && PQpipelineSync(raw) != 0;
    absl::StatusOr<Result> outcome = sent ? Collect(results) : StoreUnavailable(OneLine(PQerrorMessage(raw)));
    // Reads the rest of the batch's answers. A lost connection is discarded.
    while (PGresult* rest = PQgetResult(raw)) PQclear(rest);
    if (PQexitPipelineMode(raw) == 0 && outcome.ok()) outcome = StoreUnavailable(OneLine(PQerrorMessage(raw)));
    if (!outcome.ok()) {
      for (const std::string& sql : fresh) prepared_.erase(sql);  // they may not have been prepared
    }
    return outcome;
  }

  // Reads a result for each of `places`, and stores its rows there unless null. Returns the last result, or the first
  // error.
  absl::StatusOr<Result> Collect(const std::vector<SqlRows*>& places) {
    absl::StatusOr<Result> outcome = Result();
    for (SqlRows* const place : places) {
      Result result;
      // A null pointer ends the results of each statement.
      while (PGresult* part = PQgetResult(connection_.get())) result.reset(part);
      if (!outcome.ok()) continue;  // statements after an error were not run
      outcome = Check(std::move(result));
      if (outcome.ok() && place != nullptr) *place = RowsOf(*outcome);
    }
    return outcome;
  }

  absl::StatusOr<Result> Check(Result result) const {
    const ExecStatusType status = PQresultStatus(result.get());
    if (status == PGRES_COMMAND_OK || status == PGRES_TUPLES_OK) return result;
    const char* const field = PQresultErrorField(result.get(), PG_DIAG_SQLSTATE);
    const std::string_view state = field == nullptr ? "" : field;
    const char* const own = result == nullptr ? "" : PQresultErrorMessage(result.get());
    const std::string message = OneLine(*own != 0 ? own : PQerrorMessage(connection_.get()));
    if (state == "53100" || state == "53200") {  // disk_full, out_of_memory
      return MakeError(absl::StatusCode::kResourceExhausted, "STORAGE_FULL", absl::StrCat("the job store: ", message));
    }
    // Temporary errors: connection (08), operator intervention (57P), conflicts (40), locks and limits (53, 55, 57014,
    // 25P03), and a server that accepts no writes, such as a standby (25006).
    const bool passes = !IsGood() || state.empty() || state.starts_with("08") || state.starts_with("57") ||
                        state.starts_with("40") || state.starts_with("53") || state.starts_with("55") ||
                        state == "25006" || state == "25P03";
    return passes ? StoreUnavailable(message) : InternalError(absl::StrCat("the job store: ", message));
  }

  std::unique_ptr<PGconn, Closer> connection_;
  bool in_transaction_ = false;     // between Begin() and the end, even if the server does not know yet
  std::int64_t slot_ = 0;           // Slot() of the transaction
  SqlRows turn_;                    // the result of the transaction's TakeTurn()
  std::vector<Statement> waiting_;  // statements given to RunLater()
  std::unordered_map<std::string, std::string> prepared_;  // from statement to name
  std::int64_t last_name_ = 0;
};

class PostgresDatabase : public SqlDatabase {
 public:
  // `urls`: see ConnectionStrings().
  PostgresDatabase(const PostgresOptions& options, std::vector<std::string> urls)
      : connections_(options.connections), must_hear_(options.must_hear), urls_(std::move(urls)) {}

  absl::Status SetUp() {
    PLANISH_ASSIGN_OR_RETURN(const std::unique_ptr<PostgresConnection> connection,
                             PostgresConnection::Open(urls_, &primary_));
    absl::Status status = connection->Begin(Durability::kNow);
    if (status.ok()) status = SetUpJobs(connection.get());
    if (status.ok()) status = connection->Commit();
    return status;
  }

  absl::StatusOr<Lease> Connect(Use) override {
    std::unique_ptr<PostgresConnection> connection;
    {
      std::unique_lock lock(mutex_);
      given_back_.wait(lock, [this] { return given_ < connections_; });
      ++given_;
      if (!idle_.empty()) {
        connection = std::move(idle_.back());
        idle_.pop_back();
      }
    }
    if (connection == nullptr) {
      absl::StatusOr<std::unique_ptr<PostgresConnection>> opened = PostgresConnection::Open(urls_, &primary_);
      if (!opened.ok()) {
        GiveBack(nullptr);
        return opened.status();
      }
      connection = *std::move(opened);
    }
    return Lease(connection.release(), [this](SqlConnection* used) {
      GiveBack(std::unique_ptr<PostgresConnection>(static_cast<PostgresConnection*>(used)));
    });
  }

  void Publish(std::string_view message) override {
    if (channel_ != nullptr) channel_->Publish(message);
  }
  void Listen(std::function<void(std::string_view message)> listener) override {
    const auto connect = [this]() -> PGconn* {
      absl::StatusOr<std::unique_ptr<PostgresConnection>> opened =
          PostgresConnection::Open(urls_, &primary_, "planishd news");
      // Messages are sent one at a time, and need not wait for the disk.
      const bool ready = opened.ok() && (*opened)->Execute("SET synchronous_commit = off").ok();
      return ready ? (*opened)->Release() : nullptr;
    };
    channel_ = std::make_unique<PostgresChannel>(connect, must_hear_, std::move(listener));
  }
  void SetProcesses(int all, int must_hear) override {
    if (channel_ != nullptr) channel_->SetProcesses(all, must_hear);
  }
  bool hears() const override { return channel_ != nullptr && channel_->hears(); }
  const std::string& id() const override { return id_; }
  bool has_clock() const override { return true; }
  bool is_shared() const override { return true; }
  bool outlives_process() const override { return true; }

 private:
  // Sets up JobStore's tables. Call it in a transaction; an advisory lock admits one process at a time.
  absl::Status SetUpJobs(PostgresConnection* connection) {
    PLANISH_RETURN_IF_ERROR(connection->Execute(absl::StrCat("SELECT pg_advisory_xact_lock(", kMigrationKey, ")")));
    PLANISH_RETURN_IF_ERROR(
        connection->Execute("CREATE TABLE IF NOT EXISTS meta (id TEXT NOT NULL, version BIGINT NOT NULL)"));
    PLANISH_ASSIGN_OR_RETURN(SqlRows meta, connection->Run("SELECT id, version FROM meta", {}));
    std::int64_t version = 0;
    if (meta.empty()) {
      id_ = RandomId();
      PLANISH_RETURN_IF_ERROR(connection->Run("INSERT INTO meta VALUES (?, 0)", {std::string_view(id_)}).status());
    } else {
      id_ = meta.Bytes(0, 0);
      version = meta.Int(0, 1);
    }
    PLANISH_RETURN_IF_ERROR(CheckStepsAhead("jobs", version, kVersion));
    if (version >= kVersion) return absl::OkStatus();
    PLANISH_RETURN_IF_ERROR(connection->Execute(ReplaceWords(kJobSchema, PostgresWord)));
    PLANISH_RETURN_IF_ERROR(connection->Execute(kPostgresSchema));
    return connection->Run("UPDATE meta SET version = ?", {kVersion}).status();
  }

  // Takes a connection back. A null or broken one makes room for a new one; the idle ones, which are probably broken as
  // well, are then closed.
  void GiveBack(std::unique_ptr<PostgresConnection> connection) {
    std::vector<std::unique_ptr<PostgresConnection>> closed;
    const std::lock_guard lock(mutex_);
    --given_;
    if (connection != nullptr && connection->IsGood() && connection->IsIdle()) {
      idle_.push_back(std::move(connection));
    } else {
      closed.swap(idle_);
    }
    given_back_.notify_one();
  }

  const int connections_;
  const bool must_hear_;
  const std::vector<std::string> urls_;
  Primary primary_;
  std::string id_;                            // constant after SetUp()
  std::unique_ptr<PostgresChannel> channel_;  // constant after Listen()

  std::mutex mutex_;
  std::condition_variable given_back_;
  // Guarded by mutex_.
  std::vector<std::unique_ptr<PostgresConnection>> idle_;
  int given_ = 0;
};

}  // namespace

absl::StatusOr<std::unique_ptr<SqlDatabase>> OpenPostgresDatabase(const PostgresOptions& options) {
  PLANISH_ASSIGN_OR_RETURN(std::vector<std::string> urls, ConnectionStrings(options));
  auto database = std::make_unique<PostgresDatabase>(options, std::move(urls));
  PLANISH_RETURN_IF_ERROR(database->SetUp());
  return database;
}

}  // namespace planish
