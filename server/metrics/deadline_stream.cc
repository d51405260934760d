#include "server/metrics/deadline_stream.h"

#include <poll.h>
#include <sys/socket.h>

#include <algorithm>
#include <cerrno>

#include "absl/time/clock.h"

namespace planish {
namespace {

// How late an end is noticed.
constexpr absl::Duration kLookInterval = absl::Milliseconds(100);

}  // namespace

bool DeadlineStream::WaitFor(short events) const {
  while (!ending_) {
    const absl::Duration left = deadline_ - absl::Now();
    if (left <= absl::ZeroDuration()) return false;
    pollfd wait = {socket_, events, 0};
    const int ready = poll(&wait, 1, static_cast<int>(absl::ToInt64Milliseconds(std::min(left, kLookInterval))) + 1);
    if (ready > 0) return true;
    if (ready < 0 && errno != EINTR) return false;
  }
  return false;
}

bool DeadlineStream::Fill() {
  char bytes[1024];
  const std::size_t most = std::min(sizeof bytes, left_to_read_);
  if (most == 0 || !WaitFor(POLLIN)) return false;
  const ssize_t got = recv(socket_, bytes, most, 0);
  if (got <= 0) return false;
  buffer_.assign(bytes, static_cast<std::size_t>(got));
  taken_ = 0;
  left_to_read_ -= static_cast<std::size_t>(got);
  return true;
}

bool DeadlineStream::is_readable() const {
  return taken_ < buffer_.size() || WaitFor(POLLIN);
}

bool DeadlineStream::is_writable() const {
  return WaitFor(POLLOUT);
}

ssize_t DeadlineStream::read(char* data, std::size_t size) {
  if (taken_ == buffer_.size() && !Fill()) return -1;
  const std::size_t count = std::min(size, buffer_.size() - taken_);
  std::copy_n(buffer_.data() + taken_, count, data);
  taken_ += count;
  return static_cast<ssize_t>(count);
}

ssize_t DeadlineStream::write(const char* data, std::size_t size) {
  std::size_t sent = 0;
  while (sent < size) {
    if (!WaitFor(POLLOUT)) return -1;
    const ssize_t count = send(socket_, data + sent, size - sent, MSG_NOSIGNAL);
    if (count < 0 && errno != EAGAIN && errno != EINTR) return -1;
    if (count > 0) sent += static_cast<std::size_t>(count);
  }
  return static_cast<ssize_t>(sent);
}

// Nobody is told apart by address.
void DeadlineStream::get_remote_ip_and_port(std::string&, int&) const {}
void DeadlineStream::get_local_ip_and_port(std::string&, int&) const {}

}  // namespace planish
