// An HTTP proxy on loopback between a client and a server, which does harm when a test says.
#pragma once

#include <atomic>
#include <deque>
#include <mutex>
#include <string>
#include <thread>
#include <vector>

namespace planish {

enum class HttpFault {
  kNone,
  kRefuse,       // 503, and the server hears nothing of it
  kSilence,      // no answer, until the client gives up
  kCutAnswer,    // the connection ends within the answer
  kLoseAnswer,   // the server does what it was asked to, and the connection ends
  kWrongAnswer,  // the last byte of the answer is another one
  kWrongUpload,  // the last byte of the request is another one
};

class FaultyProxy {
 public:
  // For a server on loopback. Throws std::runtime_error if it cannot listen.
  explicit FaultyProxy(int server_port);
  ~FaultyProxy();
  FaultyProxy(const FaultyProxy&) = delete;
  FaultyProxy& operator=(const FaultyProxy&) = delete;

  int port() const { return port_; }

  // What happens to the next requests, one each; then nothing happens again.
  void Next(std::vector<HttpFault> faults);

  // So far.
  int requests() const { return requests_; }
  // The last one, as the client sent it: head with its empty line, and body.
  std::string last_request();

 private:
  void Listen();
  void Serve(int client);
  HttpFault Take();

  const int server_port_;
  int listener_ = -1;
  int port_ = 0;
  std::atomic<int> requests_ = 0;
  std::mutex mutex_;
  // Guarded by mutex_.
  std::deque<HttpFault> faults_;
  std::string last_request_;
  std::vector<std::thread> serving_;
  std::thread listening_;  // after what it uses
};

}  // namespace planish
