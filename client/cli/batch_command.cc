#include <algorithm>
#include <iostream>
#include <memory>
#include <optional>
#include <stop_token>
#include <thread>

#include "client/cli/batch_job.h"
#include "client/cli/batch_plan.h"
#include "client/cli/batch_table.h"
#include "client/cli/exit_codes.h"
#include "client/cli/mesh_input.h"
#include "client/cli/progress_view.h"
#include "client/cli/results.h"
#include "client/cli/session.h"
#include "client/cli/text.h"
#include "client/cli/unwrap_arguments.h"
#include "core/base/timer.h"

namespace planish::cli {
namespace {

// How long the batch waits for a server that does not answer, for instance because it restarts.
constexpr double kServerPatienceSeconds = 30;

ServerNeeds NeedsOf(const UnwrapArguments& arguments, const BatchPlan& plan) {
  ServerNeeds needs;
  const unsigned cores = std::max(1u, std::thread::hardware_concurrency());
  needs.workers = static_cast<int>(std::min<std::size_t>(cores, plan.items.size()));
  needs.threads = arguments.map.options.threads;
  // With --detach the batch itself retries when the queue is full. Otherwise the client retries, without limit.
  needs.client.queue_full_timeout = Seconds(arguments.detach ? 0 : 1e9);
  return needs;
}

std::string NextStep(const BatchTotals& totals, const BatchRun& run, bool interrupted) {
  if (interrupted) return "planish: interrupted; the same command goes on where this one ended\n";
  if (run.server_lost()) return "planish: the server is gone; the same command goes on where this one ended\n";
  if (totals.queued > 0) return "Queued. The same command fetches the results; without --detach it waits for them.\n";
  return "";
}

std::vector<SheetRow> SheetRows(const BatchPlan& plan, const std::vector<BatchRow>& rows) {
  std::vector<SheetRow> sheet;
  for (std::size_t i = 0; i < rows.size(); ++i) {
    const BatchRow& row = rows[i];
    SheetRow& entry = sheet.emplace_back();
    entry.name = row.name;
    entry.result = ToString(row.result);
    entry.message = row.message;
    entry.card = row.card;
    if (row.card.is_object()) {
      entry.page = ReportSheet::PageOf(plan.items[i].key);
      entry.seconds = row.seconds;
    }
    entry.triangles = row.triangles;
  }
  return sheet;
}

int RunPlan(const UnwrapArguments& arguments, Interrupts& interrupts, const BatchPlan& plan) {
  const Timer timer;
  if (!arguments.terminal.quiet) std::cerr << SkippedText(plan);
  MakeDirectory(arguments.output.path);
  BatchState state(arguments.output.path);
  ServerChoice server(arguments.server, interrupts, NeedsOf(arguments, plan));
  const Capabilities capabilities = server.client().GetCapabilities();

  std::optional<ReportSheet> sheet;
  if (!arguments.report.empty()) sheet.emplace(arguments.report).Prepare();
  BatchQueue queue(&server.client());
  std::stop_source stop;
  const BatchContext context{arguments,
                             state,
                             server.client(),
                             queue,
                             sheet ? &*sheet : nullptr,
                             SettingsDigest(arguments),
                             std::string(Version()) + " " + capabilities.version,
                             stop.get_token()};
  BatchRunOptions options;
  options.workers = capabilities.workers;
  options.server_patience_seconds = server.private_server() != nullptr ? 0 : kServerPatienceSeconds;
  options.print_json = arguments.json;
  std::vector<std::string> names;
  for (const BatchItem& item : plan.items) names.push_back(item.name);
  const std::unique_ptr<ProgressView> view = NewProgressView(arguments.terminal, names, /*is_batch=*/true);
  if (arguments.terminal.verbose) view->Say(Printable(server.Description(), true));
  BatchRun run(context, plan, options, *view);
  interrupts.SetCancel([&]() {
    view->OnNotice(arguments.detach ? "interrupted" : "cancelling what is in flight; Ctrl-C again leaves at once");
    stop.request_stop();
  });
  const std::vector<BatchRow> rows = run.Run();
  interrupts.SetCancel({});
  view->Finish();

  const BatchTotals totals = TotalsOf(rows, timer.Seconds());
  int exit_code = BatchExitCode(rows, interrupts.interrupted(), run.server_lost());
  try {
    if (sheet) sheet->Write(SheetRows(plan, rows));
  } catch (const Error& error) {
    // The meshes are written already, so the batch goes on to its summary.
    std::cerr << ErrorText(error, "", StderrTerminal());
    if (exit_code == kOk) exit_code = kFailed;
  }
  if (!arguments.terminal.quiet || exit_code != kOk) {
    std::cerr << BatchTable(rows, totals, StderrTerminal()) << NextStep(totals, run, interrupts.interrupted());
  }
  if (arguments.json) std::cout << ToLine(SummaryJson(totals, plan, exit_code)) + "\n" << std::flush;
  return exit_code;
}

}  // namespace

int RunBatch(const UnwrapArguments& arguments, Interrupts& interrupts) {
  BatchPlan plan;
  try {
    plan = PlanBatch({arguments.inputs.All(), arguments.output.path, arguments.format, arguments.texcoord});
    return RunPlan(arguments, interrupts, plan);
  } catch (const Error& error) {
    // The batch failed before it tried a file.
    const int exit_code = ExitCodeOf(error);
    std::cerr << ErrorText(error, "", StderrTerminal());
    if (arguments.json) {
      std::vector<BatchRow> rows(plan.items.size());
      Json json = SummaryJson(TotalsOf(rows, 0), plan, exit_code);
      json["error"] = ReportJson(FailureOf(error))["error"];
      std::cout << ToLine(json) + "\n" << std::flush;
    }
    return exit_code;
  }
}

}  // namespace planish::cli
