// A PostgreSQL server of the test's own: Debian's package, a temporary folder, a Unix socket, no network.
#pragma once

#include <memory>
#include <string>

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
  // Makes a standby the primary.
  void Promote();
  // A copy of the database as a backup by pg_dump has it; its URL.
  std::string Copy(const std::string& url);

  // All its processes die at once; and come back.
  void Crash();
  void Start();

 private:
  // Runs a program of PostgreSQL as the user that may.
  std::string Run(const std::string& program, const std::string& arguments) const;

  void OwnDirectory() const;

  const TempDir directory_;
  std::unique_ptr<Process> process_;  // null after Crash()
  int databases_ = 0;
};

}  // namespace planish
