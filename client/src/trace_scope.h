// The trace that calls to a server belong to.
#pragma once

#include <string>

namespace planish {
inline namespace abi0 {

// While it lives, calls made on this thread belong to one trace. Scopes nest: the inner one counts.
class TraceScope {
 public:
  // `traceparent` (W3C) is continued; if empty, the environment's TRACEPARENT where it is valid, or else a new
  // trace. Throws INVALID_ARGUMENT with TRACEPARENT_INVALID.
  explicit TraceScope(const std::string& traceparent);
  ~TraceScope();
  TraceScope(const TraceScope&) = delete;
  TraceScope& operator=(const TraceScope&) = delete;

  // 32 hex digits.
  std::string trace_id() const;
  // For a scope on another thread.
  const std::string& traceparent() const { return traceparent_; }

 private:
  std::string traceparent_;
  const TraceScope* const outer_;
};

// What the next call on this thread sends: a new span of the scope's trace or, outside of any, of the environment's or
// of a new one.
std::string NextTraceparent();

}  // namespace abi0
}  // namespace planish
