// The jobs of a batch: processes one file from its bytes to its output and its record, and all files, several at a
// time.
#pragma once

#include <atomic>
#include <condition_variable>
#include <cstdint>
#include <exception>
#include <functional>
#include <mutex>
#include <optional>
#include <stop_token>
#include <string>
#include <vector>

#include "client/cli/batch_plan.h"
#include "client/cli/batch_table.h"
#include "client/cli/progress_view.h"
#include "client/cli/report.h"
#include "client/cli/results.h"
#include "planish/client.h"

namespace planish::cli {

// ---- How many files are in flight, that is, in memory here and sent to the server

// Limits the number of files in flight. The limit begins with the number of the server's workers and some more, so that
// the next mesh is there when a worker becomes free. A job that did not wait raises the limit, except for the first few
// jobs; a full queue lowers it. Thread-safe.
class BatchFlight {
 public:
  // `most_bytes`: limit of the bytes of all files in flight. A single file may be larger.
  BatchFlight(int workers, std::int64_t most_bytes);

  // Upper bound of the limit, and so of the number of threads needed.
  int most() const { return most_; }
  int limit() const;

  // Waits until there is room for a file of `bytes`, and counts it as in flight. False after Stop().
  bool Enter(std::int64_t bytes);
  void Leave(std::int64_t bytes);
  // Ends all waiting in Enter(); from then on it returns false.
  void Stop();

  void OnQueueFull();
  // Reports a job that ended, and how long it had waited for a worker.
  void OnDone(double queue_seconds);

 private:
  const int most_;
  const std::int64_t most_bytes_;
  mutable std::mutex mutex_;  // guards what follows
  std::condition_variable changed_;
  int limit_;
  int in_flight_ = 0;
  int first_jobs_;  // how many of the first jobs have not ended yet: they find idle workers, and raise no limit
  std::int64_t bytes_ = 0;
  bool stopped_ = false;
};

// ---- One call for jobs of several threads

// Creates jobs on the server. Jobs that come while a call is under way wait, and share the next call. Thread-safe.
class BatchQueue {
 public:
  // `client` must outlive the queue.
  explicit BatchQueue(Client* client) : client_(client) {}

  // Like Client::CreateJob, but does not wait for room in the server's queue.
  Job Create(const NewJob& job);

 private:
  struct Waiting {
    const NewJob* job = nullptr;
    bool done = false;
    std::optional<Result<Job>> created;
    std::exception_ptr failure;  // of the whole call
  };

  // Must be called without the lock.
  void CreateTogether(const std::vector<Waiting*>& together);

  Client* const client_;
  std::mutex mutex_;
  std::condition_variable changed_;
  // Guarded by mutex_.
  std::vector<Waiting*> waiting_;
  bool busy_ = false;
};

// ---- One file, from its bytes to its output and its record

// What all files of the batch share.
struct BatchContext {
  const UnwrapArguments& arguments;
  BatchState& state;
  Client& client;
  BatchQueue& queue;                   // of the same client
  const ReportSheet* sheet = nullptr;  // where pages go; null: nowhere
  std::string settings;                // SettingsDigest
  std::string version;                 // BatchRecord::version
  // Cancels attached jobs on the server. Detached jobs go on.
  std::stop_token stop;
};

struct BatchEnd {
  BatchRow row;
  Json json;                            // for --json
  std::optional<Error> server_error;    // set if the server could not be reached: the file may be tried again
  std::optional<double> queue_seconds;  // how long the job waited for a worker, if it ran now
};

// Does nothing for a file that is up to date. Otherwise fetches the result of the job that an earlier run has queued,
// or runs a job; with --detach it only queues the job. Errors are in the row. `callbacks` as in planish/client.h;
// `on_image` is called before each image that is drawn. Thread-safe for different items.
BatchEnd DoBatchItem(const BatchContext& context, const BatchItem& item, const Callbacks& callbacks,
                     const std::function<void(const ImageProgress&)>& on_image);

// Waits; false if a stop was requested before the time was over.
bool PauseUnlessStopped(const std::stop_token& stop, double seconds);

// The result of a file that was not tried.
BatchEnd NotTried(const BatchItem& item);

// ---- All files, several at a time

struct BatchRunOptions {
  int workers = 1;                     // of the server
  double server_patience_seconds = 0;  // how long to wait for a server that does not answer
  bool print_json = false;             // a line on stdout per file as it ends
};

class BatchRun {
 public:
  // All arguments except `options` must outlive the run.
  BatchRun(const BatchContext& context, const BatchPlan& plan, const BatchRunOptions& options, ProgressView& view);

  // Returns a row per item of the plan, in the order of the plan. To be called once.
  std::vector<BatchRow> Run();

  // After the run: whether the server became unreachable for good, so that the rest of the files was not tried.
  bool server_lost() const { return server_lost_; }

 private:
  void Work();
  BatchEnd DoWithPatience(std::size_t file);
  void Record(std::size_t file, const BatchEnd& end);
  bool ShouldStop() const { return server_lost_ || context_.stop.stop_requested(); }

  const BatchContext& context_;
  const BatchPlan& plan_;
  const BatchRunOptions options_;
  ProgressView& view_;
  BatchFlight flight_;
  std::atomic<bool> server_lost_ = false;
  std::mutex mutex_;  // guards what follows, and stdout
  std::size_t next_ = 0;
  std::vector<BatchRow> rows_;
};

}  // namespace planish::cli
