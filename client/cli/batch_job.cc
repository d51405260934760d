#include "client/cli/batch_job.h"

#include <algorithm>
#include <chrono>
#include <condition_variable>
#include <cstddef>
#include <exception>
#include <filesystem>
#include <iostream>
#include <mutex>
#include <new>
#include <thread>
#include <utility>

#include "absl/strings/escaping.h"
#include "client/cli/batch_plan.h"
#include "client/cli/report.h"
#include "client/cli/results.h"
#include "client/cli/unwrap_arguments.h"
#include "client/cli/unwrap_files.h"
#include "core/base/random_id.h"
#include "core/base/sha256.h"
#include "core/base/timer.h"

namespace planish::cli {
namespace {

// A job that waited for less than this found an idle worker.
constexpr double kIdleSeconds = 0.005;
// Most threads of this command, and so most files in flight. To keep a server with more workers busy, run several
// commands.
constexpr int kMostThreads = 256;

int Spare(int workers) {
  return std::max(2, workers / 2);
}

}  // namespace

BatchFlight::BatchFlight(int workers, std::int64_t most_bytes)
    : most_(std::min(kMostThreads, 4 * std::max(1, workers))),
      most_bytes_(most_bytes),
      limit_(std::min(most_, std::max(1, workers) + Spare(workers))),
      first_jobs_(limit_) {}

int BatchFlight::limit() const {
  const std::lock_guard lock(mutex_);
  return limit_;
}

bool BatchFlight::Enter(std::int64_t bytes) {
  std::unique_lock lock(mutex_);
  changed_.wait(lock,
                [&] { return stopped_ || in_flight_ == 0 || (in_flight_ < limit_ && bytes_ + bytes <= most_bytes_); });
  if (stopped_) return false;
  ++in_flight_;
  bytes_ += bytes;
  return true;
}

void BatchFlight::Leave(std::int64_t bytes) {
  const std::lock_guard lock(mutex_);
  --in_flight_;
  bytes_ -= bytes;
  changed_.notify_all();
}

void BatchFlight::Stop() {
  const std::lock_guard lock(mutex_);
  stopped_ = true;
  changed_.notify_all();
}

void BatchFlight::OnQueueFull() {
  const std::lock_guard lock(mutex_);
  // Files that wait for room in the server's queue only use memory here.
  limit_ = std::max(1, std::min(limit_, in_flight_) - 1);
}

void BatchFlight::OnDone(double queue_seconds) {
  const std::lock_guard lock(mutex_);
  if (first_jobs_ > 0) {
    --first_jobs_;
    return;
  }
  if (queue_seconds >= kIdleSeconds) return;
  limit_ = std::min(most_, limit_ + 1);
  changed_.notify_all();
}

Job BatchQueue::Create(const NewJob& job) {
  Waiting mine;
  mine.job = &job;
  std::unique_lock lock(mutex_);
  waiting_.push_back(&mine);
  while (!mine.done) {
    if (busy_) {
      changed_.wait(lock);
      continue;
    }
    busy_ = true;
    const std::vector<Waiting*> together = std::exchange(waiting_, {});
    lock.unlock();
    CreateTogether(together);
    lock.lock();
    for (Waiting* each : together) each->done = true;
    busy_ = false;
    changed_.notify_all();
  }
  if (mine.failure) std::rethrow_exception(mine.failure);
  return std::move(*mine.created).value();
}

void BatchQueue::CreateTogether(const std::vector<Waiting*>& together) {
  try {
    std::vector<NewJob> jobs;
    for (const Waiting* each : together) jobs.push_back(*each->job);
    std::vector<Result<Job>> created = client_->CreateJobs(jobs);
    for (std::size_t i = 0; i < together.size(); ++i) together[i]->created = std::move(created[i]);
  } catch (...) {
    for (Waiting* each : together) each->failure = std::current_exception();
  }
}

namespace {

namespace fs = std::filesystem;

// The time that a job kept a worker busy.
Seconds WorkTime(const StageTimes& times) {
  return times.decode + times.charts + times.solve + times.layout + times.pack + times.verify + times.encode;
}

class BatchJob {
 public:
  BatchJob(const BatchContext& context, const BatchItem& item, const Callbacks& callbacks,
           const std::function<void(const ImageProgress&)>& on_image)
      : context_(context), arguments_(context.arguments), item_(item), callbacks_(callbacks), on_image_(on_image) {
    end_.row.name = item.name;
  }

