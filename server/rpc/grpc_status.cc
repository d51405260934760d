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

// Which field is wrong, as the details of the error say it already.
void AddFieldViolation(google::rpc::Status* rpc) {
  google::rpc::ErrorInfo info;
  if (rpc->code() != static_cast<int>(absl::StatusCode::kInvalidArgument)) return;
  if (rpc->details().empty() || !rpc->details(0).UnpackTo(&info)) return;
  const auto field = info.metadata().find("field");
  if (field == info.metadata().end()) return;
  google::rpc::BadRequest bad;
  google::rpc::BadRequest::FieldViolation* violation = bad.add_field_violations();
  violation->set_field(field->second);
  violation->set_description(rpc->message());
  rpc->add_details()->PackFrom(bad);
}

}  // namespace

google::rpc::Status ToCallStatus(const absl::Status& status) {
  google::rpc::Status rpc = ToRpcStatus(status);
  Cut(rpc.mutable_message());
  AddFieldViolation(&rpc);
  if (rpc.ByteSizeLong() > kMaxDetails) {
    for (google::protobuf::Any& detail : *rpc.mutable_details()) {
      google::rpc::ErrorInfo info;
      if (!detail.UnpackTo(&info)) continue;
      info.clear_metadata();
      detail.PackFrom(info);
    }
  }
  return rpc;
}

grpc::Status ToGrpcStatus(const absl::Status& status) {
  if (status.ok()) return grpc::Status::OK;
  const google::rpc::Status rpc = ToCallStatus(status);
  return {static_cast<grpc::StatusCode>(rpc.code()), rpc.message(), rpc.SerializeAsString()};
}

}  // namespace planish
