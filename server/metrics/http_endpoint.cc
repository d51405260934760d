#include "server/metrics/http_endpoint.h"

#include <fcntl.h>
#include <httplib.h>
#include <poll.h>
#include <sys/eventfd.h>
#include <sys/socket.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <chrono>
#include <condition_variable>
#include <cstdint>
#include <cstring>
#include <deque>
#include <map>
#include <mutex>
#include <optional>
#include <thread>
#include <utility>
#include <vector>

#include "absl/strings/numbers.h"
#include "absl/strings/str_cat.h"

namespace planish {
namespace {

using Clock = std::chrono::steady_clock;

constexpr int kThreads = 2;
constexpr std::size_t kMostRequestBytes = 8192;
constexpr int kBacklog = 128;
// Pause in accepting after the process ran out of descriptors.
constexpr std::chrono::milliseconds kAcceptPause(200);
constexpr std::chrono::seconds kLongestPoll(60);

// The stream from which cpp-httplib reads a request, and to which it writes the answer.
class MemoryStream : public httplib::Stream {
 public:
  explicit MemoryStream(std::string request) : request_(std::move(request)) {}

  std::string TakeAnswer() { return std::move(answer_); }

  bool is_readable() const override { return taken_ < request_.size(); }
  bool is_writable() const override { return true; }
  ssize_t read(char* data, std::size_t size) override {
    const std::size_t count = std::min(size, request_.size() - taken_);
    std::copy_n(request_.data() + taken_, count, data);
    taken_ += count;
    return static_cast<ssize_t>(count);
  }
  ssize_t write(const char* data, std::size_t size) override {
    answer_.append(data, size);
    return static_cast<ssize_t>(size);
  }
  // Callers are not distinguished by address.
  void get_remote_ip_and_port(std::string&, int&) const override {}
  void get_local_ip_and_port(std::string&, int&) const override {}
  socket_t socket() const override { return INVALID_SOCKET; }
  using httplib::Stream::write;

 private:
  const std::string request_;
  std::size_t taken_ = 0;
  std::string answer_;
};

}  // namespace

// One thread moves bytes for all connections. The threads that compute answers see complete requests only, so a
// connection that sends or reads nothing does not delay others. cpp-httplib parses requests and writes answers; its own
// threads would queue any number of connections, and would wait for each of them.
class HttpEndpoint::Server : public httplib::Server {
 public:
  Server(HttpEndpoint::Handler handler, const HttpEndpointOptions& options)
      : handler_(std::move(handler)), options_(options), wake_(eventfd(0, EFD_CLOEXEC | EFD_NONBLOCK)) {
    // The default of cpp-httplib would let two servers share the port, each getting some of the connections.
    set_socket_options([](socket_t socket) {
      const int yes = 1;
      setsockopt(socket, SOL_SOCKET, SO_REUSEADDR, &yes, sizeof yes);
    });
    set_payload_max_length(0);
    // Runs before cpp-httplib's own routing, which reads bodies and matches paths as regular expressions.
    set_pre_routing_handler([this](const httplib::Request& request, httplib::Response& response) {
      if (request.method != "GET" && request.method != "HEAD") {
        response.status = 405;
        response.set_header("Allow", "GET, HEAD");
        return HandlerResponse::Handled;
      }
      HttpAnswer answer = handler_(request.path);
      response.status = answer.status;
      response.set_header("Cache-Control", "no-store");
      response.set_content(std::move(answer.text), answer.content_type);
      return HandlerResponse::Handled;
    });
  }

  ~Server() override {
    {
      const std::lock_guard lock(mutex_);
      ending_ = true;
    }
    changed_.notify_all();
    eventfd_write(wake_, 1);
    for (std::thread& thread : threads_) thread.join();
    for (const auto& [number, connection] : connections_) close(connection.socket);
    if (svr_sock_ != INVALID_SOCKET) close(svr_sock_);
    close(wake_);
  }

  void Run() {
    ::listen(svr_sock_, kBacklog);  // cpp-httplib used a backlog of 5
    fcntl(svr_sock_, F_SETFL, fcntl(svr_sock_, F_GETFL) | O_NONBLOCK);
    threads_.emplace_back([this] { MoveBytes(); });
    for (int i = 0; i < kThreads; ++i) {
      threads_.emplace_back([this] { AnswerRequests(); });
    }
  }

 private:
  enum class Phase { kReading, kAnswering, kWriting };

  struct Connection {
    int socket = -1;
    Phase phase = Phase::kReading;
    Clock::time_point request_by, close_by;
    std::string bytes;     // the request as far as it has arrived, then the answer
    std::size_t sent = 0;  // bytes of the answer that were sent
  };
  using Connections = std::map<std::uint64_t, Connection>;  // by number, so the oldest comes first

  // ---- the thread that moves bytes

