#include "client/cli/batch_job.h"

#include <algorithm>
#include <chrono>
#include <condition_variable>
#include <exception>
#include <filesystem>
#include <mutex>
#include <new>
#include <system_error>

#include "absl/strings/escaping.h"
#include "client/cli/batch_digest.h"
#include "client/cli/mesh_input.h"
#include "client/cli/report_command.h"
#include "client/cli/summary.h"
#include "client/cli/unwrap_files.h"
#include "client/src/request_id.h"
#include "core/base/sha256.h"
#include "core/base/timer.h"

namespace planish::cli {
namespace {

namespace fs = std::filesystem;

// What a job kept a worker busy for.
Seconds WorkTime(const StageTimes& times) {
  return times.decode + times.charts + times.solve + times.layout + times.pack + times.verify + times.encode;
}

class BatchJob {
 public:
  BatchJob(const BatchContext& context, const BatchItem& item, const Callbacks& callbacks)
      : context_(context), arguments_(context.arguments), item_(item), callbacks_(callbacks) {
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
      if (known->queued && known->server == arguments_.server) job = known->job;
      // The run before ended between the question and the answer: the same question brings the same job.
      if (known->server == arguments_.server) request_id = known->request_id;
    }
    MakeDirectory();
    files_.emplace(std::vector<std::string>{item_.input}, arguments_.seams, item_.output, item_.texcoord,
                   arguments_.output_texcoord.value_or(item_.texcoord));
    if (context_.stop.stop_requested()) throw Error(ErrorCode::kCancelled, "CANCELLED", "interrupted");
    if (!job.empty() && arguments_.detach && !HasEnded(&job)) return Queued(job);
    if (!job.empty()) {
      if (std::optional<UnwrapResult> result = Fetch(job)) return Deliver(*std::move(result), true);
    }
    if (arguments_.detach) return Queued(Queue(request_id.empty() ? NewRequestId() : request_id));
    CallOptions call = Call();
    call.request_id = request_id;
    Deliver(context_.client.Unwrap(files_->view(), files_->Options(arguments_.options), callbacks_, call), false);
  }

  void MakeDirectory() const {
    const fs::path directory = fs::path(item_.output).parent_path();
    std::error_code error;
    fs::create_directories(directory, error);
    if (error) {
      throw Error(ErrorCode::kPermissionDenied, "FILE_UNWRITABLE",
                  directory.string() + ": cannot be made: " + error.message());
    }
  }

  CallOptions Call() const {
    CallOptions call;
    call.scheduling = arguments_.scheduling;
    call.labels = JobLabels(arguments_, item_.name);
    call.timeout = Seconds(arguments_.timeout_seconds);
    call.stop = context_.stop;
    return call;
  }

  // Whether a queued job needs no more waiting; forgets one that the server does not know any more.
  bool HasEnded(std::string* job) {
    try {
      return IsTerminal(context_.client.GetJob(*job).state);
    } catch (const Error& error) {
      if (error.code() != ErrorCode::kNotFound) throw;
      job->clear();
      return true;
    }
  }

  // The result of a job that an earlier run has queued; nothing if the server does not know it any more.
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
        // The next run is to try anew, not to fetch the same error.
        record_.job = job;
        context_.state.Append(record_);
      }
      throw;
    }
  }

  // Queues the job and records that; waits for room in the queue.
  std::string Queue(const std::string& request_id) {
    const UnwrapOptions options = files_->Options(arguments_.options);
    CallOptions call = Call();
    call.request_id = request_id;
    record_.server = arguments_.server;
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

  // `fetched`: the job ran on its own, before or while we watched.
  void Deliver(UnwrapResult result, bool fetched) {
    const WrittenMesh written = files_->WithResult(result);
    for (const OutputFile& file : written.files) {
      WriteOutput(file.path, file.bytes);
      const fs::path place = fs::path(file.path).lexically_relative(arguments_.output);
      record_.files[place.generic_string()] = absl::BytesToHexString(Sha256(file.bytes));
    }
    Report& report = result.report;
    report.times.total = Seconds(timer_.Seconds());
    record_.job = result.job;
    record_.usable = result.IsUsable();
    record_.why = WhyNotUsable(report);
    record_.triangles = report.triangles;
    record_.charts = report.chart_totals.charts;
    // Waiting for a worker is the batch's own doing: it sends meshes ahead.
    const Seconds own = fetched ? WorkTime(report.times) : report.times.total - report.times.queue;
    record_.seconds = std::max(0.0, own.count());
    context_.state.Append(record_);
    FillRow(record_);
    end_.row.warnings = report.warnings.size();
    if (!fetched) end_.queue_seconds = report.times.queue.count();
    BeginJson();
    end_.json.update(ReportJson(result, report, item_.output));
    if (context_.sheet != nullptr) end_.row.card = WritePage(PageJob(record_), files_->input(), result, arguments_);
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
      end_.row.card = KeepPage(PageJob(record), arguments_.output_texcoord.value_or(item_.texcoord), arguments_);
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
    const std::string places = input != nullptr ? input->Places(error.metadata()) : "";
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

  // What every line of --json begins with.
  void BeginJson() {
    end_.json = {{"file", item_.name}, {"result", ToString(end_.row.result)}, {"kept", end_.row.kept}};
  }

  const BatchContext& context_;
  const Arguments& arguments_;
  const BatchItem& item_;
  const Callbacks& callbacks_;
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

BatchEnd DoBatchItem(const BatchContext& context, const BatchItem& item, const Callbacks& callbacks) {
  return BatchJob(context, item, callbacks).Do();
}

BatchEnd NotTried(const BatchItem& item) {
  BatchEnd end;
  end.row.name = item.name;
  end.json = {{"file", item.name}, {"result", ToString(end.row.result)}, {"kept", false}};
  return end;
}

}  // namespace planish::cli
