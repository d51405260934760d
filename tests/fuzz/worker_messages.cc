// Bytes on a process link, as a worker that went wrong may send them to the server and as a server may send them to a
// worker. The first byte chooses the direction; then pieces follow, each of a length, a number of descriptors that come
// along, and bytes.
#include <fcntl.h>
#include <sys/socket.h>
#include <unistd.h>

#include <array>
#include <cstring>
#include <string>
#include <vector>

#include "planish/worker/v1/worker.pb.h"
#include "server/link/descriptor_link.h"
#include "server/link/frame_socket.h"
#include "tests/fuzz/check.h"
#include "tests/fuzz/memory_budget.h"

namespace planish::fuzz::worker_messages {
namespace {

constexpr std::int64_t kMemory = std::int64_t{64} << 20;
constexpr FrameLimits kLimits = {.bytes = 2000, .descriptors = 2};
constexpr std::size_t kHeader = 2 * sizeof(std::uint32_t);
constexpr std::size_t kMaxBytes = 50'000;  // that a socket takes without a reader
constexpr int kMaxPieces = 200;

// Two ends of a socket.
std::array<Descriptor, 2> Pair() {
  int ends[2];
  Require(socketpair(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC | SOCK_NONBLOCK, 0, ends) == 0, "there are descriptors");
  return {Descriptor(ends[0]), Descriptor(ends[1])};
}

// The lowest number that is free: the same before and after if none leaked.
int NextDescriptor() {
  return Descriptor(fcntl(0, F_DUPFD_CLOEXEC, 0)).get();
}

// What may come along: sealed memory as a worker should send it, a file, a directory, a pipe.
class Gifts {
 public:
  Gifts() : memory_(*Blob::Copy("sealed")) {
    int ends[2];
    Require(pipe2(ends, O_CLOEXEC) == 0, "there are descriptors");
    pipe_ = {Descriptor(ends[0]), Descriptor(ends[1])};
    null_ = Descriptor(open("/dev/null", O_RDONLY | O_CLOEXEC));
    directory_ = Descriptor(open("/", O_RDONLY | O_DIRECTORY | O_CLOEXEC));
  }

  int Choose(int number) const {
    switch (number % 5) {
      case 0:
      case 1:
        return memory_->descriptor();
      case 2:
        return null_.get();
      case 3:
        return directory_.get();
      default:
        return pipe_[0].get();
    }
  }

