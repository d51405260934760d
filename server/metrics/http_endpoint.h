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
  // Time limits of a connection, from its acceptance to the end of its request, and to the last byte of its answer. A
  // connection that takes longer is closed.
  absl::Duration request_limit = absl::Seconds(5);
  absl::Duration connection_limit = absl::Seconds(10);
  // Concurrent connections. Beyond this number, the oldest one that has not sent its request is closed for a new one.
  int connections = 64;
};

// Parses "HOST:PORT" or "[IPV6]:PORT". INVALID_ARGUMENT with a message that names `text`.
absl::StatusOr<HttpEndpointOptions> ParseHttpAddress(const std::string& text);

// Silent or slow connections do not delay others: two threads answer requests once they are complete. A request may
// have 8 KiB and no body.
class HttpEndpoint {
 public:
  // Called on the endpoint's threads with a path without its query. Returns status 404 for paths that are not served.
  using Handler = std::function<HttpAnswer(const std::string& path)>;

  // Begins to serve. UNAVAILABLE if the address cannot be used; the message has the address and the reason.
  static absl::StatusOr<std::unique_ptr<HttpEndpoint>> Start(const HttpEndpointOptions& options, Handler handler);

  // Closes all connections.
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
