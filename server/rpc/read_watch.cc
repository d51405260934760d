#include "server/rpc/read_watch.h"

#include <arpa/inet.h>
#include <dirent.h>
#include <linux/tcp.h>
#include <netinet/in.h>
#include <sys/socket.h>

#include <chrono>
#include <cstdlib>
#include <memory>
#include <utility>

#include "absl/strings/match.h"
#include "absl/strings/str_cat.h"

namespace planish {
namespace {

constexpr std::chrono::milliseconds kLookInterval(5);

// Bytes that a connection may receive in addition to messages.
constexpr std::int64_t kConnectionSlack = std::int64_t{1} << 20;

// Bytes on the wire for a message of at most `limit` bytes, with headers and the frames of HTTP/2 and TLS.
std::int64_t OnTheWire(std::int64_t limit) {
  constexpr std::int64_t kHeaders = std::int64_t{16} << 10;
  return limit + limit / 8 + kHeaders;
}

// The peer of a TCP connection, in the form of grpc::ServerContext::peer(); empty for other descriptors.
std::string PeerOf(int descriptor) {
  sockaddr_storage address = {};
  socklen_t size = sizeof(address);
  if (getpeername(descriptor, reinterpret_cast<sockaddr*>(&address), &size) != 0) return "";
  char text[INET6_ADDRSTRLEN] = {};
  if (address.ss_family == AF_INET) {
    const auto& v4 = reinterpret_cast<const sockaddr_in&>(address);
    inet_ntop(AF_INET, &v4.sin_addr, text, sizeof(text));
    return absl::StrCat("ipv4:", text, ":", ntohs(v4.sin_port));
  }
  if (address.ss_family != AF_INET6) return "";
  const auto& v6 = reinterpret_cast<const sockaddr_in6&>(address);
  if (IN6_IS_ADDR_V4MAPPED(&v6.sin6_addr)) {
    inet_ntop(AF_INET, &v6.sin6_addr.s6_addr[12], text, sizeof(text));
    return absl::StrCat("ipv4:", text, ":", ntohs(v6.sin6_port));
  }
  inet_ntop(AF_INET6, &v6.sin6_addr, text, sizeof(text));
  return absl::StrCat("ipv6:%5B", text, "%5D:", ntohs(v6.sin6_port));
}

// The descriptor of the TCP connection to `peer`, or -1.
int FindDescriptor(const std::string& peer) {
  if (!absl::StartsWith(peer, "ipv")) return -1;
  const std::unique_ptr<DIR, int (*)(DIR*)> folder(opendir("/proc/self/fd"), closedir);
  if (folder == nullptr) return -1;
  while (const dirent* entry = readdir(folder.get())) {
    if (entry->d_name[0] == '.') continue;
    const int descriptor = std::atoi(entry->d_name);
    if (PeerOf(descriptor) == peer) return descriptor;
  }
  return -1;
}

std::int64_t BytesReceived(int descriptor) {
  tcp_info info = {};
  socklen_t size = sizeof(info);
  if (getsockopt(descriptor, IPPROTO_TCP, TCP_INFO, &info, &size) != 0) return 0;
  return static_cast<std::int64_t>(info.tcpi_bytes_received);
}

}  // namespace

ReadWatch::ReadWatch() : thread_([this] { Run(); }) {}

ReadWatch::~ReadWatch() {
  {
    const std::lock_guard lock(mutex_);
    ending_ = true;
  }
  changed_.notify_all();
  thread_.join();
}

void ReadWatch::AddCall(const std::string& peer) {
  const std::lock_guard lock(mutex_);
  ++connections_[peer].calls;
}

void ReadWatch::RemoveCall(const std::string& peer) {
  const std::lock_guard lock(mutex_);
  const auto found = connections_.find(peer);
  if (--found->second.calls == 0 && found->second.reads.empty()) connections_.erase(found);
}

void ReadWatch::Begin(const void* read, const std::string& peer, std::int64_t limit, std::function<void()> stop) {
  {
    const std::lock_guard lock(mutex_);
    Connection& connection = connections_[peer];
    connection.reads[read] = {limit, std::move(stop)};
    connection.allowed += OnTheWire(limit);
    if (reads_++ > 0) return;
  }
  changed_.notify_all();
}

void ReadWatch::End(const void* read, const std::string& peer, std::int64_t bytes) {
  Read ended;  // destroyed after the lock is released
  const std::lock_guard lock(mutex_);
  const auto found = connections_.find(peer);
  if (found == connections_.end()) return;
  Connection& connection = found->second;
  const auto at = connection.reads.find(read);
  if (at == connection.reads.end()) return;
  ended = std::move(at->second);
  connection.reads.erase(at);
  connection.allowed -= OnTheWire(ended.limit) - OnTheWire(bytes);
  --reads_;
  if (!connection.reads.empty()) return;
  // The next read starts counting from zero.
  connection = {connection.calls, {}, 0, std::nullopt, 0};
  if (connection.calls == 0) connections_.erase(found);
}

void ReadWatch::Run() {
  std::unique_lock lock(mutex_);
  while (true) {
    changed_.wait(lock, [this] { return ending_ || reads_ > 0; });
    changed_.wait_for(lock, kLookInterval, [this] { return ending_; });
    if (ending_) return;
    std::map<const void*, Read> too_long;
    for (auto& [peer, connection] : connections_) Look(peer, &connection, &too_long);
    std::erase_if(connections_,
                  [](const auto& entry) { return entry.second.calls == 0 && entry.second.reads.empty(); });
    lock.unlock();
    for (const auto& [read, what] : too_long) what.stop();
    too_long.clear();
    lock.lock();
  }
}

void ReadWatch::Look(const std::string& peer, Connection* connection, std::map<const void*, Read>* too_long) {
  if (connection->reads.empty()) return;
  if (!connection->descriptor.has_value()) {
    connection->descriptor = FindDescriptor(peer);
    if (*connection->descriptor >= 0) connection->received = BytesReceived(*connection->descriptor);
    return;
  }
  if (*connection->descriptor < 0) return;
  const std::int64_t received = BytesReceived(*connection->descriptor) - connection->received;
  const std::int64_t allowed = connection->allowed + connection->calls * kLookaheadBytes + kConnectionSlack;
  if (received <= allowed) return;
  // The descriptor's number may have been reused for another connection.
  if (PeerOf(*connection->descriptor) != peer) {
    connection->descriptor = -1;
    return;
  }
  reads_ -= static_cast<int>(connection->reads.size());
  too_long->merge(connection->reads);
  connection->reads.clear();
  *connection = {connection->calls, {}, 0, std::nullopt, 0};
}

}  // namespace planish
