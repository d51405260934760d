// Messages between the processes that use one PostgreSQL: LISTEN and NOTIFY.
#pragma once

#include <atomic>
#include <chrono>
#include <functional>
#include <memory>
#include <mutex>
#include <optional>
#include <set>
#include <string>
#include <string_view>
#include <thread>

struct pg_conn;  // libpq's PGconn

namespace planish {

// Has a connection and a thread of its own. Messages are sent apart from transactions, since PostgreSQL lets only one
// transaction with a NOTIFY commit at a time. Those of some milliseconds travel together, of more where there are many
// processes. A message wakes all processes that listen: two hundred of them take a whole PostgreSQL to themselves. So
// where there are many, only those listen that must (kMostListeners). Thread-safe.
class PostgresChannel {
 public:
  using Listener = std::function<void(std::string_view message)>;
  // A new connection, which becomes the channel's; null: there is none now.
  using Connector = std::function<pg_conn*()>;

  // `connect` is called on the channel's thread, as often as a connection is lost. `listener` hears of what others
  // send, on the channel's thread, and of the line "*" whenever messages may have been lost: after a connection was
  // made anew, and where too many came at once. `must_hear`: also where many listen.
  PostgresChannel(Connector connect, bool must_hear, Listener listener);
  ~PostgresChannel();
  PostgresChannel(const PostgresChannel&) = delete;
  PostgresChannel& operator=(const PostgresChannel&) = delete;

  // Sends lines of text soon, each once however often it was given in the meantime.
  void Publish(std::string_view lines);

  // Processes with such an object, and those of them that must hear.
  void SetProcesses(int all, int must_hear);
  // Whether messages come in; false: there are many processes, or the connection is lost.
  bool hears() const { return hears_; }

  // Processes, from more of which on those that need not hear do not listen.
  static constexpr int kMostListeners = 32;

 private:
  using Clock = std::chrono::steady_clock;
  class Link;

  void Run();
  // Whether the channel ends. Waits for a message from elsewhere (`socket`, -1: none), for one to send, or for the end,
  // at most `time`.
  bool Wait(int socket, Clock::duration time);
  bool ShouldListen();
  // Between two messages of this process.
  Clock::duration Spacing();
  // When the oldest line that waits was given; empty: none waits.
  std::optional<Clock::time_point> PendingSince();
  // False if the connection is lost.
  bool Send(Link* link);

  const Connector connect_;
  const bool must_hear_;
  const Listener listener_;
  const int wake_;  // an eventfd

  std::atomic<bool> hears_ = false;

  std::mutex mutex_;
  // Guarded by mutex_.
  std::set<std::string> pending_;
  Clock::time_point pending_since_;
  int processes_ = 1;
  int must_hear_too_ = 1;
  bool ending_ = false;

  std::thread thread_;
};

}  // namespace planish
