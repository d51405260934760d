// Notices messages that are longer than their calls take, while they arrive.
#pragma once

#include <condition_variable>
#include <cstdint>
#include <functional>
#include <map>
#include <mutex>
#include <optional>
#include <string>
#include <thread>

namespace planish {

// gRPC looks at the length of a message when all of it is there. But the kernel knows how many bytes a TCP connection
// has received: where a connection with reads under way has received more than all of them take, they are too long. The
// connection is looked at two hundred times a second, so what arrives too much is what arrives meanwhile. Unix sockets
// do not count bytes. Thread-safe.
class ReadWatch {
 public:
  // What the stream of a call may send before it is read.
  static constexpr std::int64_t kLookaheadBytes = std::int64_t{1} << 20;

  ReadWatch();
  ~ReadWatch();
  ReadWatch(const ReadWatch&) = delete;
  ReadWatch& operator=(const ReadWatch&) = delete;

  // A call with credentials has begun or is over: its stream may send some bytes before they are read.
  void AddCall(const std::string& peer);
  void RemoveCall(const std::string& peer);

  // A message of at most `limit` bytes is to be read from `peer` (grpc::ServerContext::peer()). `stop` is called at
  // most once, on a thread of the watch, if too much comes. `read` identifies the read.
  void Begin(const void* read, const std::string& peer, std::int64_t limit, std::function<void()> stop);
  // A message of `bytes` bytes has come, or nothing comes any more. `stop` may still be under way.
  void End(const void* read, const std::string& peer, std::int64_t bytes);

 private:
  struct Read {
    std::int64_t limit;
    std::function<void()> stop;
  };
  struct Connection {
    int calls = 0;
    std::map<const void*, Read> reads;
    std::int64_t allowed = 0;       // bytes that the reads may have received since `received`
    std::optional<int> descriptor;  // looked for at the first look; -1: it counts no bytes
    std::int64_t received = 0;      // bytes of the connection when it was found
  };

  void Run();
  // Requires mutex_. Moves out the functions to call if too much has come.
  void Look(const std::string& peer, Connection* connection, std::map<const void*, Read>* too_long);

  std::mutex mutex_;
  std::condition_variable changed_;
  // Guarded by mutex_.
  std::map<std::string, Connection> connections_;  // those with calls or reads, by peer
  int reads_ = 0;
  bool ending_ = false;

  std::thread thread_;
};

}  // namespace planish
