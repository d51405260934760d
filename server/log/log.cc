#include "server/log/log.h"

#include <memory>
#include <mutex>
#include <string>

#include "server/log/line_format.h"
#include "spdlog/pattern_formatter.h"
#include "spdlog/sinks/stdout_color_sinks.h"
#include "spdlog/spdlog.h"

namespace planish {
namespace {

// The fields of the line that this thread is writing: spdlog formats it before Log() returns.
thread_local const LogFields* fields_of_line = nullptr;

const LogFields& Fields() {
  static const auto* none = new LogFields();
  return fields_of_line == nullptr ? *none : *fields_of_line;
}

absl::string_view View(const spdlog::string_view_t& text) {
  return {text.data(), text.size()};
}

// Formats all lines, also those that a library passes to spdlog directly.
class LineFormatter : public spdlog::formatter {
 public:
  explicit LineFormatter(LogFormat format) : format_(format) {}

  void format(const spdlog::details::log_msg& line, spdlog::memory_buf_t& out) override {
    const auto append = [&out](absl::string_view text) { out.append(text.data(), text.data() + text.size()); };
    const absl::string_view level = View(spdlog::level::to_string_view(line.level));
    if (format_ == LogFormat::kJson) {
      append(JsonLine(line.time, level, View(line.payload), Fields()));
    } else {
      time_.format(line, out);
      line.color_range_start = out.size();
      append(level);
      line.color_range_end = out.size();
      append(" ");
      append(HumanText(View(line.payload), Fields()));
    }
    append("\n");
  }

  std::unique_ptr<spdlog::formatter> clone() const override { return std::make_unique<LineFormatter>(format_); }

 private:
  const LogFormat format_;
  spdlog::pattern_formatter time_{"%Y-%m-%dT%H:%M:%S.%e%z ", spdlog::pattern_time_type::local, ""};
};

spdlog::level::level_enum ToSpdlog(LogLevel level) {
  switch (level) {
    case LogLevel::kDebug:
      return spdlog::level::debug;
    case LogLevel::kInfo:
      return spdlog::level::info;
    case LogLevel::kWarn:
      return spdlog::level::warn;
    case LogLevel::kError:
      return spdlog::level::err;
    case LogLevel::kOff:
      break;
  }
  return spdlog::level::off;
}

}  // namespace

void SetUpLog(LogFormat format, LogLevel level) {
  static std::once_flag made;
  std::call_once(made, [] { spdlog::set_default_logger(spdlog::stderr_color_mt("planishd")); });
  spdlog::set_formatter(std::make_unique<LineFormatter>(format));
  spdlog::set_level(ToSpdlog(level));
}

void Log(LogLevel level, absl::string_view message, const LogFields& fields) {
  spdlog::logger* const logger = spdlog::default_logger_raw();
  const spdlog::level::level_enum spdlog_level = ToSpdlog(level);
  if (!logger->should_log(spdlog_level)) return;
  fields_of_line = &fields;
  logger->log(spdlog_level, spdlog::string_view_t(message.data(), message.size()));
  fields_of_line = nullptr;
}

}  // namespace planish
