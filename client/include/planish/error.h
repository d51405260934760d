// The one exception of the library.
#pragma once

#include <map>
#include <stdexcept>
#include <string>

namespace planish {
inline namespace abi0 {

// Numbered like google.rpc.Code.
enum class ErrorCode {
  kCancelled = 1,
  kUnknown = 2,
  kInvalidArgument = 3,
  kDeadlineExceeded = 4,
  kNotFound = 5,
  kAlreadyExists = 6,
  kPermissionDenied = 7,
  kResourceExhausted = 8,
  kFailedPrecondition = 9,
  kAborted = 10,
  kOutOfRange = 11,
  kUnimplemented = 12,
  kInternal = 13,
  kUnavailable = 14,
  kDataLoss = 15,
  kUnauthenticated = 16,
};

// "INVALID_ARGUMENT", ...
const char* ToString(ErrorCode code);

// Thrown when a call fails and when a job that was waited for does not succeed. what() is a sentence for people.
class Error : public std::runtime_error {
 public:
  using Metadata = std::map<std::string, std::string>;

  Error(ErrorCode code, std::string reason, const std::string& message, Metadata metadata = {});

  ErrorCode code() const { return code_; }
  // For programs: a reason of planish.v1.Job.error or of a call's ErrorInfo, or one of this library's own:
  //   SERVER_UNREACHABLE     no connection (kUnavailable)
  //   TLS_FAILED             no connection, because of a certificate, or one side speaks TLS alone (kUnavailable)
  //   CONNECTION_LOST        the stream broke and re-attaching failed (kUnavailable)
  //   DEADLINE_EXCEEDED      CallOptions::timeout_seconds passed
  //   CANCELLED              by the caller, or by someone else on the server
  //   MESH_MISMATCH          the job's mesh is not the one that was given (kFailedPrecondition)
  //   UV_CORRUPT             the UV do not have the promised SHA-256 or size (kDataLoss)
  //   OPTIONS_INVALID        ClientOptions that cannot be, or name files that cannot be used (kInvalidArgument)
  //   PRIVATE_SERVER_FAILED  planishd was not found or did not start (kUnavailable)
  const std::string& reason() const { return reason_; }
  // Further facts, e.g. {"vertices", "12,40"}: ids are 0-based in the caller's own order.
  const Metadata& metadata() const { return metadata_; }

  // Name of the job that failed; empty if the call was refused before there was one.
  const std::string& job() const { return job_; }
  // Of the trace that the call belonged to, 32 hex digits, as in the server's log; empty if it never got that far.
  const std::string& trace_id() const { return trace_id_; }
  // What the server asks to wait before the call is tried again; 0 if it does not say.
  double retry_after_seconds() const { return retry_after_seconds_; }

  Error& set_job(std::string job);
  Error& set_trace_id(std::string trace_id);
  Error& set_retry_after_seconds(double seconds);

 private:
  ErrorCode code_;
  std::string reason_;
  Metadata metadata_;
  std::string job_;
  std::string trace_id_;
  double retry_after_seconds_ = 0;
};

}  // namespace abi0
}  // namespace planish
