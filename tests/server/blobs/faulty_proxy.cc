#include "tests/server/blobs/faulty_proxy.h"

#include <arpa/inet.h>
#include <netinet/in.h>
#include <sys/socket.h>
#include <unistd.h>

#include <algorithm>
#include <cctype>
#include <stdexcept>
#include <string>
#include <string_view>

namespace planish {
namespace {

sockaddr_in Loopback(int port) {
  sockaddr_in address = {};
  address.sin_family = AF_INET;
  address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
  address.sin_port = htons(static_cast<std::uint16_t>(port));
  return address;
}

bool SendAll(int fd, std::string_view bytes) {
  while (!bytes.empty()) {
    const ssize_t count = send(fd, bytes.data(), bytes.size(), MSG_NOSIGNAL);
    if (count <= 0) return false;
    bytes.remove_prefix(static_cast<std::size_t>(count));
  }
  return true;
}

// False at the end.
bool ReadMore(int fd, std::string* bytes) {
  char buffer[65536];
  const ssize_t count = read(fd, buffer, sizeof(buffer));
  if (count > 0) bytes->append(buffer, static_cast<std::size_t>(count));
  return count > 0;
}

// Removes the header line `name` (in lower case) from a request's head and returns its value.
std::string TakeHeader(std::string* head, std::string_view name) {
  std::string lower = *head;
  std::transform(lower.begin(), lower.end(), lower.begin(), [](unsigned char c) { return std::tolower(c); });
  const std::size_t begin = lower.find("\r\n" + std::string(name) + ":");
  if (begin == std::string::npos) return "";
  const std::size_t end = head->find("\r\n", begin + 2);
  const std::string value = head->substr(begin + name.size() + 3, end - begin - name.size() - 3);
  head->erase(begin, end - begin);
  return value;
}

}  // namespace

FaultyProxy::FaultyProxy(int server_port) : server_port_(server_port) {
  listener_ = socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0);
  sockaddr_in address = Loopback(0);
  socklen_t size = sizeof(address);
  if (bind(listener_, reinterpret_cast<sockaddr*>(&address), size) != 0 || listen(listener_, 64) != 0 ||
      getsockname(listener_, reinterpret_cast<sockaddr*>(&address), &size) != 0) {
    throw std::runtime_error("cannot listen on loopback");
  }
  port_ = ntohs(address.sin_port);
  listening_ = std::thread([this] { Listen(); });
}

FaultyProxy::~FaultyProxy() {
  shutdown(listener_, SHUT_RDWR);
  listening_.join();
  close(listener_);
  for (std::thread& thread : serving_) thread.join();
}

void FaultyProxy::Next(std::vector<HttpFault> faults) {
  const std::lock_guard lock(mutex_);
  faults_.assign(faults.begin(), faults.end());
}

std::string FaultyProxy::last_request() {
  const std::lock_guard lock(mutex_);
  return last_request_;
}

HttpFault FaultyProxy::Take() {
  ++requests_;
  const std::lock_guard lock(mutex_);
  if (faults_.empty()) return HttpFault::kNone;
  const HttpFault fault = faults_.front();
  faults_.pop_front();
  return fault;
}

void FaultyProxy::Listen() {
  for (;;) {
    const int client = accept(listener_, nullptr, nullptr);
    if (client < 0) return;
    const std::lock_guard lock(mutex_);
    serving_.emplace_back([this, client] {
      Serve(client);
      close(client);
    });
  }
}

// One request each connection.
void FaultyProxy::Serve(int client) {
  std::string head;
  std::size_t end = std::string::npos;
  while ((end = head.find("\r\n\r\n")) == std::string::npos) {
    if (!ReadMore(client, &head)) return;
  }
  std::string body = head.substr(end + 4);
  head.resize(end + 2);
  const HttpFault fault = Take();
  if (!TakeHeader(&head, "expect").empty()) SendAll(client, "HTTP/1.1 100 Continue\r\n\r\n");
  std::string copy = head;
  const std::string length = TakeHeader(&copy, "content-length");
  const std::size_t size = length.empty() ? 0 : std::stoul(length);
  while (body.size() < size) {
    if (!ReadMore(client, &body)) return;
  }
  {
    const std::lock_guard lock(mutex_);
    last_request_ = head + "\r\n" + body;
  }
  if (fault == HttpFault::kRefuse) {
    SendAll(client, "HTTP/1.1 503 Slow Down\r\nContent-Length: 0\r\nConnection: close\r\n\r\n");
    return;
  }
  std::string rest;
  if (fault == HttpFault::kSilence) {
    while (ReadMore(client, &rest)) {
    }
    return;
  }
  if (fault == HttpFault::kWrongUpload && !body.empty()) body.back() = static_cast<char>(~body.back());

  const int server = socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0);
  const sockaddr_in address = Loopback(server_port_);
  std::string answer;
  TakeHeader(&head, "connection");
  if (connect(server, reinterpret_cast<const sockaddr*>(&address), sizeof(address)) == 0 &&
      SendAll(server, head + "Connection: close\r\n\r\n" + body)) {
    while (ReadMore(server, &answer)) {
    }
  }
  close(server);
  if (fault == HttpFault::kLoseAnswer || answer.empty()) return;
  if (fault == HttpFault::kCutAnswer) answer.resize(std::max(answer.size() * 3 / 4, std::size_t{1}));
  if (fault == HttpFault::kWrongAnswer) answer.back() = static_cast<char>(~answer.back());
  SendAll(client, answer);
}

}  // namespace planish