  BatchEnd Do() {
    try {
      Try();
    } catch (const Error& error) {
      Fail(error);
    } catch (const std::bad_alloc&) {
      Fail(Error(ErrorCode::kResourceExhausted, "OUT_OF_MEMORY", item_.input + ": there is not enough memory for it"));
    } catch (const std::exception& exception) {
      Fail(Error(ErrorCode::kInternal, "INTERNAL", item_.input + ": " + exception.what()));
    }
    return std::move(end_);
  }

 private:
  void Try() {
    if (item_.problem) throw *item_.problem;
    record_.key = item_.key;
    record_.input = InputDigest(item_.input);
    record_.settings = context_.settings;
    record_.version = context_.version;
    std::string job, request_id;
    if (const auto known = context_.state.Find(item_.key); known && known->IsOf(record_) && !arguments_.again) {
      if (context_.state.IsIntact(*known)) return Keep(*known);
      if (known->queued && known->server == arguments_.server.address) job = known->job;
      // If the previous run ended between request and response, this request id returns the same job.
      if (known->server == arguments_.server.address) request_id = known->request_id;
    }
    MakeDirectory(fs::path(item_.output).parent_path());
    OutputArguments output = arguments_.output;
    output.path = item_.output;
    files_.emplace(std::vector<std::string>{item_.input}, item_.texcoord, arguments_.map, output);
    if (context_.stop.stop_requested()) throw Error(ErrorCode::kCancelled, "CANCELLED", "interrupted");
    if (!job.empty() && arguments_.detach && !HasEnded(&job)) return Queued(job);
    if (!job.empty()) {
      if (std::optional<UnwrapResult> result = Fetch(job)) return Deliver(*std::move(result), true);
    }
    if (arguments_.detach) return Queued(Queue(request_id.empty() ? NewUuid() : request_id));
    CallOptions call = Call();
    call.request_id = request_id;
    Deliver(context_.client.Unwrap(files_->view(), files_->Options(arguments_.map.options), callbacks_, call), false);
  }

  CallOptions Call() const {
    CallOptions call;
    call.scheduling = arguments_.scheduling;
    call.labels = JobLabels(arguments_.labels, item_.name);
    call.timeout = Seconds(arguments_.timeout_seconds);
    call.stop = context_.stop;
    return call;
  }

  // Whether a queued job has ended. If the server no longer knows it, clears `job` and returns true.
  bool HasEnded(std::string* job) {
    try {
      return IsTerminal(context_.client.GetJob(*job).state);
    } catch (const Error& error) {
      if (error.code() != ErrorCode::kNotFound) throw;
      job->clear();
      return true;
    }
  }

  // Returns the result of a job that an earlier run has queued; nothing if the server no longer knows the job.
  std::optional<UnwrapResult> Fetch(const std::string& job) {
    try {
      return context_.client.AttachResult(job, files_->view(), callbacks_, Call());
    } catch (const Error& error) {
      if (error.code() == ErrorCode::kNotFound) return std::nullopt;
      if (context_.stop.stop_requested() && error.code() == ErrorCode::kCancelled) {
        Queued(job);
        throw;
      }
      if (error.code() != ErrorCode::kUnavailable && error.code() != ErrorCode::kDeadlineExceeded) {
        // Records the failure, so that the next run submits the file again instead of fetching the same error.
        record_.job = job;
        context_.state.Append(record_);
      }
      throw;
    }
  }

  // Queues the job, waiting for room in the queue, and records that. Returns the name of the job.
  std::string Queue(const std::string& request_id) {
    const UnwrapOptions options = files_->Options(arguments_.map.options);
    CallOptions call = Call();
    call.request_id = request_id;
    record_.server = arguments_.server.address;
    record_.request_id = request_id;
    context_.state.Append(record_);
    record_.request_id.clear();
    for (;;) {
      try {
        const Job job = context_.queue.Create({files_->view(), options, call});
        record_.job = job.name;
        record_.queued = true;
        context_.state.Append(record_);
        return job.name;
      } catch (const Error& error) {
        if (error.reason() != "QUEUE_FULL") throw;
        const Seconds pause = std::max(Seconds(0.05), error.retry_after());
        if (callbacks_.on_reconnect) callbacks_.on_reconnect(error, pause);
        if (!PauseUnlessStopped(context_.stop, pause.count())) {
          throw Error(ErrorCode::kCancelled, "CANCELLED", "interrupted before there was room in the queue");
        }
      }
    }
  }

