// Messages between the processes that use one PostgreSQL: LISTEN and NOTIFY.
#pragma once

#include <functional>
#include <memory>
#include <mutex>
#include <set>
#include <string>
#include <string_view>
#include <thread>

namespace planish {

// Has a connection and a thread of its own. Messages are sent apart from transactions, since PostgreSQL lets only one
// transaction with a NOTIFY commit at a time, and those of some milliseconds together. Thread-safe.
class PostgresChannel {
 public:
  using Listener = std::function<void(std::string_view message)>;

  // `listener` hears of what others send, on the channel's thread, and of the line "*" whenever messages may have been
  // lost: after a connection was made anew, and where too many came at once.
  PostgresChannel(std::string url, Listener listener);
  ~PostgresChannel();
  PostgresChannel(const PostgresChannel&) = delete;
  PostgresChannel& operator=(const PostgresChannel&) = delete;

  // Sends lines of text soon, each once however often it was given in the meantime.
  void Publish(std::string_view lines);

 private:
  class Link;

  void Run();
  // Whether the channel ends. Waits for a message from elsewhere (`socket`, -1: none), for one to send, or for the end,
  // at most `milliseconds`.
  bool Wait(int socket, int milliseconds);
  // False if the connection is lost.
  bool Send(Link* link);

  const std::string url_;
  const Listener listener_;
  const int wake_;  // an eventfd

  std::mutex mutex_;
  // Guarded by mutex_.
  std::set<std::string> pending_;
  bool ending_ = false;

  std::thread thread_;
};

}  // namespace planish
