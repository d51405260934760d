#include "client/src/trace_scope.h"

#include <cstdint>
#include <cstdlib>
#include <random>

#include "core/base/trace_context.h"
#include "planish/error.h"

namespace planish {
inline namespace abi0 {
namespace {

thread_local const TraceScope* innermost = nullptr;

std::uint64_t Entropy() {
  std::random_device random;
  return (std::uint64_t{random()} << 32) | random();
}

// Where nobody says which trace it is.
std::string DefaultTraceparent() {
  const char* environment = std::getenv("TRACEPARENT");
  std::string traceparent = ParseTraceparent(environment == nullptr ? "" : environment);
  return traceparent.empty() ? NewTraceparent(Entropy) : traceparent;
}

}  // namespace

TraceScope::TraceScope(const std::string& traceparent)
    : traceparent_(traceparent.empty() ? DefaultTraceparent() : ParseTraceparent(traceparent)), outer_(innermost) {
  if (traceparent_.empty()) {
    throw Error(ErrorCode::kInvalidArgument, "TRACEPARENT_INVALID",
                "'" + traceparent + "' is no W3C traceparent, as 00-<32 hex digits>-<16 hex digits>-01 is one");
  }
  innermost = this;
}

TraceScope::~TraceScope() {
  innermost = outer_;
}

std::string TraceScope::trace_id() const {
  return std::string(TraceIdOf(traceparent_));
}

std::string NextTraceparent() {
  return ChildTraceparent(innermost == nullptr ? DefaultTraceparent() : innermost->traceparent(), Entropy);
}

}  // namespace abi0
}  // namespace planish
