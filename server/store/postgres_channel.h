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

// Has its own connection and thread. Messages are sent outside of transactions, since PostgreSQL lets only one
// transaction with a NOTIFY commit at a time. Lines that are published within some milliseconds are sent together; with
// many processes this time is longer. A message wakes all listening processes, and two hundred of them keep a whole
// PostgreSQL busy. So with more than kMostListeners processes, only those that must hear messages listen. Thread-safe.
class PostgresChannel {
 public:
  using Listener = std::function<void(std::string_view message)>;
  // Makes a new connection, which the channel then owns; null if that fails.
  using Connector = std::function<pg_conn*()>;

  // `connect` is called on the channel's thread, also after a connection is lost. `listener` is called on that thread
  // with messages from others, and with the line "*" whenever messages may have been lost: after a reconnection, or if
  // too many came at once. `must_hear`: listen even if there are many processes.
  PostgresChannel(Connector connect, bool must_hear, Listener listener);
  ~PostgresChannel();
  PostgresChannel(const PostgresChannel&) = delete;
  PostgresChannel& operator=(const PostgresChannel&) = delete;

  // Sends lines of text soon; a line given several times in the meantime is sent once.
  void Publish(std::string_view lines);

  // The number of processes with a channel, and of those that must listen.
  void SetProcesses(int all, int must_hear);
  // Whether messages are received. False if there are too many processes, or the connection is lost.
  bool hears() const { return hears_; }

  // With more processes than this, only those that must hear messages listen.
  static constexpr int kMostListeners = 32;

 private:
  using Clock = std::chrono::steady_clock;
  class Link;

  void Run();
  // Waits until a message arrives (on `socket`, -1: none), there is one to send, or the channel ends, at most for
  // `time`. Returns whether the channel ends.
  bool Wait(int socket, Clock::duration time);
  bool ShouldListen();
  // Time between two messages of this process.
  Clock::duration Spacing();
  // When the oldest unsent line was published; nullopt if no line waits.
  std::optional<Clock::time_point> PendingSince();
  // Sends the pending lines. False if the connection is lost.
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