  void MoveBytes() {
    while (!IsEnding()) {
      std::vector<pollfd> files = {{wake_, POLLIN, 0}};
      std::vector<std::uint64_t> numbers = {0};
      Clock::time_point next = Clock::now() + kLongestPoll;
      for (const auto& [number, connection] : connections_) {
        next = std::min(next, DeadlineOf(connection));
        if (connection.phase == Phase::kAnswering) continue;
        const short events = connection.phase == Phase::kReading ? POLLIN : POLLOUT;
        files.push_back({connection.socket, events, 0});
        numbers.push_back(number);
      }
      const bool accepts = Clock::now() >= accept_from_ && (HasRoom() || ToGiveWay() != connections_.end());
      if (accepts) files.push_back({svr_sock_, POLLIN, 0});
      if (Clock::now() < accept_from_) next = std::min(next, accept_from_);
      const auto wait = std::chrono::ceil<std::chrono::milliseconds>(next - Clock::now()).count();
      poll(files.data(), files.size(), static_cast<int>(std::max<std::int64_t>(wait, 0)));
      for (std::size_t i = 1; i < numbers.size(); ++i) {
        if (files[i].revents != 0) Move(connections_.find(numbers[i]));
      }
      TakeAnswers();
      CloseOverdue();
      if (accepts && files.back().revents != 0) AcceptAll();
    }
  }

  static Clock::time_point DeadlineOf(const Connection& connection) {
    return connection.phase == Phase::kReading ? std::min(connection.request_by, connection.close_by)
                                               : connection.close_by;
  }

  bool HasRoom() const { return static_cast<int>(connections_.size()) < options_.connections; }

  // The connection to close for a new one: the oldest that has not sent its request or, if there is none, has not read
  // its answer.
  Connections::iterator ToGiveWay() {
    for (const Phase phase : {Phase::kReading, Phase::kWriting}) {
      const auto found = std::find_if(connections_.begin(), connections_.end(),
                                      [phase](const auto& each) { return each.second.phase == phase; });
      if (found != connections_.end()) return found;
    }
    return connections_.end();
  }

  void AcceptAll() {
    for (int i = 0; i < kBacklog; ++i) {
      if (!HasRoom() && ToGiveWay() == connections_.end()) return;
      const int socket = accept4(svr_sock_, nullptr, nullptr, SOCK_NONBLOCK | SOCK_CLOEXEC);
      if (socket < 0) {
        const bool is_none = errno == EAGAIN || errno == ECONNABORTED || errno == EINTR;
        if (!is_none) accept_from_ = Clock::now() + kAcceptPause;
        return;
      }
      if (!HasRoom()) Close(ToGiveWay());
      Connection& connection = connections_[++last_number_];
      connection.socket = socket;
      connection.request_by = Clock::now() + absl::ToChronoNanoseconds(options_.request_limit);
      connection.close_by = Clock::now() + absl::ToChronoNanoseconds(options_.connection_limit);
      Move(connections_.find(last_number_));  // most requests have already arrived
    }
  }

  // Reads or writes as much as is possible without waiting.
  void Move(Connections::iterator found) {
    Connection& connection = found->second;
    if (connection.phase == Phase::kReading && !Read(&connection)) return Close(found);
    if (connection.phase == Phase::kReading && IsComplete(connection.bytes)) {
      connection.phase = Phase::kAnswering;
      const std::lock_guard lock(mutex_);
      requests_.emplace_back(found->first, std::exchange(connection.bytes, {}));
      changed_.notify_one();
    }
    if (connection.phase == Phase::kWriting && !Write(&connection)) Close(found);
  }

  // Reads what has arrived. False if the other side has closed, or the connection failed.
  static bool Read(Connection* connection) {
    char bytes[2048];
    while (connection->bytes.size() < kMostRequestBytes) {
      const std::size_t most = std::min(sizeof bytes, kMostRequestBytes - connection->bytes.size());
      const ssize_t got = recv(connection->socket, bytes, most, 0);
      if (got < 0 && errno == EINTR) continue;
      if (got < 0) return errno == EAGAIN;
      if (got == 0) return false;
      connection->bytes.append(bytes, static_cast<std::size_t>(got));
    }
    return true;
  }

  // Writes as much as possible. False if everything is written, or the connection failed.
  static bool Write(Connection* connection) {
    while (connection->sent < connection->bytes.size()) {
      const ssize_t count = send(connection->socket, connection->bytes.data() + connection->sent,
                                 connection->bytes.size() - connection->sent, MSG_NOSIGNAL);
      if (count < 0 && errno == EINTR) continue;
      if (count < 0) return errno == EAGAIN;
      connection->sent += static_cast<std::size_t>(count);
    }
    return false;
  }

