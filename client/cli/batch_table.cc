#include "client/cli/batch_table.h"

#include <algorithm>
#include <array>

#include "client/cli/text.h"

namespace planish::cli {
namespace {

constexpr int kNarrowestName = 12;
constexpr std::size_t kColumns = 5;
using Cells = std::array<std::string, kColumns>;

const char* ColorOf(BatchResult result) {
  switch (result) {
    case BatchResult::kUsable:
      return "\x1b[32m";
    case BatchResult::kQueued:
      return "\x1b[36m";
    case BatchResult::kNotUsable:
    case BatchResult::kFailed:
      return "\x1b[31m";
    default:
      return "\x1b[33m";
  }
}

std::string Mark(BatchResult result, bool utf8) {
  switch (result) {
    case BatchResult::kUsable:
      return utf8 ? "✓" : "+";
    case BatchResult::kNotUsable:
    case BatchResult::kFailed:
      return utf8 ? "✗" : "x";
    case BatchResult::kQueued:
      return utf8 ? "…" : ".";
    default:
      return "-";
  }
}

// The text of the last column.
std::string ResultText(const BatchRow& row) {
  std::string text;
  switch (row.result) {
    case BatchResult::kUsable:
      text = row.warnings > 0 ? "ok, " + Counted(static_cast<std::int64_t>(row.warnings), "warning", "warnings") : "ok";
      break;
    case BatchResult::kNotUsable:
      text = "not usable: " + row.message;
      break;
    case BatchResult::kFailed:
      text = "failed: " + row.reason;
      break;
    case BatchResult::kCancelled:
      text = "cancelled";
      break;
    case BatchResult::kQueued:
      text = "queued: " + row.reason;
      break;
    case BatchResult::kNotTried:
      text = "not tried";
      break;
  }
  return row.kept ? text + ", done before" : text;
}

bool HasUv(const BatchRow& row) {
  return row.result == BatchResult::kUsable || row.result == BatchResult::kNotUsable;
}

Cells CellsOf(const BatchRow& row, bool utf8) {
  const bool ran = HasUv(row);
  return {Printable(row.name, utf8), row.triangles > 0 ? WithCommas(row.triangles) : "-",
          ran ? WithCommas(row.charts) : "-", row.seconds > 0 ? Fixed(row.seconds, 2) : "-", ResultText(row)};
}

std::string Line(const Cells& cells, const std::array<int, kColumns>& widths, bool utf8) {
  std::string line = Padded(CutToWidth(cells[0], widths[0], utf8), widths[0]);
  for (std::size_t c = 1; c + 1 < kColumns; ++c) line += "  " + Padded(cells[c], widths[c], true);
  return line + "  ";
}

std::string TotalsText(const BatchTotals& totals) {
  std::string text = Counted(totals.files, "file", "files") + ": " + WithCommas(totals.usable) + " usable";
  const auto add = [&text](int count, const char* what) {
    if (count > 0) text += ", " + WithCommas(count) + what;
  };
  add(totals.not_usable, " not usable");
  add(totals.failed, " failed");
  add(totals.cancelled, " cancelled");
  add(totals.queued, " queued");
  add(totals.not_tried, " not tried");
  if (totals.kept > 0) text += " (" + WithCommas(totals.kept) + " done before)";
  return text + "; " + Counted(totals.triangles, "triangle", "triangles") + " in " + Duration(totals.seconds) + ".\n";
}

}  // namespace

const char* ToString(BatchResult result) {
  switch (result) {
    case BatchResult::kUsable:
      return "usable";
    case BatchResult::kNotUsable:
      return "not_usable";
    case BatchResult::kFailed:
      return "failed";
    case BatchResult::kCancelled:
      return "cancelled";
    case BatchResult::kQueued:
      return "queued";
    case BatchResult::kNotTried:
      return "not_tried";
  }
  return "";
}

BatchTotals TotalsOf(const std::vector<BatchRow>& rows, double seconds) {
  BatchTotals totals;
  totals.files = static_cast<int>(rows.size());
  totals.seconds = seconds;
  for (const BatchRow& row : rows) {
    totals.usable += row.result == BatchResult::kUsable;
    totals.not_usable += row.result == BatchResult::kNotUsable;
    totals.failed += row.result == BatchResult::kFailed;
    totals.cancelled += row.result == BatchResult::kCancelled;
    totals.queued += row.result == BatchResult::kQueued;
    totals.not_tried += row.result == BatchResult::kNotTried;
    totals.kept += row.kept;
    if (HasUv(row)) totals.triangles += row.triangles;
  }
  return totals;
}

std::string RowLine(const BatchRow& row, const Terminal& terminal) {
  std::string line = Colored(terminal, ColorOf(row.result), Mark(row.result, terminal.utf8)) + " " +
                     Printable(row.name, terminal.utf8) + "  ";
  if (!HasUv(row)) {
    if (row.message.empty()) return line + ResultText(row);
    return line + row.message + (row.reason.empty() ? "" : " [" + row.reason + "]");
  }
  line += Counted(row.triangles, "triangle", "triangles") + ", " + Counted(row.charts, "chart", "charts") + ", " +
          Duration(row.seconds);
  const std::string result = ResultText(row);
  return result == "ok" ? line : line + "; " + result;
}

std::string BatchTable(const std::vector<BatchRow>& rows, const BatchTotals& totals, const Terminal& terminal) {
  const bool only_bad = rows.size() > kMostBatchRows;
  std::vector<const BatchRow*> shown;
  for (const BatchRow& row : rows) {
    if (!only_bad || row.result != BatchResult::kUsable) shown.push_back(&row);
  }
  const Cells heading = {"FILE", "TRIANGLES", "CHARTS", "SECONDS", "RESULT"};
  std::array<int, kColumns> widths = {};
  for (std::size_t c = 0; c < kColumns; ++c) widths[c] = DisplayWidth(heading[c]);
  for (const BatchRow* row : shown) {
    const Cells cells = CellsOf(*row, terminal.utf8);
    for (std::size_t c = 0; c < kColumns; ++c) widths[c] = std::max(widths[c], DisplayWidth(cells[c]));
  }
  if (terminal.is_tty) {
    int others = 0;
    for (std::size_t c = 1; c < kColumns; ++c) others += widths[c] + 2;
    widths[0] = std::min(widths[0], std::max(kNarrowestName, terminal.width - 1 - others));
  }
  std::string text;
  if (!shown.empty()) text += Line(heading, widths, terminal.utf8) + heading.back() + "\n";
  for (const BatchRow* row : shown) {
    const Cells cells = CellsOf(*row, terminal.utf8);
    text += Line(cells, widths, terminal.utf8) + Colored(terminal, ColorOf(row->result), cells.back()) + "\n";
  }
  if (only_bad && totals.usable > 0) {
    text +=
        "(" + Counted(totals.usable, "usable file is", "usable files are") + " left out here; --json has them all)\n";
  }
  return text + TotalsText(totals);
}

Json SummaryJson(const BatchTotals& totals, const BatchPlan& plan, int exit_code) {
  return {{"summary",
           {{"files", totals.files},
            {"usable", totals.usable},
            {"not_usable", totals.not_usable},
            {"failed", totals.failed},
            {"cancelled", totals.cancelled},
            {"queued", totals.queued},
            {"not_tried", totals.not_tried},
            {"kept", totals.kept},
            {"skipped", plan.skipped},
            {"triangles", totals.triangles},
            {"seconds", totals.seconds},
            {"exit_code", exit_code}}}};
}

int BatchExitCode(const std::vector<BatchRow>& rows, bool interrupted, bool server_lost) {
  if (interrupted) return kInterrupted;
  if (server_lost) return kServerUnreachable;
  if (std::all_of(rows.begin(), rows.end(), [](const BatchRow& row) { return row.exit_code == kUsage; })) return kUsage;
  const bool all_well = std::all_of(rows.begin(), rows.end(), [](const BatchRow& row) { return row.exit_code == kOk; });
  return all_well ? kOk : kFailed;
}

}  // namespace planish::cli
