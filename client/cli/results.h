// What a command prints at its end: as JSON for programs, and as text for people.
#pragma once

#include <string>
#include <vector>

#include "client/cli/text.h"
#include "nlohmann/json.hpp"
#include "planish/client.h"

namespace planish::cli {

using Json = nlohmann::ordered_json;

// JSON on one line; bytes that are not UTF-8 (file names may have them) are replaced.
std::string ToLine(const Json& json);
// The same on several indented lines, with a line break at the end.
std::string ToText(const Json& json);

// `text` with U+FFFD in place of bytes that are not UTF-8, which strings of the proto must not have.
std::string ValidUtf8(const std::string& text);

Json ToJson(const Job& job);
Json ToJson(const Event& event);
Json ToJson(const JobEstimate& estimate);
Json ToJson(const Capabilities& capabilities);

// The report object of a job that succeeded, made from `report` instead of result.report. `output` is left out if it is
// empty. `atlas_names`: the names of atlases by their numbers; may be empty.
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
  bool verbose = false;                       // also describe the solve, and every warning
  double start_seconds = 0;                   // how much of the total time a private server took to start; 0: none
  std::vector<std::string> atlas_names = {};  // by number
  // The places in the files of each warning of the report (Places(), mesh_input.h). May be shorter than the list of
  // warnings.
  std::vector<std::string> places = {};
};

// The result as text: charts, texture, stretch, seams and faults, in a few lines for any number of charts; if there are
// several atlases, a line for each of the first 20; the first few warnings of each kind; and why the result is not
// usable, if it is not. With `verbose` also Newton's method, the seconds of each stage, memory and the largest charts.
std::string Summary(const Report& report, const SummaryOptions& options, const Terminal& terminal);

// Why the result is not usable; empty if it is.
std::string WhyNotUsable(const Report& report);

// "planish: error: ..." with the `places` in the file, if any, and for some errors a hint what to do.
std::string ErrorText(const Error& error, const std::string& places, const Terminal& terminal);

}  // namespace planish::cli
