// Answers GET and HEAD over plain HTTP, for scrapers and probes.
#pragma once

#include <functional>
#include <memory>
#include <string>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "absl/time/time.h"

namespace planish {

struct HttpAnswer {
  int status = 200;
  std::string text;
  std::string content_type = "text/plain; charset=utf-8";
};

struct HttpEndpointOptions {
  std::string host;
  int port = 0;  // 0: any
  // From the acceptance of a connection to the end of its request, and to the last byte of its answer. A connection
  // that takes longer is closed.
  absl::Duration request_limit = absl::Seconds(5);
  absl::Duration connection_limit = absl::Seconds(10);
  // At the same time. Beyond them the oldest connection that has not sent its request gives way to a new one.
  int connections = 64;
};

// "HOST:PORT" or "[IPV6]:PORT". INVALID_ARGUMENT with a message that names `text`.
absl::StatusOr<HttpEndpointOptions> ParseHttpAddress(const std::string& text);

// Connections that are silent or slow hold up nobody else: requests are answered by two threads once they are complete.
// A request may have 8 KiB and no body.
class HttpEndpoint {
 public:
  // Called on the endpoint's threads for a path without its query; nothing (status 404) for what is not served.
  using Handler = std::function<HttpAnswer(const std::string& path)>;

  // Answers from its return on. UNAVAILABLE with a message that names the address that cannot be had, and why.
  static absl::StatusOr<std::unique_ptr<HttpEndpoint>> Start(const HttpEndpointOptions& options, Handler handler);

  // Cuts off connections under way.
  ~HttpEndpoint();
  HttpEndpoint(const HttpEndpoint&) = delete;
  HttpEndpoint& operator=(const HttpEndpoint&) = delete;

  // "HOST:PORT", with the port that the system chose in place of 0.
  const std::string& address() const { return address_; }

 private:
  class Server;
  HttpEndpoint();

  std::string address_;
  std::unique_ptr<Server> server_;
};

}  // namespace planish
