#include "client/src/errors.h"

#include <new>
#include <utility>

#include "client/src/convert.h"
#include "core/base/error.h"
#include "google/rpc/error_details.pb.h"

namespace planish {
inline namespace abi0 {

std::string ToString(ErrorCode code) {
  return absl::StatusCodeToString(static_cast<absl::StatusCode>(code));
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
      pause = SecondsFrom(retry.retry_delay());
    }
  }
  return Error(code, reason, status.message(), metadata).set_retry_after(pause);
}

Error Invalid(const std::string& reason, const std::string& message, const Error::Metadata& metadata) {
  return Error(ErrorCode::kInvalidArgument, reason, message, metadata);
}

Error ErrorFrom(const absl::Status& status) {
  const ErrorCode code = CodeFrom(static_cast<int>(status.code()));
  const ErrorInfo info = ErrorInfoOf(status);
  return Error(code, info.reason.empty() ? ToString(code) : info.reason, std::string(status.message()), info.metadata);
}

Error Renumbered(const Error& error, const ids::Renumbering& renumbering) {
  return Error(error).set_metadata(ids::RenumberMetadata(error.metadata(), renumbering));
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
