#include "server/store/postgres_channel.h"

#include <libpq-fe.h>
#include <poll.h>
#include <sys/eventfd.h>
#include <unistd.h>

#include <array>
#include <cstdint>
#include <utility>
#include <vector>

#include "absl/strings/str_split.h"

namespace planish {
namespace {

constexpr int kRetryMilliseconds = 1000;
constexpr int kLookMilliseconds = 60'000;  // at the connection, where nothing comes
constexpr int kGatherMilliseconds = 5;     // what comes meanwhile travels together

// PostgreSQL takes payloads below 8,000 bytes.
constexpr std::size_t kMostBytes = 7900;
constexpr std::size_t kMostMessages = 16;  // that are sent at once; beyond them "*" says as much

}  // namespace

class PostgresChannel::Link {
 public:
  explicit Link(const std::string& url) {
    const std::array<const char*, 4> keys = {"connect_timeout", "application_name", "dbname", nullptr};
    const std::array<const char*, 4> values = {"5", "planishd news", url.c_str(), nullptr};
    connection_.reset(PQconnectdbParams(keys.data(), values.data(), /*expand_dbname=*/1));
    PQsetNoticeProcessor(
        connection_.get(), [](void*, const char*) {}, nullptr);
    listens_ = Execute("LISTEN planish", nullptr);
  }

  bool listens() const { return listens_; }
  int socket() const { return PQsocket(connection_.get()); }

  bool Notify(const std::string& message) { return Execute("SELECT pg_notify('planish', $1)", message.c_str()); }

  // False if the connection is lost.
  bool Receive(const Listener& listener) {
    if (PQconsumeInput(connection_.get()) == 0) return false;
    while (PGnotify* const notice = PQnotifies(connection_.get())) {
      const std::unique_ptr<PGnotify, decltype(&PQfreemem)> owner(notice, PQfreemem);
      if (notice->be_pid != PQbackendPID(connection_.get())) listener(notice->extra);
    }
    return PQstatus(connection_.get()) == CONNECTION_OK;
  }

 private:
  struct Closer {
    void operator()(PGconn* connection) const { PQfinish(connection); }
  };

  bool Execute(const char* sql, const char* parameter) {
    const std::unique_ptr<PGresult, decltype(&PQclear)> result(
        PQexecParams(connection_.get(), sql, parameter == nullptr ? 0 : 1, nullptr, &parameter, nullptr, nullptr, 0),
        PQclear);
    const ExecStatusType status = PQresultStatus(result.get());
    return status == PGRES_COMMAND_OK || status == PGRES_TUPLES_OK;
  }

  std::unique_ptr<PGconn, Closer> connection_;
  bool listens_ = false;
};

PostgresChannel::PostgresChannel(std::string url, Listener listener)
    : url_(std::move(url)), listener_(std::move(listener)), wake_(eventfd(0, EFD_CLOEXEC | EFD_NONBLOCK)) {
  thread_ = std::thread([this] { Run(); });
}

PostgresChannel::~PostgresChannel() {
  {
    const std::lock_guard lock(mutex_);
    ending_ = true;
  }
  eventfd_write(wake_, 1);
  thread_.join();
  close(wake_);
}

void PostgresChannel::Publish(std::string_view lines) {
  bool wakes = false;
  {
    const std::lock_guard lock(mutex_);
    wakes = pending_.empty();
    for (const absl::string_view line :
         absl::StrSplit(absl::string_view(lines.data(), lines.size()), '\n', absl::SkipEmpty())) {
      pending_.emplace(line);
    }
  }
  if (wakes) eventfd_write(wake_, 1);
}

bool PostgresChannel::Wait(int socket, int milliseconds) {
  std::array<pollfd, 2> files = {{{wake_, POLLIN, 0}, {socket, POLLIN, 0}}};
  poll(files.data(), files.size(), milliseconds);  // poll() leaves out negative ones
  eventfd_t count = 0;
  eventfd_read(wake_, &count);
  const std::lock_guard lock(mutex_);
  return ending_;
}

bool PostgresChannel::Send(Link* link) {
  std::set<std::string> lines;
  {
    const std::lock_guard lock(mutex_);
    lines.swap(pending_);
  }
  std::vector<std::string> messages;
  for (const std::string& line : lines) {
    if (messages.empty() || messages.back().size() + line.size() + 1 > kMostBytes) messages.emplace_back();
    messages.back() += line + "\n";
  }
  if (messages.size() > kMostMessages) messages = {"*\n"};
  for (const std::string& message : messages) {
    if (!link->Notify(message)) return false;
  }
  return true;
}

void PostgresChannel::Run() {
  for (bool first = true;; first = false) {
    if (!first && Wait(-1, kRetryMilliseconds)) return;
    Link link(url_);
    if (!link.listens()) continue;
    listener_("*\n");  // before, nobody listened
    while (Send(&link) && link.Receive(listener_)) {
      if (Wait(link.socket(), kLookMilliseconds)) return;
      if (Wait(-1, kGatherMilliseconds)) return;
    }
  }
}

}  // namespace planish
