// The JSON that planish prints.
#pragma once

#include <string>

#include "nlohmann/json.hpp"
#include "planish/client.h"

namespace planish::cli {

using Json = nlohmann::ordered_json;

// On one line; bytes that are not UTF-8 (file names) are replaced.
std::string ToLine(const Json& json);
// Indented, with a line break at the end.
std::string ToText(const Json& json);

// `text` with U+FFFD in place of bytes that are not UTF-8: what may travel as a string.
std::string ValidUtf8(const std::string& text);

Json ToJson(const Job& job);
Json ToJson(const Event& event);
Json ToJson(const JobEstimate& estimate);
Json ToJson(const Capabilities& capabilities);

// The report object of a job that succeeded, with `report` in place of the result's own. `output` is left out if empty.
Json ReportJson(const UnwrapResult& result, const Report& report, const std::string& output);

// What is known of a job that did not.
struct Failure {
  std::string job;
  std::string trace_id;
  JobState state = JobState::kFailed;
  std::string code;
  std::string reason;
  std::string message;
  std::map<std::string, std::string> metadata;
  std::int64_t triangles = 0;
  std::int64_t vertices = 0;
  double total_seconds = 0;
};
Failure FailureOf(const Error& error);
Json ReportJson(const Failure& failure);

}  // namespace planish::cli
