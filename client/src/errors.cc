#include "client/src/errors.h"

#include <utility>

#include "core/base/error.h"
#include "google/rpc/error_details.pb.h"

namespace planish {
inline namespace abi0 {

const char* ToString(ErrorCode code) {
  switch (code) {
    case ErrorCode::kCancelled:
      return "CANCELLED";
    case ErrorCode::kUnknown:
      return "UNKNOWN";
    case ErrorCode::kInvalidArgument:
      return "INVALID_ARGUMENT";
    case ErrorCode::kDeadlineExceeded:
      return "DEADLINE_EXCEEDED";
    case ErrorCode::kNotFound:
      return "NOT_FOUND";
    case ErrorCode::kAlreadyExists:
      return "ALREADY_EXISTS";
    case ErrorCode::kPermissionDenied:
      return "PERMISSION_DENIED";
    case ErrorCode::kResourceExhausted:
      return "RESOURCE_EXHAUSTED";
    case ErrorCode::kFailedPrecondition:
      return "FAILED_PRECONDITION";
    case ErrorCode::kAborted:
      return "ABORTED";
    case ErrorCode::kOutOfRange:
      return "OUT_OF_RANGE";
    case ErrorCode::kUnimplemented:
      return "UNIMPLEMENTED";
    case ErrorCode::kInternal:
      return "INTERNAL";
    case ErrorCode::kUnavailable:
      return "UNAVAILABLE";
    case ErrorCode::kDataLoss:
      return "DATA_LOSS";
    case ErrorCode::kUnauthenticated:
      return "UNAUTHENTICATED";
  }
  return "UNKNOWN";
}

Error::Error(ErrorCode code, std::string reason, const std::string& message, Metadata metadata)
    : std::runtime_error(message), code_(code), reason_(std::move(reason)), metadata_(std::move(metadata)) {}

Error& Error::set_job(std::string job) {
  job_ = std::move(job);
  return *this;
}

Error& Error::set_trace_id(std::string trace_id) {
  trace_id_ = std::move(trace_id);
  return *this;
}

Error& Error::set_retry_after_seconds(double seconds) {
  retry_after_seconds_ = seconds;
  return *this;
}

namespace {

ErrorCode CodeFrom(int code) {
  return code >= 1 && code <= 16 ? static_cast<ErrorCode>(code) : ErrorCode::kUnknown;
}

}  // namespace

Error ErrorFrom(const google::rpc::Status& status) {
  const ErrorCode code = CodeFrom(status.code());
  std::string reason = ToString(code);
  Error::Metadata metadata;
  double retry_after_seconds = 0;
  for (const google::protobuf::Any& detail : status.details()) {
    google::rpc::ErrorInfo info;
    google::rpc::RetryInfo retry;
    if (detail.UnpackTo(&info)) {
      reason = info.reason();
      metadata.insert(info.metadata().begin(), info.metadata().end());
    } else if (detail.UnpackTo(&retry)) {
      retry_after_seconds = static_cast<double>(retry.retry_delay().seconds()) + 1e-9 * retry.retry_delay().nanos();
    }
  }
  return Error(code, reason, status.message(), metadata).set_retry_after_seconds(retry_after_seconds);
}

Error ErrorFrom(const absl::Status& status) {
  const ErrorCode code = CodeFrom(static_cast<int>(status.code()));
  const ErrorInfo info = ErrorInfoOf(status);
  return Error(code, info.reason.empty() ? ToString(code) : info.reason, std::string(status.message()), info.metadata);
}

Error Renumbered(const Error& error, const ids::Renumbering& renumbering) {
  return Error(error.code(), error.reason(), ids::RenumberMessage(error.what(), renumbering),
               ids::RenumberMetadata(error.metadata(), renumbering))
      .set_job(error.job())
      .set_trace_id(error.trace_id())
      .set_retry_after_seconds(error.retry_after_seconds());
}

}  // namespace abi0
}  // namespace planish