 private:
  const BlobPtr memory_;
  std::array<Descriptor, 2> pipe_;
  Descriptor null_, directory_;
};

void SendPiece(int socket, std::string_view bytes, const std::vector<int>& descriptors) {
  std::string copy(bytes);
  iovec part = {copy.data(), copy.size()};
  msghdr message = {};
  message.msg_iov = &part;
  message.msg_iovlen = 1;
  alignas(cmsghdr) char control[CMSG_SPACE(16 * sizeof(int))] = {};
  const std::size_t size = descriptors.size() * sizeof(int);
  if (size > 0) {
    message.msg_control = control;
    message.msg_controllen = CMSG_SPACE(size);
    cmsghdr* const rights = CMSG_FIRSTHDR(&message);
    rights->cmsg_level = SOL_SOCKET;
    rights->cmsg_type = SCM_RIGHTS;
    rights->cmsg_len = CMSG_LEN(size);
    std::memcpy(CMSG_DATA(rights), descriptors.data(), size);
  }
  Require(sendmsg(socket, &message, MSG_NOSIGNAL) == static_cast<ssize_t>(copy.size()), "the socket takes a piece");
}

// Everything that is sent, with the socket it is sent over, which is closed at the end. Returns all bytes.
std::string SendAll(Bytes& input, const Gifts& gifts, Descriptor socket, bool* with_descriptors) {
  std::string sent;
  for (int i = 0; i < kMaxPieces && !input.empty() && sent.size() < kMaxBytes; ++i) {
    const int length = input.Byte();
    const int kind = input.Byte();
    std::vector<int> descriptors;
    // Most pieces come without, some with more than anybody may send.
    for (int d = 0; d < (kind % 4 == 0 ? kind / 4 % 13 : 0); ++d) descriptors.push_back(gifts.Choose(kind / 52 + d));
    const std::string_view piece = input.Take(static_cast<std::size_t>(length));
    if (piece.empty()) continue;
    SendPiece(socket.get(), piece, descriptors);
    *with_descriptors = *with_descriptors || !descriptors.empty();
    sent += piece;
  }
  return sent;
}

std::uint32_t Number(std::string_view bytes) {
  std::uint32_t number;
  std::memcpy(&number, bytes.data(), sizeof(number));
  return number;
}

// The frames in `sent`, none of which came with a descriptor; `fault`: what follows is none.
std::vector<std::string> FramesOf(std::string_view sent, bool* fault) {
  std::vector<std::string> frames;
  while (sent.size() >= kHeader) {
    const std::uint32_t length = Number(sent), descriptors = Number(sent.substr(sizeof(std::uint32_t)));
    *fault = length > kLimits.bytes || descriptors != 0;
    if (*fault || sent.size() - kHeader < length) break;
    frames.emplace_back(sent.substr(kHeader, length));
    sent.remove_prefix(kHeader + length);
  }
  return frames;
}

// What the server receives from a worker.
void ToServer(Bytes& input, const Gifts& gifts) {
  auto [ours, theirs] = Pair();
  const auto socket = *FrameSocket::Make(std::move(ours), kLimits);
  bool with_descriptors = false;
  const std::string sent = SendAll(input, gifts, std::move(theirs), &with_descriptors);
  std::vector<std::string> received;
  Frame frame;
  while (socket->Receive(absl::InfinitePast(), &frame) == FrameSocket::Wait::kFrame) {
    Require(frame.bytes.size() <= kLimits.bytes && frame.descriptors.size() <= kLimits.descriptors, "frames in limits");
    received.push_back(frame.bytes);
    // As ProcessWorkerLink goes on.
    worker::v1::FromWorker message;
    if (message.ParseFromString(frame.bytes)) {
      Require(ToFrame(message).size() >= kHeader, "a message is a frame");
    }
    for (Descriptor& descriptor : frame.descriptors) {
      const auto blob = Blob::MapSealed(std::move(descriptor));
      Require(!blob.ok() || (*blob)->bytes() == "sealed", "only sealed memory is mapped");
    }
  }
  Require(socket->Receive(absl::InfinitePast(), &frame) == FrameSocket::Wait::kClosed, "the end is final");
  if (with_descriptors) return;
  bool fault = false;
  const std::vector<std::string> expected = FramesOf(sent, &fault);
  Require(received == expected, "the frames that were sent arrive, and no others");
  Require(socket->fault().empty() == !fault, "a fault is told");
}

// What a worker receives from the server.
void ToWorker(Bytes& input, const Gifts& gifts) {
  auto [ours, theirs] = Pair();
  const auto link = *ConnectToServer(std::move(ours));
  bool with_descriptors = false;
  SendAll(input, gifts, std::move(theirs), &with_descriptors);
  while (const auto received = link->Receive()) {
    Require(received->blobs.size() <= 2, "at most two blobs");
    for (const BlobPtr& blob : received->blobs) {
      Require(blob->bytes().empty() || blob->bytes() == "sealed", "the blobs that were sent");
    }
    link->Send(worker::v1::FromWorker());  // nobody is there: dropped
  }
}

}  // namespace

FUZZ_TARGET(worker_messages, bytes) {
  const MemoryBudget budget(kMemory);
  const int before = NextDescriptor();
  {
    const Gifts gifts;
    Bytes input(bytes);
    if (input.Below(2) == 0) {
      ToServer(input, gifts);
    } else {
      ToWorker(input, gifts);
    }
  }
  Require(NextDescriptor() == before, "no descriptor leaks");
}

}  // namespace planish::fuzz::worker_messages
