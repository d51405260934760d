#include "tests/server/store/postgres_server.h"

#include <pwd.h>
#include <unistd.h>

#include <atomic>
#include <csignal>
#include <fstream>
#include <stdexcept>
#include <vector>

namespace planish {
namespace {

constexpr char kPrograms[] = "/usr/lib/postgresql/15/bin/";

// Of a cluster that lives for some seconds. It does not sync: its processes die, the machine does not.
const std::vector<std::string> kSettings = {"fsync=off",           "listen_addresses=", "max_connections=100",
                                            "shared_buffers=16MB", "autovacuum=off",    "logging_collector=off"};

// Before a command: it runs as a user that PostgreSQL accepts.
std::vector<std::string> AsItsUser(std::vector<std::string> options = {}) {
  if (geteuid() == 0) options.insert(options.end(), {"--reuid=postgres", "--regid=postgres", "--clear-groups"});
  if (!options.empty()) options.insert(options.begin(), "/usr/bin/setpriv");
  return options;
}

}  // namespace

void PostgresServer::OwnDirectory() const {
  if (geteuid() == 0) {
    const passwd* const user = getpwnam("postgres");
    if (user == nullptr || chown(directory_.Path().c_str(), user->pw_uid, user->pw_gid) != 0) {
      throw std::runtime_error("there is no user 'postgres': deploy/install-packages.sh test installs PostgreSQL");
    }
  }
}

PostgresServer::PostgresServer() {
  OwnDirectory();
  Run("initdb", "-D " + directory_.Path("data") + " -U planish --auth=trust --no-sync --no-locale -E UTF8");
  Start();
}

PostgresServer::PostgresServer(const PostgresServer& primary) {
  OwnDirectory();
  // A primary that crashed drops what it has written ahead unless a slot keeps it: the standby could not follow, and
  // commits would wait for ever.
  static std::atomic<int> standbys = 0;
  const std::string slot = " -C -S standby_" + std::to_string(++standbys);
  Run("pg_basebackup",
      "-h " + primary.host() + " -U planish -D " + directory_.Path("data") + " -R -X stream --no-sync -c fast" + slot);
  // After a crash of the primary, whose commits wait for us.
  std::ofstream(directory_.Path("data/postgresql.auto.conf"), std::ios::app)
      << "wal_retrieve_retry_interval = '200ms'\n";
  Start();
}

PostgresServer::~PostgresServer() {
  Crash();
}

std::string PostgresServer::NewDatabase() {
  const std::string name = "test" + std::to_string(++databases_);
  Run("psql", "-h " + directory_.Path() + " -U planish -d postgres -qc 'CREATE DATABASE " + name + "'");
  return "postgresql://planish@/" + name + "?host=" + directory_.Path();
}

void PostgresServer::SetSynchronous() {
  const std::string psql = "-h " + host() + " -U planish -d postgres -qc ";
  Run("psql", psql + "\"ALTER SYSTEM SET synchronous_standby_names = '*'\"");
  Run("psql", psql + "'SELECT pg_reload_conf()'");
}

void PostgresServer::WaitForStandbys() {
  const std::string psql = "-h " + host() + " -U planish -d postgres -Atqc ";
  std::string written = Run("psql", psql + "'SELECT pg_current_wal_insert_lsn()'");
  written.resize(written.find_last_not_of('\n') + 1);
  const std::string all_have = psql + "\"SELECT bool_and(replay_lsn >= '" + written + "') FROM pg_stat_replication\"";
  if (!WaitUntil([&] { return Run("psql", all_have).starts_with("t"); }, 60)) {
    throw std::runtime_error("the standby does not follow");
  }
}

void PostgresServer::Promote() {
  Run("psql", "-h " + host() + " -U planish -d postgres -qc 'SELECT pg_promote()'");
}

std::string PostgresServer::Copy(const std::string& url) {
  const std::string copy = NewDatabase();
  Run("pg_dump", "-Fc -f " + directory_.Path("dump") + " '" + url + "'");
  Run("pg_restore", "-d '" + copy + "' " + directory_.Path("dump"));
  return copy;
}

std::string PostgresServer::Secure(const std::string& certificates, const std::string& password) {
  Run("psql", "-h " + host() + " -U planish -d postgres -qc \"ALTER USER planish PASSWORD '" + password + "'\"");
  const std::string data = directory_.Path("data/");
  std::ofstream(data + "pg_hba.conf") << "local all all trust\nhostssl all all 127.0.0.1/32 scram-sha-256\n";
  const std::string as = geteuid() == 0 ? "-o postgres -g postgres " : "";
  const Outcome copied =
      RunShell("install " + as + "-m 600 " + certificates + "/server.pem " + certificates + "/server-key.pem " + data);
  if (copied.exit_code != 0) throw std::runtime_error(copied.err);
  port_ = FreePort();
  settings_ = {"listen_addresses=127.0.0.1", "ssl=on", "ssl_cert_file=server.pem", "ssl_key_file=server-key.pem"};
  Crash();
  Start();
  return "postgresql://planish@localhost:" + std::to_string(port_);
}

void PostgresServer::Freeze() {
  process_->Signal(SIGSTOP);  // first, so that it starts no more of them
  for (const pid_t child : ChildrenOf(process_->pid())) kill(child, SIGSTOP);
}

void PostgresServer::Thaw() {
  for (const pid_t child : ChildrenOf(process_->pid())) kill(child, SIGCONT);
  process_->Signal(SIGCONT);
}

void PostgresServer::Crash() {
  if (process_ == nullptr) return;
  process_->Signal(SIGQUIT);
  process_->Wait();
  process_ = nullptr;
}

void PostgresServer::Start() {
  std::vector<std::string> command = AsItsUser({"--pdeathsig=QUIT"});
  command.insert(command.end(), {std::string(kPrograms) + "postgres", "-D", directory_.Path("data"), "-k",
                                 directory_.Path(), "-p", std::to_string(port_)});
  for (const std::string& setting : kSettings) command.insert(command.end(), {"-c", setting});
  for (const std::string& setting : settings_) command.insert(command.end(), {"-c", setting});
  process_ = std::make_unique<Process>(command);
  // Up to a minute, as pg_ctl would.
  const std::string ready =
      std::string(kPrograms) + "pg_isready -q -h " + directory_.Path() + " -p " + std::to_string(port_);
  const Outcome outcome = RunShell("for i in $(seq 1200); do " + ready + " && exit 0; sleep 0.05; done; exit 1");
  if (outcome.exit_code != 0) throw std::runtime_error("PostgreSQL does not start: " + process_->Err());
}

std::string PostgresServer::Run(const std::string& program, const std::string& arguments) const {
  std::string as;
  for (const std::string& word : AsItsUser()) as += word + " ";
  const Outcome outcome = RunShell("cd / && export PGPORT=" + std::to_string(port_) + " && " + as + kPrograms +
                                   program + " " + arguments + " </dev/null 2>&1");
  if (outcome.exit_code != 0) throw std::runtime_error(program + ": " + outcome.out + outcome.err);
  return outcome.out;
}

}  // namespace planish
