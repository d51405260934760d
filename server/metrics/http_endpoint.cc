#include "server/metrics/http_endpoint.h"

#include <fcntl.h>
#include <httplib.h>
#include <poll.h>
#include <sys/socket.h>
#include <unistd.h>

#include <atomic>
#include <cerrno>
#include <cstring>
#include <thread>
#include <utility>
#include <vector>

#include "absl/strings/numbers.h"
#include "absl/strings/str_cat.h"
#include "absl/time/clock.h"
#include "server/metrics/deadline_stream.h"

namespace planish {
namespace {

constexpr int kThreads = 2;
constexpr std::size_t kMostRequestBytes = 8192;
// How often a thread that waits for a connection looks whether it shall end.
constexpr int kLookMs = 200;

}  // namespace

// cpp-httplib reads requests and writes answers. Connections are taken here: its own threads queue any number of them
// and wait for each byte anew.
class HttpEndpoint::Server : public httplib::Server {
 public:
  Server(HttpEndpoint::Handler handler, absl::Duration connection_limit)
      : handler_(std::move(handler)), connection_limit_(connection_limit) {
    // Its default would let two servers share the port, each with some of the connections.
    set_socket_options([](socket_t socket) {
      const int yes = 1;
      setsockopt(socket, SOL_SOCKET, SO_REUSEADDR, &yes, sizeof yes);
    });
    set_payload_max_length(0);
    // Before its own routing, which reads bodies and matches paths as regular expressions.
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
    ending_ = true;
    for (std::thread& thread : threads_) thread.join();
    if (svr_sock_ != INVALID_SOCKET) close(svr_sock_);
  }

  void Run() {
    for (int i = 0; i < kThreads; ++i) {
      threads_.emplace_back([this] { TakeConnections(); });
    }
  }

 private:
  void TakeConnections() {
    // Both threads may see the same connection come; one of them gets it.
    fcntl(svr_sock_, F_SETFL, fcntl(svr_sock_, F_GETFL) | O_NONBLOCK);
    while (!ending_) {
      pollfd wait = {svr_sock_, POLLIN, 0};
      if (poll(&wait, 1, kLookMs) <= 0) continue;
      const int socket = accept4(svr_sock_, nullptr, nullptr, SOCK_NONBLOCK | SOCK_CLOEXEC);
      if (socket < 0) {
        // Out of descriptors, perhaps: not to be tried again at once.
        if (errno != EAGAIN && errno != ECONNABORTED && errno != EINTR) {
          std::this_thread::sleep_for(std::chrono::milliseconds(kLookMs));
        }
        continue;
      }
      Serve(socket);
      shutdown(socket, SHUT_RDWR);
      close(socket);
    }
  }

  void Serve(int socket) {
    DeadlineStream stream(socket, absl::Now() + connection_limit_, kMostRequestBytes, &ending_);
    bool closed = false;
    process_request(stream, /*close_connection=*/true, closed, nullptr);
  }

  const HttpEndpoint::Handler handler_;
  const absl::Duration connection_limit_;
  std::atomic<bool> ending_ = false;
  std::vector<std::thread> threads_;
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
  endpoint->server_ = std::make_unique<Server>(std::move(handler), options.connection_limit);
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
