// A line of the log as text.
#pragma once

#include <chrono>
#include <string>

#include "absl/strings/string_view.h"
#include "server/log/log.h"

namespace planish {

using LogTime = std::chrono::system_clock::time_point;

// One JSON object without a line break. Bytes that are not UTF-8 become U+FFFD, numbers that JSON has not become null.
std::string JsonLine(LogTime time, absl::string_view level, absl::string_view message, const LogFields& fields);

// What follows time and level for people: the job, the message, the fields as key=value. Control characters, also those
// that would begin a new line or move a terminal's cursor, are escaped; so are quotes in texts that need them.
std::string HumanText(absl::string_view message, const LogFields& fields);

}  // namespace planish
