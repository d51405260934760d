#include "server/link/frame_socket.h"

#include <poll.h>
#include <sys/eventfd.h>
#include <sys/socket.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <chrono>
#include <cstring>
#include <utility>

#include "absl/strings/str_cat.h"
#include "absl/time/clock.h"
#include "core/base/error.h"

namespace planish {
namespace {

using SteadyClock = std::chrono::steady_clock;

// A buffer for kMaxFrameDescriptors descriptors and the kernel's header.
struct ControlBuffer {
  alignas(cmsghdr) char bytes[CMSG_SPACE(kMaxFrameDescriptors * sizeof(int))];
};

// For poll(): milliseconds until `deadline`, rounded up; negative: for ever.
int MillisecondsLeft(bool forever, SteadyClock::time_point deadline) {
  if (forever) return -1;
  const auto left = std::chrono::ceil<std::chrono::milliseconds>(deadline - SteadyClock::now()).count();
  return static_cast<int>(std::clamp<std::int64_t>(left, 0, 3'600'000));
}

}  // namespace

absl::StatusOr<std::unique_ptr<FrameSocket>> FrameSocket::Make(Descriptor socket, const FrameLimits& limits) {
  Descriptor wake(eventfd(0, EFD_CLOEXEC | EFD_NONBLOCK));
  if (wake.get() < 0) {
    return MakeError(absl::StatusCode::kResourceExhausted, "OUT_OF_MEMORY",
                     absl::StrCat("eventfd: ", std::strerror(errno)));
  }
  return std::unique_ptr<FrameSocket>(new FrameSocket(std::move(socket), std::move(wake), limits));
}

void FrameSocket::Send(std::string_view bytes, std::vector<BlobPtr> blobs) {
  const std::uint32_t header[2] = {static_cast<std::uint32_t>(bytes.size()), static_cast<std::uint32_t>(blobs.size())};
  Outgoing outgoing;
  outgoing.bytes.reserve(sizeof(header) + bytes.size());
  outgoing.bytes.append(reinterpret_cast<const char*>(header), sizeof(header));
  outgoing.bytes.append(bytes);
  outgoing.blobs = std::move(blobs);

  const std::lock_guard lock(mutex_);
  if (closed_) return;
  unsent_bytes_ += outgoing.bytes.size();
  outbox_.push_back(std::move(outgoing));
  if (outbox_.size() == 1) Flush();
  if (outbox_.empty()) return;
  if (unsent_bytes_ > kMaxUnsentBytes) {
    Drop();
    shutdown(socket_.get(), SHUT_RDWR);
    return;
  }
  const std::uint64_t one = 1;
  // Fails only when the counter is full, and then the reader is awake anyway.
  [[maybe_unused]] const ssize_t written = write(wake_.get(), &one, sizeof(one));
}

void FrameSocket::Flush() {
  while (!outbox_.empty()) {
    Outgoing& next = outbox_.front();
    iovec part = {next.bytes.data() + next.sent, next.bytes.size() - next.sent};
    msghdr message = {};
    message.msg_iov = &part;
    message.msg_iovlen = 1;
    ControlBuffer control;
    if (next.sent == 0 && !next.blobs.empty()) {
      const std::size_t size = next.blobs.size() * sizeof(int);
      message.msg_control = control.bytes;
      message.msg_controllen = CMSG_SPACE(size);
      cmsghdr* const rights = CMSG_FIRSTHDR(&message);
      rights->cmsg_level = SOL_SOCKET;
      rights->cmsg_type = SCM_RIGHTS;
      rights->cmsg_len = CMSG_LEN(size);
      for (std::size_t i = 0; i < next.blobs.size(); ++i) {
        const int descriptor = next.blobs[i]->descriptor();
        std::memcpy(CMSG_DATA(rights) + i * sizeof(int), &descriptor, sizeof(int));
      }
    }
    const ssize_t count = sendmsg(socket_.get(), &message, MSG_DONTWAIT | MSG_NOSIGNAL);
    if (count < 0 && errno == EINTR) continue;
    if (count < 0 && (errno == EAGAIN || errno == EWOULDBLOCK)) return;
    if (count < 0) return Drop();  // the other end is gone; what it sent can still be read
    next.sent += static_cast<std::size_t>(count);
    unsent_bytes_ -= static_cast<std::size_t>(count);
    if (next.sent == next.bytes.size()) outbox_.pop_front();
  }
}

void FrameSocket::Drop() {
  closed_ = true;
  outbox_.clear();
  unsent_bytes_ = 0;
}

bool FrameSocket::HasUnsent() {
  const std::lock_guard lock(mutex_);
  Flush();
  return !outbox_.empty();
}

FrameSocket::Wait FrameSocket::Receive(absl::Time deadline, Frame* frame) {
  // Waits by the steady clock, so that setting the clock changes nothing.
  const bool forever = deadline == absl::InfiniteFuture();
  const absl::Duration wait = forever ? absl::ZeroDuration() : deadline - absl::Now();
  const auto until =
      SteadyClock::now() + absl::ToChronoNanoseconds(std::clamp(wait, absl::ZeroDuration(), absl::Hours(24 * 365)));
  while (true) {
    switch (TryRead(frame)) {
      case Read::kFrame:
        return Wait::kFrame;
      case Read::kClosed:
        return Wait::kClosed;
      case Read::kNothing:
        break;
    }
    const short output = HasUnsent() ? POLLOUT : short{0};
    pollfd sources[2] = {{socket_.get(), static_cast<short>(POLLIN | output), 0}, {wake_.get(), POLLIN, 0}};
    const int milliseconds = MillisecondsLeft(forever, until);
    const int ready = poll(sources, 2, milliseconds);
    if (ready == 0 && milliseconds < 3'600'000) return Wait::kTimeout;
    if ((sources[1].revents & POLLIN) != 0) {
      std::uint64_t count;
      [[maybe_unused]] const ssize_t drained = read(wake_.get(), &count, sizeof(count));
    }
  }
}

FrameSocket::Read FrameSocket::TryRead(Frame* frame) {
  if (ended_) return Read::kClosed;
  while (header_size_ < sizeof(header_)) {
    const Read read = ReadHeader();
    if (read != Read::kFrame) return read;
  }
  while (partial_.bytes.size() < body_size_) {
    // Memory grows as bytes arrive, not by the announced size.
    char buffer[64 * 1024];
    const std::size_t wanted = std::min(sizeof(buffer), body_size_ - partial_.bytes.size());
    const ssize_t count = recv(socket_.get(), buffer, wanted, MSG_DONTWAIT);
    if (count < 0 && errno == EINTR) continue;
    if (count < 0 && (errno == EAGAIN || errno == EWOULDBLOCK)) return Read::kNothing;
    if (count <= 0) return End();
    partial_.bytes.append(buffer, static_cast<std::size_t>(count));
  }
  header_size_ = 0;
  *frame = std::exchange(partial_, Frame());
  return Read::kFrame;
}

FrameSocket::Read FrameSocket::ReadHeader() {
  iovec part = {header_ + header_size_, sizeof(header_) - header_size_};
  ControlBuffer control;
  msghdr message = {};
  message.msg_iov = &part;
  message.msg_iovlen = 1;
  message.msg_control = control.bytes;
  message.msg_controllen = sizeof(control.bytes);
  const ssize_t count = recvmsg(socket_.get(), &message, MSG_DONTWAIT | MSG_CMSG_CLOEXEC);
  if (count < 0 && errno == EINTR) return Read::kFrame;
  if (count < 0 && (errno == EAGAIN || errno == EWOULDBLOCK)) return Read::kNothing;
  if (count <= 0) return End();
  if (const Read read = TakeDescriptors(&message); read != Read::kFrame) return read;
  header_size_ += static_cast<std::size_t>(count);
  if (header_size_ < sizeof(header_)) return Read::kFrame;

  std::uint32_t fields[2];
  std::memcpy(fields, header_, sizeof(fields));
  if (fields[0] > limits_.bytes) {
    return Fault(absl::StrCat("a message of ", fields[0], " bytes, more than ", limits_.bytes));
  }
  if (fields[1] > limits_.descriptors || fields[1] != partial_.descriptors.size()) {
    return Fault(absl::StrCat("a message that announces ", fields[1], " descriptors and comes with ",
                              partial_.descriptors.size(), " (", limits_.descriptors, " at most)"));
  }
  body_size_ = fields[0];
  return Read::kFrame;
}

FrameSocket::Read FrameSocket::TakeDescriptors(msghdr* message) {
  for (cmsghdr* part = CMSG_FIRSTHDR(message); part != nullptr; part = CMSG_NXTHDR(message, part)) {
    if (part->cmsg_level != SOL_SOCKET || part->cmsg_type != SCM_RIGHTS) continue;
    for (std::size_t at = 0; at + sizeof(int) <= part->cmsg_len - CMSG_LEN(0); at += sizeof(int)) {
      int descriptor;
      std::memcpy(&descriptor, CMSG_DATA(part) + at, sizeof(int));
      partial_.descriptors.emplace_back(descriptor);
    }
  }
  if ((message->msg_flags & MSG_CTRUNC) != 0) {
    return Fault("a message with more descriptors than can be taken");
  }
  return Read::kFrame;
}

// Ends the connection. A partially received message is dropped.
FrameSocket::Read FrameSocket::End() {
  ended_ = true;
  partial_ = Frame();
  return Read::kClosed;
}

FrameSocket::Read FrameSocket::Fault(const std::string& what) {
  fault_ = what;
  Close();
  return End();
}

void FrameSocket::Close() {
  const std::lock_guard lock(mutex_);
  Drop();
  shutdown(socket_.get(), SHUT_RDWR);
}

}  // namespace planish
