#include "core/base/trace_context.h"

#include <algorithm>
#include <cstdio>

namespace planish {
namespace {

constexpr std::size_t kTrace = 3, kTraceDigits = 32;
constexpr std::size_t kSpan = 36, kSpanDigits = 16;
constexpr std::size_t kFlags = 53;
constexpr std::size_t kLength = 55;

bool IsHex(std::string_view text) {
  return std::all_of(text.begin(), text.end(), [](char c) { return (c >= '0' && c <= '9') || (c >= 'a' && c <= 'f'); });
}

bool IsZero(std::string_view text) {
  return text.find_first_not_of('0') == std::string_view::npos;
}

// 16 digits that are not all zeros.
std::string RandomId(const RandomBits& random) {
  std::uint64_t bits = 0;
  while (bits == 0) bits = random();
  char text[kSpanDigits + 1];
  std::snprintf(text, sizeof text, "%016llx", static_cast<unsigned long long>(bits));
  return text;
}

}  // namespace

std::string ParseTraceparent(std::string_view header) {
  if (header.size() < kLength) return "";
  const std::string_view version = header.substr(0, 2);
  const bool has_more = header.size() > kLength;
  if (!IsHex(version) || version == "ff" || (has_more && (version == "00" || header[kLength] != '-'))) return "";
  const std::string_view trace = header.substr(kTrace, kTraceDigits), span = header.substr(kSpan, kSpanDigits);
  const std::string_view flags = header.substr(kFlags, 2);
  if (header[kTrace - 1] != '-' || header[kSpan - 1] != '-' || header[kFlags - 1] != '-') return "";
  if (!IsHex(trace) || !IsHex(span) || !IsHex(flags) || IsZero(trace) || IsZero(span)) return "";
  return "00" + std::string(header.substr(2, kLength - 2));
}

std::string_view TraceIdOf(std::string_view traceparent) {
  if (ParseTraceparent(traceparent).empty()) return "";
  return traceparent.substr(kTrace, kTraceDigits);
}

std::string NewTraceparent(const RandomBits& random) {
  const std::string high = RandomId(random);
  const std::string low = RandomId(random);
  return "00-" + high + low + "-" + RandomId(random) + "-01";
}

std::string ChildTraceparent(std::string_view parent, const RandomBits& random) {
  std::string child(parent);
  return child.replace(kSpan, kSpanDigits, RandomId(random));
}

}  // namespace planish
