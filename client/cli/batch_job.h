// One file of a batch, from its bytes to its output and the record of it.
#pragma once

#include <optional>
#include <stop_token>
#include <string>

#include "client/cli/batch_plan.h"
#include "client/cli/batch_queue.h"
#include "client/cli/batch_state.h"
#include "client/cli/batch_table.h"
#include "client/cli/json.h"
#include "client/cli/report_sheet.h"
#include "planish/client.h"

namespace planish::cli {

// What all files share.
struct BatchContext {
  const Arguments& arguments;
  BatchState& state;
  Client& client;
  BatchQueue& queue;                   // of the same client
  const ReportSheet* sheet = nullptr;  // where pages go; null: nowhere
  std::string settings;                // SettingsDigest
  std::string version;                 // BatchRecord::version
  // Cancels attached jobs on the server; those that are detached go on.
  std::stop_token stop;
};

struct BatchEnd {
  BatchRow row;
  Json json;                            // for --json
  std::optional<Error> server_error;    // there was no server: the file may be tried again
  std::optional<double> queue_seconds;  // of a job that ran
};

// Looks whether the file is done and current; if not, fetches the result of the job that an earlier run has queued for
// it, or else has it done; or, with --detach, only queues it. Whatever fails is in the row. `callbacks` as in
// planish/client.h. Thread-safe for different items.
BatchEnd DoBatchItem(const BatchContext& context, const BatchItem& item, const Callbacks& callbacks);

// Waits; false if the stop came first.
bool PauseUnlessStopped(const std::stop_token& stop, double seconds);

// Of a file that was not tried.
BatchEnd NotTried(const BatchItem& item);

}  // namespace planish::cli
