// The results of a batch, in words and as JSON. Pure functions.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "client/cli/batch_plan.h"
#include "client/cli/exit_codes.h"
#include "client/cli/results.h"
#include "client/cli/text.h"

namespace planish::cli {

enum class BatchResult {
  kUsable,
  kNotUsable,  // written even so
  kFailed,
  kCancelled,  // by Ctrl-C, or by somebody on the server
  kQueued,     // --detach: on the server
  kNotTried,   // the run ended before
};
// "usable", "not_usable", ...
const char* ToString(BatchResult result);

struct BatchRow {
  std::string name;
  BatchResult result = BatchResult::kNotTried;
  bool kept = false;  // done by an earlier run
  std::int64_t triangles = 0;
  int charts = 0;
  double seconds = 0;  // without the wait for a worker
  std::size_t warnings = 0;
  std::string reason;        // of a failure: "FILE_MALFORMED"; the name of a job that is queued
  std::string message;       // a sentence: why it failed or is not usable
  ExitCode exit_code = kOk;  // as if the file had been the only one
  Json card;                 // of its page (report_page.h), if there is one
};

struct BatchTotals {
  int files = 0, usable = 0, not_usable = 0, failed = 0, cancelled = 0, queued = 0, not_tried = 0;
  int kept = 0;                // of the usable and not usable ones
  std::int64_t triangles = 0;  // of the usable and not usable ones
  double seconds = 0;          // of the whole run
};
BatchTotals TotalsOf(const std::vector<BatchRow>& rows, double seconds);

// "✓ a.obj  23,062 triangles, 12 charts, 0.82 s", without line break.
std::string RowLine(const BatchRow& row, const Terminal& terminal);

// A line per file under a heading, and the totals. With more than kMostBatchRows files, only files without a usable map
// get a line. Names are cut to the terminal's width, if there is one.
inline constexpr std::size_t kMostBatchRows = 100;
std::string BatchTable(const std::vector<BatchRow>& rows, const BatchTotals& totals, const Terminal& terminal);

// {"summary": {...}}
Json SummaryJson(const BatchTotals& totals, const BatchPlan& plan, int exit_code);

// 130 if interrupted, 3 if the server went away for good, 2 if every single file is unreadable or asks for what cannot
// be, 1 if some file failed, was cancelled or is not usable.
int BatchExitCode(const std::vector<BatchRow>& rows, bool interrupted, bool server_lost);

}  // namespace planish::cli
