#include "server/rpc/grpc_status.h"

#include <string>
#include <utility>

#include "absl/strings/ascii.h"
#include "absl/strings/match.h"
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

// Removes paths of the server's files, which belong into its log only.
std::string WithoutPaths(const std::string& text) {
  const auto begins_word = [](char c) { return absl::ascii_isspace(c) || absl::StrContains("\"'(=<", c); };
  const auto ends_path = [](char c) { return absl::ascii_isspace(c) || absl::StrContains("\"')>:;,", c); };
  std::string shown;
  for (std::size_t i = 0; i < text.size(); ++i) {
    const bool is_path =
        text[i] == '/' && (i == 0 || begins_word(text[i - 1])) && i + 1 < text.size() && !ends_path(text[i + 1]);
    if (!is_path) {
      shown.push_back(text[i]);
      continue;
    }
    while (i + 1 < text.size() && !ends_path(text[i + 1])) ++i;
    shown.append("(a file of the server)");
  }
  return shown;
}

// Adds a BadRequest for the field that the error's metadata names.
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
  if (HidesPaths(status)) *rpc.mutable_message() = WithoutPaths(rpc.message());
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

bool HidesPaths(const absl::Status& status) {
  if (status.ok() || status.code() == absl::StatusCode::kInvalidArgument) return false;
  const std::string message(status.message());
  return WithoutPaths(message) != message;
}

grpc::Status ToGrpcStatus(const absl::Status& status) {
  if (status.ok()) return grpc::Status::OK;
  const google::rpc::Status rpc = ToCallStatus(status);
  return {static_cast<grpc::StatusCode>(rpc.code()), rpc.message(), rpc.SerializeAsString()};
}

}  // namespace planish
