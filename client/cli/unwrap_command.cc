#include <algorithm>
#include <chrono>
#include <filesystem>
#include <functional>
#include <iostream>
#include <memory>
#include <optional>
#include <stop_token>
#include <utility>
#include <vector>

#include "client/cli/commands.h"
#include "client/cli/progress.h"
#include "client/cli/progress_view.h"
#include "client/cli/report.h"
#include "client/cli/results.h"
#include "client/cli/session.h"
#include "client/cli/text.h"
#include "client/cli/unwrap_files.h"
#include "core/base/timer.h"

namespace planish::cli {
namespace {

// How long a cancelled job may take to say so before we leave without its word.
constexpr double kCancelPatienceSeconds = 10;

// Of a view of one job.
void End(ProgressView& view, bool succeeded) {
  BatchRow row;
  row.result = succeeded ? BatchResult::kUsable : BatchResult::kFailed;
  view.End(0, row);
  view.Finish();
}

// What both commands that bring a result share: the error in the file's words, the result on its way out.
class ResultCommand {
 public:
  explicit ResultCommand(const Arguments& arguments) : arguments_(arguments) {}

  void LoadInput() {
    if (arguments_.input.empty()) return;
    if (!arguments_.picture.empty()) CheckOutput(arguments_.picture);
    if (!arguments_.preview.empty()) CheckOutput(arguments_.preview);
    if (!arguments_.report.empty()) CheckOutput(arguments_.report);
    std::vector<std::string> paths = {arguments_.input};
    paths.insert(paths.end(), arguments_.more_inputs.begin(), arguments_.more_inputs.end());
    files_.emplace(paths, arguments_, arguments_.output, arguments_.texcoord, arguments_.output_texcoord);
  }

  const UnwrapFiles& files() const { return *files_; }
  // How long it took to start the private server.
  void SetStart(double seconds) { start_seconds_ = seconds; }

  double Seconds() const { return timer_.Seconds(); }

  // What is left of --timeout for the server; 0: no limit.
  planish::Seconds TimeLeft() const {
    if (arguments_.timeout_seconds <= 0) return {};
    return planish::Seconds(std::max(0.001, arguments_.timeout_seconds - timer_.Seconds()));
  }

  // The first signal ends the drawing of images; then nothing is written. Files are written all or none. Ends the view.
  int Deliver(UnwrapResult result, const Arguments& arguments, Interrupts& interrupts, ProgressView& view) {
    std::stop_source stop;
    interrupts.SetCancel([stop]() mutable { stop.request_stop(); });
    files_->WriteResult(
        result, [&view](const ImageProgress& progress) { view.OnImage(0, progress); }, stop.get_token());
    interrupts.SetCancel({});
    End(view, !interrupts.interrupted());
    interrupts.LeaveIfInterrupted();
    const MeshInput& input = files_->input();
    if (!arguments.picture.empty()) {
      WriteOutput(arguments.picture, input.Picture(result.uv, arguments.view_azimuth, arguments.view_elevation));
    }
    if (!arguments.preview.empty()) {
      WriteOutput(arguments.preview, input.Preview(result.uv, arguments.preview, result.report.atlas.pack));
    }
    result.report.times.total = planish::Seconds(timer_.Seconds());
    if (!arguments.report.empty()) WriteOutput(arguments.report, UnwrapReport(input, result, arguments).html);
    if (!arguments.quiet || !result.IsUsable()) {
      SummaryOptions summary = {arguments.output, arguments.verbose, start_seconds_, files_->atlas_names()};
      for (const Warning& warning : result.report.warnings) summary.places.push_back(Places(warning.metadata, &input));
      std::cerr << Summary(result.report, summary, StderrTerminal());
    }
    if (arguments.json) {
      const std::string output = arguments.output == "-" ? "" : arguments.output;
      Json json = ReportJson(result, result.report, output, files_->atlas_names());
      if (start_seconds_ > 0) json["seconds"]["start"] = start_seconds_;
      std::cout << ToText(json) << std::flush;
    }
    return result.IsUsable() ? kOk : kFailed;
  }

  int Fail(const Error& sent_error) {
    const MeshInput* const input = files_ ? &files_->input() : nullptr;
    const Error error = input != nullptr ? input->InFileIds(sent_error) : sent_error;
    const std::string places = Places(error.metadata(), input);
    // A private server's job is of no use to anybody afterwards.
    Error told = error;
    if (arguments_.server.empty()) told.set_job("");
    std::cerr << ErrorText(told, places, StderrTerminal());
    if (arguments_.json) {
      Failure failure = FailureOf(error);
      failure.triangles = input != nullptr ? input->view().triangle_count() : 0;
      failure.vertices = input != nullptr ? input->view().vertex_count() : 0;
      failure.total_seconds = timer_.Seconds();
      std::cout << ToText(ReportJson(failure)) << std::flush;
    }
    return ExitCodeOf(error);
  }

  int Interrupted(const std::string& what_happened, const Error& error) {
    std::cerr << "planish: " << what_happened << "\n";
    if (arguments_.json) {
      Failure failure = FailureOf(error);
      failure.total_seconds = timer_.Seconds();
      std::cout << ToText(ReportJson(failure)) << std::flush;
    }
    return kInterrupted;
  }

