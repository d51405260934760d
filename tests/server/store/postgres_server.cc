#include "tests/server/store/postgres_server.h"

#include <pwd.h>
#include <unistd.h>

#include <filesystem>
#include <stdexcept>

#include "tests/testing/process.h"

namespace planish {
namespace {

constexpr char kPrograms[] = "/usr/lib/postgresql/15/bin/";

// Of a cluster that lives for some seconds. It does not sync: its processes die, the machine does not.
constexpr char kSettings[] =
    "-c fsync=off -c listen_addresses= "
    "-c max_connections=50 -c shared_buffers=16MB -c autovacuum=off -c logging_collector=off";

}  // namespace

PostgresServer::PostgresServer() {
  if (geteuid() == 0) {
    const passwd* const user = getpwnam("postgres");
    if (user == nullptr || chown(directory_.Path().c_str(), user->pw_uid, user->pw_gid) != 0) {
      throw std::runtime_error("there is no user 'postgres': deploy/install-packages.sh test installs PostgreSQL");
    }
  }
  Run("initdb", "-D " + directory_.Path("data") + " -U planish --auth=trust --no-sync --no-locale -E UTF8");
  Start();
}

PostgresServer::~PostgresServer() {
  try {
    Run("pg_ctl", "-D " + directory_.Path("data") + " -m immediate -w stop");
  } catch (const std::exception&) {  // it crashed, and was not started again
  }
}

std::string PostgresServer::NewDatabase() {
  const std::string name = "test" + std::to_string(++databases_);
  Run("psql", "-h " + directory_.Path() + " -U planish -d postgres -qc 'CREATE DATABASE " + name + "'");
  return "postgresql://planish@/" + name + "?host=" + directory_.Path();
}

void PostgresServer::Crash() {
  Run("pg_ctl", "-D " + directory_.Path("data") + " -m immediate -w stop");
}

void PostgresServer::Start() {
  Run("pg_ctl", "-D " + directory_.Path("data") + " -l " + directory_.Path("log") + " -w -t 60 -o \"-k " +
                    directory_.Path() + " " + kSettings + "\" start");
}

std::string PostgresServer::Run(const std::string& program, const std::string& arguments) const {
  const std::string as = geteuid() == 0 ? "setpriv --reuid=postgres --regid=postgres --clear-groups " : "";
  const Outcome outcome = RunShell("cd / && " + as + kPrograms + program + " " + arguments + " </dev/null 2>&1");
  if (outcome.exit_code != 0) throw std::runtime_error(program + ": " + outcome.out + outcome.err);
  return outcome.out;
}

}  // namespace planish
