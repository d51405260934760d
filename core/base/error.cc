#include "core/base/error.h"

#include "absl/strings/cord.h"
#include "nlohmann/json.hpp"

namespace planish {
namespace {

constexpr char kPayloadUrl[] = "planish/ErrorInfo";

}  // namespace

absl::Status MakeError(absl::StatusCode code, const std::string& reason, const std::string& message,
                       const std::map<std::string, std::string>& metadata) {
  absl::Status status(code, message);
  const nlohmann::json payload = {{"reason", reason}, {"metadata", metadata}};
  // Messages may quote bytes of the caller's input, so invalid UTF-8 must not throw here.
  status.SetPayload(kPayloadUrl, absl::Cord(payload.dump(-1, ' ', false, nlohmann::json::error_handler_t::replace)));
  return status;
}

absl::Status OptionError(const std::string& field, const std::string& message,
                         std::map<std::string, std::string> metadata) {
  metadata["field"] = field;
  return MakeError(absl::StatusCode::kInvalidArgument, "OPTIONS_INVALID", field + ": " + message, metadata);
}

ErrorInfo ErrorInfoOf(const absl::Status& status) {
  ErrorInfo info;
  const auto payload = status.GetPayload(kPayloadUrl);
  if (!payload.has_value()) return info;
  const nlohmann::json parsed = nlohmann::json::parse(std::string(*payload));
  info.reason = parsed.at("reason").get<std::string>();
  info.metadata = parsed.at("metadata").get<std::map<std::string, std::string>>();
  return info;
}

absl::Status InternalError(const std::string& message) {
  return MakeError(absl::StatusCode::kInternal, "INTERNAL", message);
}

}  // namespace planish