 private:
  const Arguments& arguments_;
  Timer timer_;
  double start_seconds_ = 0;
  std::optional<UnwrapFiles> files_;
};

int Detach(const Arguments& arguments, const MeshView& mesh, Client& client, const CallOptions& call) {
  const Job job = client.CreateJob(mesh, arguments.options, call);
  if (arguments.json) {
    std::cout << ToText(ToJson(job)) << std::flush;
  } else {
    std::cout << job.name << "\n" << std::flush;
  }
  if (!arguments.quiet) {
    std::cerr << "Queued. Fetch the result with: planish jobs watch " << job.name << " --mesh " << arguments.input
              << " -o OUT.obj --server=" << arguments.server << "\n";
  }
  return kOk;
}

// The end of a call, or nothing if it did not come within the patience after an interrupt.
std::optional<UnwrapResult> WaitOrInterrupt(Call& call, const Interrupts& interrupts) {
  std::optional<Timer> since_interrupt;
  while (!call.WaitFor(std::chrono::milliseconds(50))) {
    if (interrupts.interrupted() && !since_interrupt) since_interrupt.emplace();
    if (since_interrupt && since_interrupt->Seconds() > kCancelPatienceSeconds) return std::nullopt;
  }
  return call.Wait();
}

}  // namespace

int RunUnwrap(const Arguments& arguments, Interrupts& interrupts) {
  if (arguments.batch) return RunBatch(arguments, interrupts);
  ResultCommand command(arguments);
  std::unique_ptr<ProgressView> view;
  try {
    command.LoadInput();
    ServerNeeds needs;
    needs.threads = arguments.options.threads;
    ServerChoice server(arguments.server, arguments.server_flags, interrupts, needs);
    command.SetStart(server.start_seconds());
    const std::string file_name = std::filesystem::path(arguments.input).filename();
    CallOptions call_options;
    call_options.labels = JobLabels(arguments, file_name);
    call_options.timeout = command.TimeLeft();
    call_options.scheduling = arguments.scheduling;
    if (arguments.detach) return Detach(arguments, command.files().view(), server.client(), call_options);

    view = NewProgressView(arguments, {file_name}, /*is_batch=*/false);
    if (arguments.verbose) view->Say(Printable(server.Description(), true));
    view->Begin(0);
    Call call = server.client().StartUnwrap(command.files().view(), command.files().Options(arguments.options),
                                            view->CallbacksOf(0, arguments.verbose), call_options);
    interrupts.SetCancel([&] {
      view->OnNotice(0, kCancelling);
      call.Cancel();
    });
    std::optional<UnwrapResult> result;
    std::optional<Error> error;
    try {
      result = WaitOrInterrupt(call, interrupts);
    } catch (const Error& e) {
      error = e;
    }
    interrupts.SetCancel({});
    if (!result || interrupts.interrupted()) End(*view, false);
    if (interrupts.interrupted()) {
      const Error cancelled = Error(ErrorCode::kCancelled, "CANCELLED", "interrupted").set_job(call.job());
      const bool confirmed = result.has_value() || (error && error->code() == ErrorCode::kCancelled);
      return command.Interrupted(confirmed ? "interrupted; the job was cancelled on the server"
                                           : "interrupted; the server did not confirm that the job was cancelled",
                                 cancelled);
    }
    if (error) return command.Fail(*error);
    return command.Deliver(*std::move(result), arguments, interrupts, *view);
  } catch (const Error& error) {
    if (view) End(*view, false);
    if (interrupts.interrupted() && error.code() == ErrorCode::kCancelled) {
      return command.Interrupted("interrupted; nothing was written", error);
    }
    return command.Fail(error);
  }
}

int RunJobsWatch(const Arguments& arguments, Interrupts& interrupts) {
  ResultCommand command(arguments);
  std::unique_ptr<ProgressView> view;
  std::stop_source stop;
  try {
    command.LoadInput();
    ServerChoice server(arguments.server, arguments.server_flags, interrupts);
    view = NewProgressView(arguments, {arguments.job}, /*is_batch=*/false);
    if (arguments.verbose) view->Say(Printable(server.Description(), true));
    view->Begin(0);
    // The job is not ours to cancel.
    interrupts.SetCancel([stop]() mutable { stop.request_stop(); });
    CallOptions call;
    call.stop = stop.get_token();
    call.timeout = command.TimeLeft();
    if (!arguments.input.empty()) {
      UnwrapResult result = server.client().AttachResult(arguments.job, command.files().input().view(),
                                                         view->CallbacksOf(0, arguments.verbose), call);
      return command.Deliver(std::move(result), arguments, interrupts, *view);
    }
    const Job job = server.client().WatchJob(arguments.job, view->CallbacksOf(0, arguments.verbose), 0, call);
    End(*view, job.state == JobState::kSucceeded);
    if (arguments.json) std::cout << ToText(ToJson(job)) << std::flush;
    if (job.error) {
      std::cerr << "planish: " << job.name << " failed: " << Printable(ErrorLine(*job.error), true) << "\n";
    } else if (!job.report) {
      std::cerr << "planish: " << job.name << " ended as " << ToString(job.state) << "\n";
    } else {
      Report report = *job.report;
      if (job.create_time && job.end_time) {
        report.times.total = *job.end_time - *job.create_time;
      }
      const bool usable = WhyNotUsable(report).empty();
      if (!arguments.quiet || !usable) std::cerr << Summary(report, {.verbose = arguments.verbose}, StderrTerminal());
      return usable ? kOk : kFailed;
    }
    return kFailed;
  } catch (const Error& error) {
    if (view) End(*view, false);
    if (interrupts.interrupted()) {
      return command.Interrupted("stopped watching; the job goes on. To end it: planish jobs cancel " + arguments.job,
                                 error);
    }
    return command.Fail(error);
  }
}

}  // namespace planish::cli
