// Messages with descriptors over a connected Unix socket. Both ends of a process link use it.
//
// A frame is a header of two uint32 in the machine's byte order (the number of bytes that follow, the number of
// descriptors that come with the header), and the bytes. The other end is not trusted: a malformed frame, or one beyond
// the limits, ends the connection.
#pragma once

#include <sys/socket.h>

#include <cstddef>
#include <cstdint>
#include <deque>
#include <memory>
#include <mutex>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "absl/status/statusor.h"
#include "absl/time/time.h"
#include "server/link/blob.h"

namespace planish {

struct Frame {
  std::string bytes;
  std::vector<Descriptor> descriptors;
};

// Limits of received frames.
struct FrameLimits {
  std::size_t bytes = std::size_t{16} << 20;
  std::size_t descriptors = 2;  // at most kMaxFrameDescriptors
};
inline constexpr std::size_t kMaxFrameDescriptors = 8;

class FrameSocket {
 public:
  enum class Wait { kFrame, kTimeout, kClosed };

  // `socket` is of AF_UNIX and SOCK_STREAM. RESOURCE_EXHAUSTED if the process has no descriptor left.
  static absl::StatusOr<std::unique_ptr<FrameSocket>> Make(Descriptor socket, const FrameLimits& limits);

  FrameSocket(const FrameSocket&) = delete;
  FrameSocket& operator=(const FrameSocket&) = delete;

  // Sends a frame. Never waits for the other end: bytes that the socket does not take at once are sent by the thread in
  // Receive(). More than kMaxUnsentBytes unsent bytes end the connection; after that, frames are dropped. Thread-safe.
  void Send(std::string_view bytes, std::vector<BlobPtr> blobs);
  static constexpr std::size_t kMaxUnsentBytes = std::size_t{64} << 20;

  // Waits for a frame until `deadline`. One thread at a time. After kClosed it always returns kClosed.
  Wait Receive(absl::Time deadline, Frame* frame);

  // Ends the connection at both ends; a Receive() under way returns. Thread-safe.
  void Close();

  // The fault in the data that the other end sent; empty if there was no fault. Call it after Receive() returned
  // kClosed, on the same thread.
  const std::string& fault() const { return fault_; }

 private:
  struct Outgoing {
    std::string bytes;  // including the header
    std::size_t sent = 0;
    std::vector<BlobPtr> blobs;
  };

  enum class Read { kFrame, kNothing, kClosed };

  FrameSocket(Descriptor socket, Descriptor wake, const FrameLimits& limits)
      : socket_(std::move(socket)), wake_(std::move(wake)), limits_(limits) {}

  // Flush() and Drop() require mutex_.
  void Flush();
  void Drop();

  // Called by Receive() only.
  Read TryRead(Frame* frame);
  Read ReadHeader();
  Read TakeDescriptors(msghdr* message);
  Read End();
  Read Fault(const std::string& what);
  bool HasUnsent();

  const Descriptor socket_;
  const Descriptor wake_;  // an eventfd, readable when there is something to send
  const FrameLimits limits_;

  std::mutex mutex_;
  // Guarded by mutex_.
  std::deque<Outgoing> outbox_;
  std::size_t unsent_bytes_ = 0;
  bool closed_ = false;

  // Used only by the thread in Receive(): the partially received frame.
  char header_[8] = {};
  std::size_t header_size_ = 0;
  std::size_t body_size_ = 0;
  Frame partial_;
  bool ended_ = false;
  std::string fault_;
};

}  // namespace planish
