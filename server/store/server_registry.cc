#include "server/store/server_registry.h"

#include <algorithm>

#include "core/base/error.h"
#include "core/base/status_macros.h"
#include "server/store/sql_schema.h"

namespace planish {
namespace {

constexpr std::string_view kServers = R"sql(
  CREATE TABLE servers (
    name TEXT COLLATE "C" PRIMARY KEY,
    answers BIGINT NOT NULL,
    workers BIGINT NOT NULL,
    memory_bytes BIGINT NOT NULL,
    version TEXT NOT NULL,
    until BIGINT NOT NULL
  ))sql";

}  // namespace

absl::StatusOr<std::unique_ptr<ServerRegistry>> ServerRegistry::Make(SqlDatabase* database) {
  if (!database->has_clock()) {
    return MakeError(absl::StatusCode::kFailedPrecondition, "STORE_UNFIT",
                     "only PostgreSQL is shared by several servers");
  }
  PLANISH_RETURN_IF_ERROR(SetUpTables(database, "servers", {kServers}));
  return std::unique_ptr<ServerRegistry>(new ServerRegistry(database));
}

absl::Status ServerRegistry::Announce(const ServerEntry& server, absl::Duration time) {
  return Transact(database_, Durability::kLater, [&](SqlConnection& sql) -> absl::Status {
    PLANISH_RETURN_IF_ERROR(
        sql.RunLater("INSERT INTO servers VALUES (?, ?, ?, ?, ?, {now} + ?) ON CONFLICT (name) DO UPDATE SET "
                     "answers = excluded.answers, workers = excluded.workers, memory_bytes = excluded.memory_bytes, "
                     "version = excluded.version, until = excluded.until",
                     {std::string_view(server.name), std::int64_t{server.answers}, std::int64_t{server.workers},
                      server.memory_bytes, std::string_view(server.version), absl::ToInt64Nanoseconds(time)}));
    // Concurrent deletions of the same rows need not wait for each other.
    return sql.RunLater("DELETE FROM servers WHERE name IN (SELECT name FROM servers WHERE until < {now} {skip})", {});
  });
}

absl::StatusOr<ClockOffset> ServerRegistry::Compare(const std::function<absl::Time()>& clock) {
  PLANISH_ASSIGN_OR_RETURN(const SqlDatabase::Lease connection, database_->Connect(SqlDatabase::Use::kRead));
  const absl::Time before = clock();
  PLANISH_ASSIGN_OR_RETURN(const SqlRows now, connection->Run("SELECT {now}", {}));
  const absl::Duration half = (clock() - before) / 2;
  return ClockOffset{before + half - absl::FromUnixNanos(now.Int(0, 0)), half};
}

absl::Status ServerRegistry::Withdraw(const std::string& name) {
  return Transact(database_, Durability::kLater, [&name](SqlConnection& sql) {
    return sql.RunLater("DELETE FROM servers WHERE name = ?", {std::string_view(name)});
  });
}

absl::StatusOr<std::vector<ServerEntry>> ServerRegistry::List() {
  PLANISH_ASSIGN_OR_RETURN(const SqlDatabase::Lease connection, database_->Connect(SqlDatabase::Use::kRead));
  PLANISH_ASSIGN_OR_RETURN(const SqlRows rows,
                           connection->Run("SELECT name, answers, workers, memory_bytes, version FROM servers "
                                           "WHERE until >= {now} ORDER BY name",
                                           {}));
  std::vector<ServerEntry> servers;
  for (std::size_t i = 0; i < rows.size(); ++i) {
    servers.push_back(
        {rows.Bytes(i, 0), rows.Int(i, 1) != 0, static_cast<int>(rows.Int(i, 2)), rows.Int(i, 3), rows.Bytes(i, 4)});
  }
  database_->SetProcesses(static_cast<int>(servers.size()),
                          static_cast<int>(std::count_if(servers.begin(), servers.end(),
                                                         [](const ServerEntry& server) { return server.answers; })));
  return servers;
}

}  // namespace planish