  // A request that is too long counts as complete: the parser refuses it.
  static bool IsComplete(const std::string& request) {
    return request.size() >= kMostRequestBytes || request.find("\r\n\r\n") != std::string::npos;
  }

  void TakeAnswers() {
    eventfd_t count = 0;
    eventfd_read(wake_, &count);
    std::vector<std::pair<std::uint64_t, std::string>> answers;
    {
      const std::lock_guard lock(mutex_);
      answers.swap(answers_);
    }
    for (auto& [number, answer] : answers) {
      const auto found = connections_.find(number);
      if (found == connections_.end()) continue;  // closed meanwhile
      found->second.phase = Phase::kWriting;
      found->second.bytes = std::move(answer);
      Move(found);
    }
  }

  void CloseOverdue() {
    const Clock::time_point now = Clock::now();
    for (auto connection = connections_.begin(); connection != connections_.end();) {
      const auto next = std::next(connection);
      if (DeadlineOf(connection->second) <= now) Close(connection);
      connection = next;
    }
  }

  void Close(Connections::iterator found) {
    if (found->second.phase == Phase::kAnswering) {
      const std::lock_guard lock(mutex_);
      std::erase_if(requests_, [&](const auto& request) { return request.first == found->first; });
    }
    shutdown(found->second.socket, SHUT_RDWR);
    close(found->second.socket);
    connections_.erase(found);
  }

  // ---- the threads that answer

  bool IsEnding() {
    const std::lock_guard lock(mutex_);
    return ending_;
  }

  void AnswerRequests() {
    std::unique_lock lock(mutex_);
    for (;;) {
      changed_.wait(lock, [this] { return ending_ || !requests_.empty(); });
      if (ending_) return;
      auto [number, request] = std::move(requests_.front());
      requests_.pop_front();
      lock.unlock();
      MemoryStream stream(std::move(request));
      bool closed = false;
      process_request(stream, /*close_connection=*/true, closed, nullptr);
      lock.lock();
      answers_.emplace_back(number, stream.TakeAnswer());
      eventfd_write(wake_, 1);
    }
  }

  const HttpEndpoint::Handler handler_;
  const HttpEndpointOptions options_;
  const int wake_;
  std::vector<std::thread> threads_;

  // Used only by the thread that moves bytes.
  Connections connections_;
  std::uint64_t last_number_ = 0;
  Clock::time_point accept_from_;

  std::mutex mutex_;
  std::condition_variable changed_;
  // Guarded by mutex_. Requests and answers are paired with the number of their connection.
  std::deque<std::pair<std::uint64_t, std::string>> requests_;
  std::vector<std::pair<std::uint64_t, std::string>> answers_;
  bool ending_ = false;
};

absl::StatusOr<HttpEndpointOptions> ParseHttpAddress(const std::string& text) {
  HttpEndpointOptions options;
  const std::size_t colon = text.rfind(':');
  if (colon == std::string::npos || colon == 0 || !absl::SimpleAtoi(text.substr(colon + 1), &options.port) ||
      options.port < 0 || options.port > 65535) {
    return absl::InvalidArgumentError(absl::StrCat(text, ": not HOST:PORT"));
  }
  options.host = text.substr(0, colon);
  if (options.host.front() == '[' && options.host.back() == ']') {
    options.host = options.host.substr(1, options.host.size() - 2);
  } else if (options.host.find(':') != std::string::npos) {
    return absl::InvalidArgumentError(absl::StrCat(text, ": an IPv6 address goes into brackets, as in [::1]:9741"));
  }
  if (options.host.empty()) return absl::InvalidArgumentError(absl::StrCat(text, ": not HOST:PORT"));
  return options;
}

HttpEndpoint::HttpEndpoint() = default;
HttpEndpoint::~HttpEndpoint() = default;

absl::StatusOr<std::unique_ptr<HttpEndpoint>> HttpEndpoint::Start(const HttpEndpointOptions& options, Handler handler) {
  std::unique_ptr<HttpEndpoint> endpoint(new HttpEndpoint);
  endpoint->server_ = std::make_unique<Server>(std::move(handler), options);
  errno = 0;
  int port = options.port;
  if (port == 0) {
    port = endpoint->server_->bind_to_any_port(options.host);
  } else if (!endpoint->server_->bind_to_port(options.host, port)) {
    port = -1;
  }
  const bool is_ipv6 = options.host.find(':') != std::string::npos;
  const std::string host = is_ipv6 ? absl::StrCat("[", options.host, "]") : options.host;
  if (port < 0) {
    const std::string why = errno != 0 ? std::strerror(errno) : "unknown host";
    return absl::UnavailableError(absl::StrCat("cannot listen on ", host, ":", options.port, ": ", why));
  }
  endpoint->address_ = absl::StrCat(host, ":", port);
  endpoint->server_->Run();
  return endpoint;
}

}  // namespace planish
