#include "server/metrics/http_endpoint.h"

#include <arpa/inet.h>
#include <netinet/in.h>
#include <poll.h>
#include <sys/socket.h>
#include <unistd.h>

#include <thread>
#include <vector>

#include "absl/time/clock.h"
#include "gmock/gmock.h"
#include "gtest/gtest.h"
#include "tests/testing/http_get.h"

namespace planish {
namespace {

using ::testing::HasSubstr;
using ::testing::StartsWith;

HttpAnswer Echo(const std::string& path) {
  if (path == "/large") return {200, std::string(10 << 20, 'x')};
  if (path == "/metrics") return {200, "planish 1\n"};
  if (path == "/sick") return {503, "the store cannot be written\n"};
  return {404, "nothing here\n"};
}

class HttpEndpointTest : public ::testing::Test {
 protected:
  void SetUp() override { Start(absl::Minutes(1)); }

  void Start(absl::Duration connection_limit, int connections = 64) {
    absl::StatusOr<HttpEndpointOptions> options = ParseHttpAddress("127.0.0.1:0");
    ASSERT_TRUE(options.ok());
    options->request_limit = options->connection_limit = connection_limit;
    options->connections = connections;
    auto endpoint = HttpEndpoint::Start(*options, Echo);
    ASSERT_TRUE(endpoint.ok()) << endpoint.status();
    endpoint_ = *std::move(endpoint);
    port_ = std::stoi(endpoint_->address().substr(endpoint_->address().rfind(':') + 1));
  }

  // A connection that is open and silent.
  int Connect() const {
    const int socket = ::socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0);
    sockaddr_in address = {};
    address.sin_family = AF_INET;
    address.sin_port = htons(static_cast<std::uint16_t>(port_));
    address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
    EXPECT_EQ(connect(socket, reinterpret_cast<const sockaddr*>(&address), sizeof address), 0);
    return socket;
  }

  // What comes back for `bytes`, until the server closes.
  std::string Raw(const std::string& bytes) const {
    const int socket = Connect();
    [[maybe_unused]] const ssize_t sent = send(socket, bytes.data(), bytes.size(), MSG_NOSIGNAL);
    std::string answer(4096, '\0');
    const ssize_t got = recv(socket, answer.data(), answer.size(), 0);
    answer.resize(got > 0 ? static_cast<std::size_t>(got) : 0);
    close(socket);
    return answer;
  }

  std::string Server() const { return "http://127.0.0.1:" + std::to_string(port_); }
  HttpReply Get(const std::string& path) const { return HttpGet(Server(), path); }

