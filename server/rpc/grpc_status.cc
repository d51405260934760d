#include "server/rpc/grpc_status.h"

#include <string>

#include "google/rpc/error_details.pb.h"
#include "server/link/rpc_status.h"

namespace planish {
namespace {

constexpr std::size_t kMaxMessage = 1024;
constexpr std::size_t kMaxDetails = 4096;

void Cut(std::string* text) {
  if (text->size() <= kMaxMessage) return;
  std::size_t end = kMaxMessage;
  const auto is_continuation = [](char c) { return (static_cast<unsigned char>(c) & 0xC0) == 0x80; };
  while (end > 0 && is_continuation((*text)[end])) --end;
  text->resize(end);
  text->append("...");
}

}  // namespace

grpc::Status ToGrpcStatus(const absl::Status& status) {
  if (status.ok()) return grpc::Status::OK;
  google::rpc::Status rpc = ToRpcStatus(status);
  Cut(rpc.mutable_message());
  if (rpc.ByteSizeLong() > kMaxDetails) {
    for (google::protobuf::Any& detail : *rpc.mutable_details()) {
      google::rpc::ErrorInfo info;
      if (!detail.UnpackTo(&info)) continue;
      info.clear_metadata();
      detail.PackFrom(info);
    }
  }
  return {static_cast<grpc::StatusCode>(rpc.code()), rpc.message(), rpc.SerializeAsString()};
}

}  // namespace planish
