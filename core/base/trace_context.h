// W3C Trace Context, level 1 (https://www.w3.org/TR/trace-context-1/): the header "traceparent", which identifies a
// request across programs and logs.
#pragma once

#include <cstdint>
#include <functional>
#include <string>
#include <string_view>

namespace planish {

// Returns 64 random bits.
using RandomBits = std::function<std::uint64_t()>;

// `header` as version 00, "00-TRACE-SPAN-FLAGS" with 32, 16 and 2 lower-case hex digits. "" if it is malformed, its
// version is ff, or an id is all zeros. Cuts off what later versions append, as the standard demands.
std::string ParseTraceparent(std::string_view header);

// The 32 digits of the trace id in a valid traceparent; "" for any other text.
std::string_view TraceIdOf(std::string_view traceparent);

// A traceparent of a new trace, which is marked as sampled.
std::string NewTraceparent(const RandomBits& random);

// A traceparent with the trace of `parent`, which must be valid, and a new span id.
std::string ChildTraceparent(std::string_view parent, const RandomBits& random);

}  // namespace planish
