#include "client/src/stream_errors.h"

#include <chrono>
#include <string>

namespace planish {
inline namespace abi0 {

bool IsBrokenStream(const Error& error) {
  if (error.code() == ErrorCode::kUnavailable) return true;
  // Resets and broken frames come from the transport; what the server says itself brings its own reason.
  const bool from_transport = error.reason() == ToString(error.code());
  return from_transport && (error.code() == ErrorCode::kInternal || error.code() == ErrorCode::kUnknown);
}

bool IsUnreachable(const Error& error) {
  return error.reason() == "SERVER_UNREACHABLE" || error.reason() == "TLS_FAILED";
}

bool AsksToWait(const Error& error) {
  if (error.code() != ErrorCode::kResourceExhausted) return false;
  return error.retry_after_seconds() > 0 || error.reason() == "QUEUE_FULL";
}

void ThrowIfLate(Deadline deadline, double pause_seconds, const Error& why) {
  if (!deadline) return;
  const std::chrono::duration<double> left = *deadline - std::chrono::system_clock::now();
  if (left.count() > pause_seconds) return;
  throw Error(ErrorCode::kDeadlineExceeded, "DEADLINE_EXCEEDED",
              std::string("the time given to the call passed while waiting: ") + why.what());
}

}  // namespace abi0
}  // namespace planish
