#include <chrono>
#include <filesystem>
#include <iostream>
#include <memory>
#include <optional>
#include <utility>

#include "client/cli/delivery.h"
#include "client/cli/exit_codes.h"
#include "client/cli/progress.h"
#include "client/cli/progress_view.h"
#include "client/cli/report.h"
#include "client/cli/results.h"
#include "client/cli/session.h"
#include "client/cli/text.h"
#include "client/cli/unwrap_arguments.h"
#include "core/base/timer.h"

namespace planish::cli {
namespace {

// How long to wait, after Ctrl-C, for the server to confirm that the job was cancelled.
constexpr double kCancelPatienceSeconds = 10;

int Deliver(const UnwrapArguments& arguments, Delivery& delivery, UnwrapResult result, Interrupts& interrupts,
            ProgressView& view) {
  const MeshInput& input = delivery.files().input();
  delivery.Write(result, interrupts, view, [&] {
    if (arguments.picture.empty()) return;
    WriteOutput(arguments.picture, input.Picture(result.uv, arguments.view_azimuth, arguments.view_elevation));
  });
  if (!arguments.report.empty()) {
    WriteOutput(arguments.report, UnwrapReport(delivery.files(), result, arguments.output.path, arguments.map.options).html);
  }
  return delivery.Tell(result);
}

int Detach(const UnwrapArguments& arguments, const MeshView& mesh, Client& client, const CallOptions& call) {
  const Job job = client.CreateJob(mesh, arguments.map.options, call);
  if (arguments.json) {
    std::cout << ToText(ToJson(job)) << std::flush;
  } else {
    std::cout << job.name << "\n" << std::flush;
  }
  if (!arguments.terminal.quiet) {
    std::cerr << "Queued. Fetch the result with: planish jobs watch " << job.name << " --mesh "
              << arguments.inputs.first << " -o OUT.obj --server=" << arguments.server.address << "\n";
  }
  return kOk;
}

// Waits for the end of a call and returns its result. Nothing if the call has not ended kCancelPatienceSeconds after an
// interrupt.
std::optional<UnwrapResult> WaitOrInterrupt(Call& call, const Interrupts& interrupts) {
  std::optional<Timer> since_interrupt;
  while (!call.WaitFor(std::chrono::milliseconds(50))) {
    if (interrupts.interrupted() && !since_interrupt) since_interrupt.emplace();
    if (since_interrupt && since_interrupt->Seconds() > kCancelPatienceSeconds) return std::nullopt;
  }
  return call.Wait();
}

}  // namespace

int Run(const UnwrapArguments& arguments, Interrupts& interrupts) {
  if (arguments.batch) return RunBatch(arguments, interrupts);
  Delivery delivery(arguments);
  std::unique_ptr<ProgressView> view;
  try {
    for (const std::string& picture : {arguments.picture, arguments.report}) {
      if (!picture.empty()) CheckOutput(picture);
    }
    delivery.Load(arguments.inputs.All(), arguments.map);
    ServerNeeds needs;
    needs.threads = arguments.map.options.threads;
    ServerChoice server(arguments.server, interrupts, needs);
    delivery.SetStart(server.start_seconds());
    const std::string file_name = std::filesystem::path(arguments.inputs.first).filename();
    CallOptions call_options;
    call_options.labels = JobLabels(arguments.labels, file_name);
    call_options.timeout = delivery.TimeLeft();
    call_options.scheduling = arguments.scheduling;
    if (arguments.detach) return Detach(arguments, delivery.files().view(), server.client(), call_options);

    view = NewProgressView(arguments.terminal, {file_name}, /*is_batch=*/false);
    if (arguments.terminal.verbose) view->Say(Printable(server.Description(), true));
    view->Begin(0);
    Call call = server.client().StartUnwrap(delivery.files().view(), delivery.files().Options(arguments.map.options),
                                            view->CallbacksOf(0, arguments.terminal.verbose), call_options);
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
      return delivery.Interrupted(confirmed ? "interrupted; the job was cancelled on the server"
                                            : "interrupted; the server did not confirm that the job was cancelled",
                                  cancelled);
    }
    if (error) return delivery.Fail(*error);
    return Deliver(arguments, delivery, *std::move(result), interrupts, *view);
  } catch (const Error& error) {
    if (view) End(*view, false);
    if (interrupts.interrupted() && error.code() == ErrorCode::kCancelled) {
      return delivery.Interrupted("interrupted; nothing was written", error);
    }
    return delivery.Fail(error);
  }
}

}  // namespace planish::cli
