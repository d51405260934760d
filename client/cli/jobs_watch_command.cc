#include "client/cli/jobs_watch_command.h"

#include <iostream>
#include <memory>
#include <stop_token>
#include <utility>

#include "client/cli/exit_codes.h"
#include "client/cli/flags.h"
#include "client/cli/jobs_command.h"
#include "client/cli/progress_view.h"
#include "client/cli/results.h"
#include "client/cli/session.h"
#include "client/cli/text.h"

namespace planish::cli {

void AddFlags(CLI::App& app, JobsWatchArguments& arguments) {
  AddJob(app, arguments.job);
  AddServer(app, arguments.server, "required here");
  AddJson(app, arguments.json);
  app.add_option("--mesh", arguments.input, "The file that was sent; the UV go into a copy of it")->type_name("IN");
  AddOutput(app, arguments.output.path, /*takes_batch=*/false);
  AddPreview(app, arguments.output.preview);
  AddTexcoord(app, arguments.texcoord);
  AddOutputTexcoord(app, arguments.output.texcoord);
  AddTextures(app, arguments.output.textures);
  AddTimeout(app, arguments.timeout_seconds, "Stop watching after SECONDS; the job goes on");
  AddTerminal(app, arguments.terminal);
  AddProgress(app, arguments.terminal);
}

namespace {

std::string CheckMesh(const JobsWatchArguments& arguments) {
  if (arguments.input.empty() != arguments.output.path.empty()) {
    return "--mesh and -o go together: the UV go into a copy of the file that was sent";
  }
  if (arguments.output.preview.empty() || !arguments.input.empty()) return "";
  return "--preview draws the UV on the file that was sent: name it with --mesh, and -o for the result";
}

}  // namespace

std::string Check(JobsWatchArguments& arguments) {
  return FirstProblem({CheckTexcoord(arguments.texcoord, arguments.input), CheckPreview(arguments.output.preview),
                       CheckStdout(arguments.output.path, arguments.json), CheckPainting(arguments.output.textures),
                       CheckMesh(arguments), CheckJob(arguments.job, arguments.server)});
}

int Run(const JobsWatchArguments& arguments, Interrupts& interrupts) {
  Delivery delivery(arguments);
  std::unique_ptr<ProgressView> view;
  std::stop_source stop;
  try {
    if (!arguments.input.empty()) delivery.Load({arguments.input}, {});
    ServerChoice server(arguments.server, interrupts);
    view = NewProgressView(arguments.terminal, {arguments.job}, /*is_batch=*/false);
    if (arguments.terminal.verbose) view->Say(Printable(server.Description(), true));
    view->Begin(0);
    // The first signal only ends watching: the job belongs to another command, so it is not cancelled.
    interrupts.SetCancel([stop]() mutable { stop.request_stop(); });
    CallOptions call;
    call.stop = stop.get_token();
    call.timeout = delivery.TimeLeft();
    if (!arguments.input.empty()) {
      UnwrapResult result = server.client().AttachResult(arguments.job, delivery.files().input().view(),
                                                         view->CallbacksOf(0, arguments.terminal.verbose), call);
      delivery.Write(result, interrupts, *view);
      return delivery.Tell(result);
    }
    const Job job = server.client().WatchJob(arguments.job, view->CallbacksOf(0, arguments.terminal.verbose), 0, call);
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
      if (!arguments.terminal.quiet || !usable)
        std::cerr << Summary(report, {.verbose = arguments.terminal.verbose}, StderrTerminal());
      return usable ? kOk : kFailed;
    }
    return kFailed;
  } catch (const Error& error) {
    if (view) End(*view, false);
    if (interrupts.interrupted()) {
      return delivery.Interrupted("stopped watching; the job goes on. To end it: planish jobs cancel " + arguments.job,
                                  error);
    }
    return delivery.Fail(error);
  }
}

}  // namespace planish::cli