  // Writes the output and its record. `fetched`: the job was queued by an earlier run.
  void Deliver(UnwrapResult result, bool fetched) {
    for (const OutputFile& file : files_->WriteResult(result, on_image_, context_.stop)) {
      const fs::path place = fs::path(file.path).lexically_relative(arguments_.output.path);
      record_.files[place.generic_string()] = absl::BytesToHexString(Sha256(file.bytes));
    }
    Report& report = result.report;
    report.times.total = Seconds(timer_.Seconds());
    record_.job = result.job;
    record_.usable = result.IsUsable();
    record_.why = WhyNotUsable(report);
    record_.triangles = report.triangles;
    record_.charts = report.chart_totals.charts;
    // Without the wait for a worker, which the batch causes itself by sending meshes in advance.
    const Seconds own = fetched ? WorkTime(report.times) : report.times.total - report.times.queue;
    record_.seconds = std::max(0.0, own.count());
    context_.state.Append(record_);
    FillRow(record_);
    end_.row.warnings = report.warnings.size();
    if (!fetched) end_.queue_seconds = report.times.queue.count();
    BeginJson();
    end_.json.update(ReportJson(result, report, item_.output, files_->atlas_names()));
    if (context_.sheet != nullptr) {
      end_.row.card = WritePage(PageJob(record_), *files_, result, arguments_.map.options);
    }
  }

  SheetPageJob PageJob(const BatchRecord& record) const {
    const std::string made = record.input + record.settings + record.version + Json(record.files).dump();
    return {*context_.sheet, ReportSheet::PageOf(item_.key), item_.output, absl::BytesToHexString(Sha256(made))};
  }

  void Keep(const BatchRecord& record) {
    FillRow(record);
    end_.row.kept = true;
    BeginJson();
    end_.json["job"] = record.job;
    end_.json["state"] = ToString(JobState::kSucceeded);
    end_.json["input"] = {{"triangles", record.triangles}};
    end_.json["chart_totals"] = {{"charts", record.charts}};
    end_.json["seconds"] = {{"total", record.seconds}};
    end_.json["output"] = item_.output;
    if (context_.sheet != nullptr) {
      end_.row.card =
          KeepPage(PageJob(record), arguments_.output.texcoord.value_or(item_.texcoord), arguments_.map.options);
    }
  }

  void FillRow(const BatchRecord& record) {
    end_.row.result = record.usable ? BatchResult::kUsable : BatchResult::kNotUsable;
    end_.row.exit_code = record.usable ? kOk : kFailed;
    end_.row.triangles = record.triangles;
    end_.row.charts = record.charts;
    end_.row.seconds = record.seconds;
    end_.row.message = record.why;
  }

  void Queued(const std::string& job) {
    end_.row.result = BatchResult::kQueued;
    end_.row.reason = job;
    end_.row.triangles = files_->view().triangle_count();
    BeginJson();
    end_.json["job"] = job;
    end_.json["output"] = item_.output;
  }

  void Fail(const Error& sent_error) {
    const bool interrupted = context_.stop.stop_requested() && sent_error.code() == ErrorCode::kCancelled;
    if (interrupted && end_.row.result == BatchResult::kQueued) return;
    const MeshInput* const input = files_ ? &files_->input() : nullptr;
    const Error error = input != nullptr ? input->InFileIds(sent_error) : sent_error;
    const std::string places = Places(error.metadata(), input);
    const bool cancelled = error.code() == ErrorCode::kCancelled;
    BatchRow& row = end_.row;
    row.result = cancelled ? BatchResult::kCancelled : BatchResult::kFailed;
    row.exit_code = static_cast<ExitCode>(ExitCodeOf(error));
    row.reason = cancelled ? "" : error.reason();
    row.message = error.what() + (places.empty() ? "" : ", at " + places);
    row.triangles = input != nullptr ? input->view().triangle_count() : 0;
    row.seconds = timer_.Seconds();
    if (error.code() == ErrorCode::kUnavailable && row.exit_code == kServerUnreachable) end_.server_error = error;
    BeginJson();
    Failure failure = FailureOf(error);
    failure.triangles = row.triangles;
    failure.vertices = input != nullptr ? input->view().vertex_count() : 0;
    failure.total_seconds = row.seconds;
    end_.json.update(ReportJson(failure));
  }

  // The beginning of every line of --json.
  void BeginJson() {
    end_.json = {{"file", item_.name}, {"result", ToString(end_.row.result)}, {"kept", end_.row.kept}};
  }

