// Detects messages that are longer than their calls accept, while they arrive.
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

// gRPC checks the length of a message only when all of it has arrived. But the kernel counts the bytes that a TCP
// connection has received: if these are more than all running reads of the connection accept, some message is too long.
// Connections are checked two hundred times a second, so the excess is at most the bytes that arrive between two
// checks. Unix sockets do not count bytes. Thread-safe.
class ReadWatch {
 public:
  // Bytes that the stream of a call may send before they are read.
  static constexpr std::int64_t kLookaheadBytes = std::int64_t{1} << 20;

  ReadWatch();
  ~ReadWatch();
  ReadWatch(const ReadWatch&) = delete;
  ReadWatch& operator=(const ReadWatch&) = delete;

  // Call them when a call with credentials begins and ends. While it runs, its stream may send kLookaheadBytes before
  // they are read.
  void AddCall(const std::string& peer);
  void RemoveCall(const std::string& peer);

  // Starts watching the read of a message of at most `limit` bytes from `peer` (grpc::ServerContext::peer()). `stop` is
  // called at most once, on the watch's thread, if too many bytes arrive. `read` identifies the read.
  void Begin(const void* read, const std::string& peer, std::int64_t limit, std::function<void()> stop);
  // A message of `bytes` bytes has arrived, or the read ended without one. `stop` may still be running.
  void End(const void* read, const std::string& peer, std::int64_t bytes);

 private:
  struct Read {
    std::int64_t limit;
    std::function<void()> stop;
  };
  struct Connection {
    int calls = 0;
    std::map<const void*, Read> reads;
    std::int64_t allowed = 0;       // bytes that the reads accept, in addition to `received`
    std::optional<int> descriptor;  // found at the first check; -1: the connection does not count bytes
    std::int64_t received = 0;      // bytes that the connection had received at the first check
  };

  void Run();
  // Requires mutex_. Moves the reads to stop to `too_long` if too many bytes have arrived.
  void Look(const std::string& peer, Connection* connection, std::map<const void*, Read>* too_long);

  std::mutex mutex_;
  std::condition_variable changed_;
  // Guarded by mutex_.
  std::map<std::string, Connection> connections_;  // connections with calls or reads, by peer
  int reads_ = 0;
  bool ending_ = false;

  std::thread thread_;
};

}  // namespace planish
