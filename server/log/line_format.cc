#include "server/log/line_format.h"

#include <algorithm>

#include "absl/strings/escaping.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "nlohmann/json.hpp"

namespace planish {
namespace {

using Json = nlohmann::ordered_json;

std::string UtcTime(LogTime time) {
  const auto since = std::chrono::duration_cast<std::chrono::milliseconds>(time.time_since_epoch()).count();
  const std::time_t seconds = static_cast<std::time_t>(since / 1000);
  std::tm parts = {};
  gmtime_r(&seconds, &parts);
  return absl::StrFormat("%04d-%02d-%02dT%02d:%02d:%02d.%03dZ", parts.tm_year + 1900, parts.tm_mon + 1, parts.tm_mday,
                         parts.tm_hour, parts.tm_min, parts.tm_sec, static_cast<int>(since % 1000));
}

const std::string* TextOf(const LogField& field) {
  return std::get_if<std::string>(&field.value);
}

bool IsEmpty(const LogField& field) {
  const std::string* text = TextOf(field);
  return text != nullptr && text->empty();
}

bool IsControl(char c) {
  return static_cast<unsigned char>(c) < ' ' || c == '\x7f';
}

// Whether a value needs quotes. Words, names and numbers do not.
bool NeedsQuotes(const std::string& text) {
  return std::any_of(text.begin(), text.end(),
                     [](char c) { return IsControl(c) || c == ' ' || c == '"' || c == '=' || c == '\\'; });
}

std::string ValueText(const LogField& field) {
  if (const std::string* text = TextOf(field)) {
    return NeedsQuotes(*text) ? absl::StrCat("\"", absl::Utf8SafeCEscape(*text), "\"") : *text;
  }
  if (const auto* number = std::get_if<std::int64_t>(&field.value)) return absl::StrCat(*number);
  if (const auto* number = std::get_if<double>(&field.value)) return absl::StrFormat("%.6g", *number);
  return std::get<bool>(field.value) ? "true" : "false";
}

// Escapes control characters. Unlike in fields, quotes are not escaped.
std::string Visible(absl::string_view text) {
  std::string visible;
  for (const char c : text) {
    if (IsControl(c)) {
      absl::StrAppend(&visible, absl::CEscape(absl::string_view(&c, 1)));
    } else {
      visible += c;
    }
  }
  return visible;
}

}  // namespace

std::string JsonLine(LogTime time, absl::string_view level, absl::string_view message, const LogFields& fields) {
  Json line = {{"time", UtcTime(time)}, {"level", std::string(level)}, {"message", std::string(message)}};
  for (const LogField& field : fields) {
    if (IsEmpty(field)) continue;
    std::visit([&](const auto& value) { line[field.key] = value; }, field.value);
  }
  return line.dump(-1, ' ', false, Json::error_handler_t::replace);
}

std::string HumanText(absl::string_view message, const LogFields& fields) {
  std::string text;
  for (const LogField& field : fields) {
    if (field.key == "job" && !IsEmpty(field)) absl::StrAppend(&text, ValueText(field), " ");
  }
  absl::StrAppend(&text, Visible(message));
  for (const LogField& field : fields) {
    if (field.key != "job" && !IsEmpty(field)) absl::StrAppend(&text, " ", field.key, "=", ValueText(field));
  }
  return text;
}

}  // namespace planish
