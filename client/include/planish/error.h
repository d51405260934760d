// The library's only error type: thrown, or in a Result for programs built without exceptions.
#pragma once

#include <chrono>
#include <exception>
#include <map>
#include <stdexcept>
#include <string>
#include <type_traits>
#include <utility>
#include <variant>

namespace planish::inline abi0 {

// The type of all durations. Any std::chrono duration converts to it (`std::chrono::minutes(5)`); count() is in
// seconds.
using Seconds = std::chrono::duration<double>;

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
std::string ToString(ErrorCode code);

// Thrown if a call fails, or if a job that it waited for does not succeed. what() is a sentence for people.
class Error : public std::runtime_error {
 public:
  using Metadata = std::map<std::string, std::string>;

  Error(ErrorCode code, std::string reason, const std::string& message, Metadata metadata = {});

  ErrorCode code() const { return code_; }
  // For programs: a reason of planish.v1.Job.error or of a call's ErrorInfo, or one of this library:
  //   SERVER_UNREACHABLE     no connection (kUnavailable)
  //   TLS_FAILED             no connection, because of a certificate, or because only one side uses TLS (kUnavailable)
  //   CONNECTION_LOST        the stream broke and re-attaching failed (kUnavailable)
  //   DEADLINE_EXCEEDED      CallOptions::timeout passed
  //   CANCELLED              by the caller, or by someone else on the server
  //   MESH_MISMATCH          the job was created with another mesh (kFailedPrecondition)
  //   UV_CORRUPT             the UV do not have the promised SHA-256 or size (kDataLoss)
  //   OPTIONS_INVALID        ClientOptions that are invalid, or name files that cannot be used (kInvalidArgument)
  //   PRIVATE_SERVER_FAILED  planishd was not found or did not start (kUnavailable)
  //   CALLBACK_FAILED        a callback threw an exception other than planish::Error (kUnknown)
  //   OUT_OF_MEMORY          in this process (kResourceExhausted)
  const std::string& reason() const { return reason_; }
  // Details, e.g. {"vertices", "12,40"}: ids are 0-based in the caller's order. Only the metadata say which elements
  // are at fault; what() has their number.
  const Metadata& metadata() const { return metadata_; }

  // Name of the job that failed; empty if the call was refused without a job.
  const std::string& job() const { return job_; }
  // The id of the call's trace, 32 hex digits, as in the server's log; empty if the call failed before it had a trace.
  const std::string& trace_id() const { return trace_id_; }
  // How long the server asks to wait before a retry; 0 if it does not say.
  Seconds retry_after() const { return retry_after_; }

  Error& set_metadata(Metadata metadata) { return Set(&Error::metadata_, std::move(metadata)); }
  Error& set_job(std::string job) { return Set(&Error::job_, std::move(job)); }
  Error& set_trace_id(std::string trace_id) { return Set(&Error::trace_id_, std::move(trace_id)); }
  Error& set_retry_after(Seconds pause) { return Set(&Error::retry_after_, pause); }
  Error& set_cause(std::exception_ptr cause) { return Set(&Error::cause_, std::move(cause)); }

  // Throws this error. If this error stands for another exception (CALLBACK_FAILED, OUT_OF_MEMORY), throws that
  // exception instead.
  [[noreturn]] void Throw() const;

 private:
  template <typename Field>
  Error& Set(Field Error::*field, Field value) {
    this->*field = std::move(value);
    return *this;
  }

  ErrorCode code_;
  std::string reason_;
  Metadata metadata_;
  std::string job_;
  std::string trace_id_;
  Seconds retry_after_{0};
  std::exception_ptr cause_;
};

// The result of calls with std::nothrow: a value, or the error that the same call would throw.
template <typename T>
class [[nodiscard]] Result {
 public:
  using Value = std::conditional_t<std::is_void_v<T>, std::monostate, T>;

  Result(Value value) : result_(std::move(value)) {}
  Result(Error error) : result_(std::move(error)) {}

  bool ok() const { return result_.index() == 0; }
  explicit operator bool() const { return ok(); }
  // Requires ok(). Otherwise throws std::bad_variant_access; a program built without exceptions ends.
  Value& operator*() { return std::get<0>(result_); }
  const Value& operator*() const { return std::get<0>(result_); }
  Value* operator->() { return &**this; }
  const Value* operator->() const { return &**this; }
  // Requires !ok().
  const Error& error() const { return std::get<1>(result_); }
  // Moves the value out, or throws the error.
  T value() && {
    if (!ok()) error().Throw();
    if constexpr (!std::is_void_v<T>) return std::move(**this);
  }

 private:
  std::variant<Value, Error> result_;
};

}  // namespace planish::inline abi0