  const BatchContext& context_;
  const UnwrapArguments& arguments_;
  const BatchItem& item_;
  const Callbacks& callbacks_;
  const std::function<void(const ImageProgress&)>& on_image_;
  const Timer timer_;
  BatchRecord record_;
  std::optional<UnwrapFiles> files_;
  BatchEnd end_;
};

}  // namespace

bool PauseUnlessStopped(const std::stop_token& stop, double seconds) {
  std::mutex mutex;
  std::condition_variable_any changed;
  std::unique_lock lock(mutex);
  changed.wait_for(lock, stop, std::chrono::duration<double>(seconds), [] { return false; });
  return !stop.stop_requested();
}

BatchEnd DoBatchItem(const BatchContext& context, const BatchItem& item, const Callbacks& callbacks,
                     const std::function<void(const ImageProgress&)>& on_image) {
  return BatchJob(context, item, callbacks, on_image).Do();
}

BatchEnd NotTried(const BatchItem& item) {
  BatchEnd end;
  end.row.name = item.name;
  end.json = {{"file", item.name}, {"result", ToString(end.row.result)}, {"kept", false}};
  return end;
}

namespace {

// Limit of the files in flight together. Each is in memory as bytes, as a mesh and as a request: about five times its
// size in all.
constexpr std::int64_t kMostBytesInFlight = std::int64_t{512} << 20;
constexpr double kLongestPauseSeconds = 5;

}  // namespace

BatchRun::BatchRun(const BatchContext& context, const BatchPlan& plan, const BatchRunOptions& options,
                   ProgressView& view)
    : context_(context),
      plan_(plan),
      options_(options),
      view_(view),
      flight_(options.workers, kMostBytesInFlight),
      rows_(plan.items.size()) {}

std::vector<BatchRow> BatchRun::Run() {
  const std::stop_callback on_stop(context_.stop, [this] { flight_.Stop(); });
  {
    std::vector<std::jthread> threads;
    const auto count = std::min(plan_.items.size(), static_cast<std::size_t>(flight_.most()));
    for (std::size_t t = 0; t < count; ++t) threads.emplace_back([this] { Work(); });
  }
  for (; next_ < plan_.items.size(); ++next_) Record(next_, NotTried(plan_.items[next_]));
  return std::move(rows_);
}

void BatchRun::Work() {
  for (;;) {
    std::size_t file;
    {
      // Threads take files in order, so a thread takes its file before it waits for room in Enter().
      const std::lock_guard lock(mutex_);
      if (next_ == plan_.items.size() || ShouldStop()) return;
      file = next_++;
    }
    const std::int64_t bytes = plan_.items[file].bytes;
    if (!flight_.Enter(bytes)) return Record(file, NotTried(plan_.items[file]));
    view_.Begin(file);
    const BatchEnd end = DoWithPatience(file);
    Record(file, end);
    flight_.Leave(bytes);
  }
}

BatchEnd BatchRun::DoWithPatience(std::size_t file) {
  Callbacks callbacks = view_.CallbacksOf(file, context_.arguments.terminal.verbose);
  const auto told = callbacks.on_reconnect;
  callbacks.on_reconnect = [this, told](const Error& why, Seconds wait) {
    if (why.reason() == "QUEUE_FULL") flight_.OnQueueFull();
    told(why, wait);
  };
  const Timer timer;
  double pause = 0.5;
  for (;;) {
    BatchEnd end = DoBatchItem(context_, plan_.items[file], callbacks,
                               [this, file](const ImageProgress& progress) { view_.OnImage(file, progress); });
    if (end.queue_seconds) flight_.OnDone(*end.queue_seconds);
    if (!end.server_error || ShouldStop()) return end;
    if (timer.Seconds() + pause > options_.server_patience_seconds) {
      server_lost_ = true;
      flight_.Stop();
      return end;
    }
    view_.OnNotice(file, "no server, waiting");
    if (!PauseUnlessStopped(context_.stop, pause)) return end;
    pause = std::min(kLongestPauseSeconds, 2 * pause);
  }
}

void BatchRun::Record(std::size_t file, const BatchEnd& end) {
  view_.End(file, end.row);
  const std::lock_guard lock(mutex_);
  rows_[file] = end.row;
  if (options_.print_json) std::cout << ToLine(end.json) + "\n" << std::flush;
}

}  // namespace planish::cli
