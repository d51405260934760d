// The log of planishd, on stderr: messages with fields.
//
//   human  2026-11-21T19:30:13.123+00:00 warning jobs/1a2b FAILED tenant=farm ran=0.012s message="not a mesh"
//   json   {"time":"2026-11-21T19:30:13.123Z","level":"warning","message":"FAILED","job":"jobs/1a2b","tenant":"farm",
//           "ran_seconds":0.012,...}   (one object a line, valid UTF-8 whatever the texts hold)
#pragma once

#include <cstdint>
#include <initializer_list>
#include <string>
#include <type_traits>
#include <variant>
#include <vector>

#include "absl/strings/string_view.h"

namespace planish {

enum class LogFormat { kHuman, kJson };

enum class LogLevel { kDebug, kInfo, kWarn, kError, kOff };

// A number, a Boolean or a text that belongs to a message. Keys are words of a-z and '_'; "time", "level" and "message"
// are reserved. Fields with empty texts are left out. "job", "tenant" and "trace" say what the line is about. In the
// format for people the job comes before the message.
struct LogField {
  LogField(absl::string_view k, absl::string_view v) : key(k), value(std::string(v)) {}
  LogField(absl::string_view k, const char* v) : key(k), value(std::string(v)) {}
  LogField(absl::string_view k, const std::string& v) : key(k), value(v) {}
  LogField(absl::string_view k, bool v) : key(k), value(v) {}
  LogField(absl::string_view k, double v) : key(k), value(v) {}
  template <class Integer, std::enable_if_t<std::is_integral_v<Integer> && !std::is_same_v<Integer, bool>, int> = 0>
  LogField(absl::string_view k, Integer v) : key(k), value(static_cast<std::int64_t>(v)) {}

  std::string key;
  std::variant<std::string, std::int64_t, double, bool> value;
};

using LogFields = std::vector<LogField>;

// Sets or changes format and level. Before the first call lines have spdlog's default format. Thread-safe.
void SetUpLog(LogFormat format, LogLevel level);

// Writes a line if `level` is at least the level of the log. Thread-safe.
void Log(LogLevel level, absl::string_view message, const LogFields& fields = {});

inline void LogDebug(absl::string_view message, const LogFields& fields = {}) {
  Log(LogLevel::kDebug, message, fields);
}
inline void LogInfo(absl::string_view message, const LogFields& fields = {}) {
  Log(LogLevel::kInfo, message, fields);
}
inline void LogWarn(absl::string_view message, const LogFields& fields = {}) {
  Log(LogLevel::kWarn, message, fields);
}
inline void LogError(absl::string_view message, const LogFields& fields = {}) {
  Log(LogLevel::kError, message, fields);
}

}  // namespace planish
