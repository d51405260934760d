// A line of the log as text.
#pragma once

#include <chrono>
#include <string>

#include "absl/strings/string_view.h"
#include "server/log/log.h"

namespace planish {

using LogTime = std::chrono::system_clock::time_point;

// One JSON object without a line break. Bytes that are not UTF-8 become U+FFFD, numbers that JSON cannot represent
// become null.
std::string JsonLine(LogTime time, absl::string_view level, absl::string_view message, const LogFields& fields);

// The part after time and level in lines for people: the job, the message, the fields as key=value. Control characters
// are escaped, so that no text can begin a new line or move a terminal's cursor. Values that need quotes get them, with
// quotes inside escaped.
std::string HumanText(absl::string_view message, const LogFields& fields);

}  // namespace planish
