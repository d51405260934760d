// A PostgreSQL server of the test's own: Debian's package, a temporary folder, a Unix socket, no network.
#pragma once

#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "gtest/gtest.h"
#include "server/store/postgres_schema.h"
#include "server/store/sql.h"
#include "tests/testing/files.h"
#include "tests/testing/process.h"

namespace planish {

class PostgresServer {
 public:
  // Sets up a cluster and starts it; as the user `postgres` if this process is root. Throws std::runtime_error if that
  // cannot be.
  PostgresServer();
  // A standby of `primary`, which streams from it.
  explicit PostgresServer(const PostgresServer& primary);
  // Stops it. The server also ends with the thread that made the object, should the test program crash.
  ~PostgresServer();
  PostgresServer& operator=(const PostgresServer&) = delete;

  // Makes an empty database and returns its URL.
  std::string NewDatabase();

  // For libpq: the folder of the socket.
  std::string host() const { return directory_.Path(); }
  // Commits wait for the standby from now on.
  void SetSynchronous();
  // Until all standbys have what was written here before the call; throws std::runtime_error if they never do.
  void WaitForStandbys();
  // Makes a standby the primary.
  void Promote();
  // From now on also over TCP, with TLS and this password only: "postgresql://planish@localhost:PORT". `certificates`
  // is a folder that deploy/certificates.sh filled. Restarts it.
  std::string Secure(const std::string& certificates, const std::string& password);
  // A copy of the database as a backup by pg_dump has it; its URL.
  std::string Copy(const std::string& url);

  // None of its processes runs until Thaw(); the kernel still takes connections and bytes for them.
  void Freeze();
  void Thaw();

  // All its processes die at once; and come back.
  void Crash();
  void Start();

 private:
  // Runs a program of PostgreSQL as the user that may.
  std::string Run(const std::string& program, const std::string& arguments) const;

  void OwnDirectory() const;

  const TempDir directory_;
  int port_ = 5432;  // also in the name of the socket
  std::vector<std::string> settings_;
  std::unique_ptr<Process> process_;  // null after Crash()
  int databases_ = 0;
};

// Transactions with all turns (SqlConnection::TakeTurn), each by a connection of its own, of a PostgreSQL.
inline std::vector<SqlDatabase::Lease> TakeAllTurns(SqlDatabase* database) {
  std::vector<SqlDatabase::Lease> transactions;
  for (std::uint64_t number = 0; number < kTurns; ++number) {
    SqlDatabase::Lease& connection = transactions.emplace_back(*database->Connect(SqlDatabase::Use::kWrite));
    EXPECT_TRUE(connection->Begin(Durability::kLater).ok());
    EXPECT_TRUE(connection->TakeTurn(number).ok());
    EXPECT_TRUE(connection->Flush().ok());
    EXPECT_TRUE(connection->HasTurn());
  }
  return transactions;
}

}  // namespace planish