  std::unique_ptr<HttpEndpoint> endpoint_;
  int port_ = 0;
};

TEST_F(HttpEndpointTest, AnswersGetAndHead) {
  const HttpReply answer = Get("/metrics?name=x");
  EXPECT_EQ(answer.status, 200);
  EXPECT_EQ(answer.body, "planish 1\n");
  EXPECT_THAT(answer.headers, ::testing::Contains(::testing::Pair("Cache-Control", "no-store")));
  const HttpReply sick = Get("/sick");
  EXPECT_EQ(sick.status, 503);
  EXPECT_EQ(sick.body, "the store cannot be written\n");
  EXPECT_EQ(Get("/other").status, 404);
  const HttpReply head = HttpHead(Server(), "/metrics");
  EXPECT_EQ(head.status, 200);
  EXPECT_EQ(head.body, "");
  EXPECT_EQ(Get("/large").body.size(), 10 << 20);
}

TEST_F(HttpEndpointTest, RefusesWhatIsNoQuestion) {
  EXPECT_THAT(Raw("POST /metrics HTTP/1.1\r\nHost: a\r\nContent-Length: 3\r\n\r\nabc"), StartsWith("HTTP/1.1 405"));
  EXPECT_THAT(Raw("BREW /pot HTCPCP/1.0\r\n\r\n"), StartsWith("HTTP/1.1 400"));
  EXPECT_THAT(Raw(std::string("GET /../../etc/passwd HTTP/1.1\r\n\r\n")), StartsWith("HTTP/1.1 404"));
}

TEST_F(HttpEndpointTest, EndlessHeadersEnd) {
  std::string request = "GET /metrics HTTP/1.1\r\n";
  while (request.size() < 100'000) request += "X-" + std::to_string(request.size()) + ": 1\r\n";
  const absl::Time start = absl::Now();
  EXPECT_THAT(Raw(request), ::testing::Not(HasSubstr("200 OK")));
  EXPECT_LT(absl::Now() - start, absl::Seconds(5));
  // Regular expressions look at this one.
  Raw("GET /metrics HTTP/1.1\r\nRange: bytes=" + std::string(8000, '1') + "-\r\n\r\n");
  EXPECT_EQ(Get("/metrics").status, 200) << "it is still there";
}

// Whether the server has closed the connection; waits up to a second.
bool IsClosed(int socket) {
  pollfd wait = {socket, POLLIN, 0};
  char byte = 0;
  return poll(&wait, 1, 1000) > 0 && recv(socket, &byte, 1, MSG_DONTWAIT) <= 0;
}

// Each of them has a minute.
TEST_F(HttpEndpointTest, SilentAndHalfDeafCallersHoldUpNobody) {
  std::vector<int> slow;
  for (int i = 0; i < 20; ++i) {
    slow.push_back(Connect());
    const std::string request = i % 3 == 0 ? "GET /metr" : i % 3 == 1 ? "GET /large HTTP/1.1\r\nHost: a\r\n\r\n" : "";
    ASSERT_EQ(send(slow.back(), request.data(), request.size(), MSG_NOSIGNAL), static_cast<ssize_t>(request.size()));
  }
  EXPECT_EQ(Get("/metrics").status, 200);
  for (const int socket : slow) close(socket);
}

TEST_F(HttpEndpointTest, TheOldestSilentConnectionGivesWay) {
  Start(absl::Minutes(1), /*connections=*/8);
  std::vector<int> silent;
  for (int i = 0; i < 12; ++i) silent.push_back(Connect());
  EXPECT_EQ(Get("/metrics").status, 200);
  for (int i = 0; i < 5; ++i) EXPECT_TRUE(IsClosed(silent[static_cast<std::size_t>(i)])) << i;
  EXPECT_FALSE(IsClosed(silent.back())) << "there is room for seven beside the one that asked";
  for (const int socket : silent) close(socket);
}

TEST_F(HttpEndpointTest, SlowCallersAreCutOff) {
  Start(absl::Milliseconds(500));
  const int silent = Connect();
  EXPECT_TRUE(IsClosed(silent));
  close(silent);
}

// One byte now and then does not buy more time.
TEST_F(HttpEndpointTest, DripsAreNotWaitedFor) {
  Start(absl::Milliseconds(500));
  const int socket = Connect();
  const absl::Time start = absl::Now();
  // Until the server has closed, a write fails or what it answered is read.
  for (const char c : std::string(200, 'x')) {
    if (send(socket, &c, 1, MSG_NOSIGNAL) < 0) break;
    char answer = 0;
    timeval wait = {0, 50'000};
    setsockopt(socket, SOL_SOCKET, SO_RCVTIMEO, &wait, sizeof wait);
    if (recv(socket, &answer, 1, 0) >= 0) break;
  }
  EXPECT_LT(absl::Now() - start, absl::Seconds(5));
  close(socket);
}

TEST_F(HttpEndpointTest, EndsAtOnceWithConnectionsOpen) {
  const int silent = Connect();
  const absl::Time start = absl::Now();
  endpoint_.reset();
  EXPECT_LT(absl::Now() - start, absl::Seconds(3));
  close(silent);
}

TEST_F(HttpEndpointTest, PortsAreNotShared) {
  HttpEndpointOptions same;
  same.host = "127.0.0.1";
  same.port = port_;
  EXPECT_THAT(std::string(HttpEndpoint::Start(same, Echo).status().message()), HasSubstr("Address already in use"));
}

TEST(HttpAddress, IsHostAndPort) {
  EXPECT_EQ(ParseHttpAddress("0.0.0.0:9741")->port, 9741);
  EXPECT_EQ(ParseHttpAddress("[::1]:9741")->host, "::1");
  for (const char* bad : {"", "9741", ":9741", "host:", "host:x", "host:70000", "::1:9741", "unix:/tmp/x", "[]:1"}) {
    EXPECT_FALSE(ParseHttpAddress(bad).ok()) << bad;
  }
}

}  // namespace
}  // namespace planish
