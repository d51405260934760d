// What a command says at its end: as JSON, and for people.
#pragma once

#include <string>
#include <vector>

#include "client/cli/text.h"
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
// `atlas_names`: of Atlas::atlases by their numbers, where they are known.
Json ReportJson(const UnwrapResult& result, const Report& report, const std::string& output,
                const std::vector<std::string>& atlas_names = {});

// The data of a job that failed.
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

struct SummaryOptions {
  std::string output = "";                    // the file that was written; empty: none
  bool verbose = false;                       // also how it was solved, and every warning
  double start_seconds = 0;                   // seconds of the total until a private server was ready; 0 without one
  std::vector<std::string> atlas_names = {};  // by number
  // Per warning of the report: its places in the files (Places(), mesh_input.h). May be shorter than the list of
  // warnings.
  std::vector<std::string> places = {};
};

// The result, for people: charts, texture, stretch, seams and faults, in a few lines for any number of charts; a line
// for each of several atlases, up to 20; the first few warnings of each kind; and, if the result is not usable, why.
// With `verbose` also Newton's method, the seconds of each stage, memory and the largest charts.
std::string Summary(const Report& report, const SummaryOptions& options, const Terminal& terminal);

// Why the result is not usable; empty if it is.
std::string WhyNotUsable(const Report& report);

// "planish: error: ..." with the `places` in the file, if any, and what can be done about it, as far as we know.
std::string ErrorText(const Error& error, const std::string& places, const Terminal& terminal);

}  // namespace planish::cli
