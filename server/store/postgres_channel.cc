#include "server/store/postgres_channel.h"

#include <libpq-fe.h>
#include <poll.h>
#include <sys/eventfd.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cstdint>
#include <cstdlib>
#include <utility>
#include <vector>

#include "absl/strings/str_split.h"

namespace planish {
namespace {

constexpr std::chrono::seconds kRetry(1);
constexpr std::chrono::seconds kLook(60);        // interval of checks of a silent connection
constexpr std::chrono::milliseconds kGather(5);  // lines that are published within this time are sent together

// Limits on the messages of all processes together, and on the wake-ups that they cause: each process sends less often
// the more processes there are and the more of them listen.
constexpr int kMessagesPerSecond = 400;
constexpr int kWakesPerSecond = 4000;

// PostgreSQL allows payloads below 8,000 bytes.
constexpr std::size_t kMostBytes = 7900;
constexpr std::size_t kMostMessages = 16;  // payloads sent at once; if there are more, "*" is sent instead

}  // namespace

class PostgresChannel::Link {
 public:
  // `connection` null: not connected.
  explicit Link(PGconn* connection) : connection_(connection) {}

  // Begins or ends to listen. False if the connection is lost.
  bool Listen(bool listens) {
    if (connection_ == nullptr) return false;
    if (listens == listens_) return true;
    if (Query(listens ? "LISTEN planish" : "UNLISTEN planish", nullptr) == nullptr) return false;
    listens_ = listens;
    return true;
  }

  bool listens() const { return listens_; }
  int socket() const { return PQsocket(connection_.get()); }

  bool Notify(const std::string& message) {
    return Query("SELECT pg_notify('planish', $1)", message.c_str()) != nullptr;
  }

  // Calls `listener` with the messages of other processes that have arrived. False if the connection is lost.
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

  struct Clearer {
    void operator()(PGresult* result) const { PQclear(result); }
  };
  using Result = std::unique_ptr<PGresult, Clearer>;

  // The result of the query; null if it failed.
  Result Query(const char* sql, const char* parameter) {
    Result result(
        PQexecParams(connection_.get(), sql, parameter == nullptr ? 0 : 1, nullptr, &parameter, nullptr, nullptr, 0));
    const ExecStatusType status = PQresultStatus(result.get());
    if (status != PGRES_COMMAND_OK && status != PGRES_TUPLES_OK) result.reset();
    return result;
  }

  std::unique_ptr<PGconn, Closer> connection_;
  bool listens_ = false;
};

PostgresChannel::PostgresChannel(Connector connect, bool must_hear, Listener listener)
    : connect_(std::move(connect)),
      must_hear_(must_hear),
      listener_(std::move(listener)),
      wake_(eventfd(0, EFD_CLOEXEC | EFD_NONBLOCK)) {
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
    if (wakes) pending_since_ = Clock::now();
    for (const absl::string_view line :
         absl::StrSplit(absl::string_view(lines.data(), lines.size()), '\n', absl::SkipEmpty())) {
      pending_.emplace(line);
    }
  }
  if (wakes) eventfd_write(wake_, 1);
}

bool PostgresChannel::Wait(int socket, Clock::duration time) {
  std::array<pollfd, 2> files = {{{wake_, POLLIN, 0}, {socket, POLLIN, 0}}};
  const auto milliseconds = std::chrono::ceil<std::chrono::milliseconds>(std::max(time, Clock::duration::zero()));
  poll(files.data(), files.size(), static_cast<int>(milliseconds.count()));  // poll() ignores negative descriptors
  eventfd_t count = 0;
  eventfd_read(wake_, &count);
  const std::lock_guard lock(mutex_);
  return ending_;
}

std::optional<PostgresChannel::Clock::time_point> PostgresChannel::PendingSince() {
  const std::lock_guard lock(mutex_);
  if (pending_.empty()) return std::nullopt;
  return pending_since_;
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

void PostgresChannel::SetProcesses(int all, int must_hear) {
  {
    const std::lock_guard lock(mutex_);
    processes_ = all;
    must_hear_too_ = must_hear;
  }
  eventfd_write(wake_, 1);
}

bool PostgresChannel::ShouldListen() {
  const std::lock_guard lock(mutex_);
  return must_hear_ || processes_ <= kMostListeners;
}

PostgresChannel::Clock::duration PostgresChannel::Spacing() {
  const std::lock_guard lock(mutex_);
  const int listeners = processes_ <= kMostListeners ? processes_ : must_hear_too_;
  const double seconds = std::max(1.0 / kMessagesPerSecond, double(listeners) / kWakesPerSecond) * processes_;
  return std::chrono::duration_cast<Clock::duration>(std::chrono::duration<double>(seconds));
}

void PostgresChannel::Run() {
  for (bool first = true;; first = false) {
    hears_ = false;
    if (!first && Wait(-1, kRetry)) return;
    Link link(connect_());
    Clock::time_point free;  // when the next message may be sent
    while (link.Listen(ShouldListen())) {
      if (link.listens() && !hears_) listener_("*\n");  // this process may have missed messages
      hears_ = link.listens();
      if (!link.Receive(listener_)) break;
      const std::optional<Clock::time_point> since = PendingSince();
      Clock::duration patience = kLook;
      if (since.has_value()) {
        const Clock::time_point now = Clock::now();
        const Clock::time_point due = std::max(*since + kGather, free);
        patience = due - now;
        if (due <= now) {
          if (!Send(&link)) break;
          free = Clock::now() + Spacing();
          continue;
        }
      }
      if (Wait(link.socket(), patience)) return;
    }
  }
}

}  // namespace planish
