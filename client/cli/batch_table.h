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
  kNotUsable,  // the map is not usable, but was written
  kFailed,
  kCancelled,  // by Ctrl-C, or by somebody on the server
  kQueued,     // with --detach: queued on the server
  kNotTried,   // the run ended before this file
};
// "usable", "not_usable", ...
const char* ToString(BatchResult result);

struct BatchRow {
  std::string name;
  BatchResult result = BatchResult::kNotTried;
  bool kept = false;  // the file was done by an earlier run
  std::int64_t triangles = 0;
  int charts = 0;
  double seconds = 0;  // without the wait for a worker
  std::size_t warnings = 0;
  std::string reason;        // of a failure, e.g. "FILE_MALFORMED"; for a queued job: its name
  std::string message;       // a sentence: why it failed or is not usable
  ExitCode exit_code = kOk;  // the exit code of a command for this file alone
  Json card;                 // figures and picture for the contact sheet (report_page.h); null without a page
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
// get a line. On a terminal, names are cut to fit its width.
inline constexpr std::size_t kMostBatchRows = 100;
std::string BatchTable(const std::vector<BatchRow>& rows, const BatchTotals& totals, const Terminal& terminal);

// {"summary": {...}}
Json SummaryJson(const BatchTotals& totals, const BatchPlan& plan, int exit_code);

// 130 if interrupted; 3 if the server became unreachable for good; 2 if every file failed with exit code 2 (unreadable,
// or impossible options); 1 if some file failed, was cancelled or is not usable; otherwise 0.
int BatchExitCode(const std::vector<BatchRow>& rows, bool interrupted, bool server_lost);

}  // namespace planish::cli
