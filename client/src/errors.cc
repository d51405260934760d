#include "client/src/errors.h"

#include <cstdlib>
#include <new>
#include <regex>
#include <utility>

#include "core/base/error.h"
#include "google/rpc/error_details.pb.h"

namespace planish::ids {

std::map<std::string, std::string> RenumberMetadata(const std::map<std::string, std::string>& metadata,
                                                    const Renumbering& renumbering) {
  static const auto* vertex_key = new std::regex("vert(ex|ices)|edges?");
  static const auto* face_key = new std::regex("faces?");
  static const auto* id = new std::regex("[0-9]+");
  std::map<std::string, std::string> result = metadata;
  for (auto& [key, value] : result) {
    const bool is_face = std::regex_match(key, *face_key);
    const IdMap& map = is_face ? renumbering.face : renumbering.vertex;
    if (!map || !(is_face || std::regex_match(key, *vertex_key))) continue;
    const std::string text = std::exchange(value, "");
    auto last = text.begin();
    for (std::sregex_iterator match(text.begin(), text.end(), *id), end; match != end; ++match) {
      const std::int64_t mapped = map(std::strtoll(match->str().c_str(), nullptr, 10));
      value.append(last, (*match)[0].first).append(mapped < 0 ? match->str() : std::to_string(mapped));
      last = (*match)[0].second;
    }
    value.append(last, text.end());
  }
  return result;
}

}  // namespace planish::ids

namespace planish {
inline namespace abi0 {

const char* ToString(ErrorCode code) {
  static constexpr const char* kNames[] = {
      "OK",        "CANCELLED",      "UNKNOWN",           "INVALID_ARGUMENT",   "DEADLINE_EXCEEDED",
      "NOT_FOUND", "ALREADY_EXISTS", "PERMISSION_DENIED", "RESOURCE_EXHAUSTED", "FAILED_PRECONDITION",
      "ABORTED",   "OUT_OF_RANGE",   "UNIMPLEMENTED",     "INTERNAL",           "UNAVAILABLE",
      "DATA_LOSS", "UNAUTHENTICATED"};
  return kNames[static_cast<int>(code)];
}

Error::Error(ErrorCode code, std::string reason, const std::string& message, Metadata metadata)
    : std::runtime_error(message), code_(code), reason_(std::move(reason)), metadata_(std::move(metadata)) {}

void Error::Throw() const {
  if (cause_) std::rethrow_exception(cause_);
  throw *this;
}

}  // namespace abi0
namespace {

ErrorCode CodeFrom(int code) {
  return code >= 1 && code <= 16 ? static_cast<ErrorCode>(code) : ErrorCode::kUnknown;
}

}  // namespace

Error ErrorFrom(const google::rpc::Status& status) {
  const ErrorCode code = CodeFrom(status.code());
  std::string reason = ToString(code);
  Error::Metadata metadata;
  Seconds pause{0};
  for (const google::protobuf::Any& detail : status.details()) {
    google::rpc::ErrorInfo info;
    google::rpc::RetryInfo retry;
    if (detail.UnpackTo(&info)) {
      reason = info.reason();
      metadata.insert(info.metadata().begin(), info.metadata().end());
    } else if (detail.UnpackTo(&retry)) {
      pause = Seconds(static_cast<double>(retry.retry_delay().seconds()) + 1e-9 * retry.retry_delay().nanos());
    }
  }
  return Error(code, reason, status.message(), metadata).set_retry_after(pause);
}

Error ErrorFrom(const absl::Status& status) {
  const ErrorCode code = CodeFrom(static_cast<int>(status.code()));
  const ErrorInfo info = ErrorInfoOf(status);
  return Error(code, info.reason.empty() ? ToString(code) : info.reason, std::string(status.message()), info.metadata);
}

Error Renumbered(const Error& error, const ids::Renumbering& renumbering) {
  return Error(error.code(), error.reason(), error.what(), ids::RenumberMetadata(error.metadata(), renumbering))
      .set_job(error.job())
      .set_trace_id(error.trace_id())
      .set_retry_after(error.retry_after());
}

Error CurrentError() {
  const std::exception_ptr cause = std::current_exception();
  try {
    throw;
  } catch (const Error& error) {
    return error;
  } catch (const std::bad_alloc&) {
    return Error(ErrorCode::kResourceExhausted, "OUT_OF_MEMORY", "there is not enough memory").set_cause(cause);
  } catch (const std::exception& exception) {
    return Error(ErrorCode::kUnknown, "CALLBACK_FAILED", exception.what()).set_cause(cause);
  } catch (...) {
    return Error(ErrorCode::kUnknown, "CALLBACK_FAILED", "a callback threw an exception").set_cause(cause);
  }
}

}  // namespace planish
