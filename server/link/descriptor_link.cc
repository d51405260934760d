#include "server/link/descriptor_link.h"

#include <cstdint>
#include <string>
#include <utility>

#include "absl/strings/str_cat.h"
#include "core/base/error.h"
#include "core/base/status_macros.h"
#include "server/link/frame_socket.h"
#include "server/link/rpc_status.h"

namespace planish {
namespace {

using worker::v1::FromWorker;
using worker::v1::ToWorker;

constexpr FrameLimits kFromServer = {.bytes = std::size_t{16} << 20, .descriptors = 2};

class DescriptorServerLink : public ServerLink {
 public:
  explicit DescriptorServerLink(std::unique_ptr<FrameSocket> socket) : socket_(std::move(socket)) {}

  void Send(FromWorker message, BlobPtr blob) override {
    std::vector<BlobPtr> blobs;
    if (blob != nullptr) blobs.push_back(std::move(blob));
    socket_->Send(message.SerializeAsString(), std::move(blobs));
  }

  std::optional<Received> Receive() override {
    Frame frame;
    Received received;
    if (socket_->Receive(absl::InfiniteFuture(), &frame) != FrameSocket::Wait::kFrame) return std::nullopt;
    if (!received.message.ParseFromString(frame.bytes)) return HangUp();
    for (Descriptor& descriptor : frame.descriptors) {
      absl::StatusOr<BlobPtr> blob = Blob::Map(std::move(descriptor));
      if (!blob.ok()) return HangUp();
      received.blobs.push_back(*std::move(blob));
    }
    return received;
  }

  void Close() override { socket_->Close(); }

 private:
  std::optional<Received> HangUp() {
    Close();
    return std::nullopt;
  }

  const std::unique_ptr<FrameSocket> socket_;
};

}  // namespace

absl::StatusOr<std::unique_ptr<ServerLink>> ConnectToServer(Descriptor socket) {
  PLANISH_ASSIGN_OR_RETURN(std::unique_ptr<FrameSocket> frames, FrameSocket::Make(std::move(socket), kFromServer));
  return std::make_unique<DescriptorServerLink>(std::move(frames));
}

std::string ToFrame(const FromWorker& message) {
  const std::string bytes = message.SerializeAsString();
  const std::uint32_t header[2] = {static_cast<std::uint32_t>(bytes.size()), 0};
  return std::string(reinterpret_cast<const char*>(header), sizeof(header)) + bytes;
}

}  // namespace planish
