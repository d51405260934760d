#include "server/link/rpc_status.h"

#include <string>

#include "absl/strings/cord.h"
#include "core/base/error.h"
#include "google/rpc/error_details.pb.h"
#include "nlohmann/json.hpp"
#include "server/link/duration.h"

namespace planish {
namespace {

constexpr char kDomain[] = "planish";
constexpr char kRetryInfoUrl[] = "type.googleapis.com/google.rpc.RetryInfo";

// Replaces bytes that are not UTF-8. Messages may quote bytes of the caller's input, and receivers cannot parse a proto
// string that is not UTF-8.
std::string ToUtf8(const std::string& text) {
  const auto replace = nlohmann::json::error_handler_t::replace;
  return nlohmann::json::parse(nlohmann::json(text).dump(-1, ' ', false, replace)).get<std::string>();
}

}  // namespace

absl::Status WithinField(const absl::Status& status, const std::string& path) {
  if (status.code() != absl::StatusCode::kInvalidArgument) return status;
  ErrorInfo info = ErrorInfoOf(status);
  const auto field = info.metadata.find("field");
  if (field == info.metadata.end()) return status;
  field->second = path + field->second;
  return MakeError(status.code(), info.reason, std::string(status.message()), info.metadata);
}

absl::Status WithRetryDelay(absl::Status status, absl::Duration delay) {
  google::rpc::RetryInfo retry;
  *retry.mutable_retry_delay() = ToDuration(delay);
  status.SetPayload(kRetryInfoUrl, absl::Cord(retry.SerializeAsString()));
  return status;
}

google::rpc::Status ToRpcStatus(const absl::Status& status) {
  google::rpc::Status rpc;
  if (status.ok()) return rpc;
  rpc.set_code(static_cast<int>(status.code()));
  rpc.set_message(ToUtf8(std::string(status.message())));

  const ErrorInfo info = ErrorInfoOf(status);
  google::rpc::ErrorInfo detail;
  const bool named = !info.reason.empty();
  detail.set_reason(named ? info.reason : absl::StatusCodeToString(status.code()));
  detail.set_domain(kDomain);
  detail.mutable_metadata()->insert(info.metadata.begin(), info.metadata.end());
  rpc.add_details()->PackFrom(detail);

  if (const auto retry = status.GetPayload(kRetryInfoUrl); retry.has_value()) {
    google::protobuf::Any* any = rpc.add_details();
    any->set_type_url(kRetryInfoUrl);
    any->set_value(std::string(*retry));
  }
  return rpc;
}

std::string ReasonOf(const google::rpc::Status& status) {
  google::rpc::ErrorInfo info;
  for (const auto& detail : status.details()) {
    if (detail.UnpackTo(&info)) return info.reason();
  }
  return "";
}

}  // namespace planish
