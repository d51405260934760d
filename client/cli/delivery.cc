#include "client/cli/delivery.h"

#include <algorithm>
#include <iostream>
#include <stop_token>

#include "client/cli/exit_codes.h"
#include "client/cli/results.h"
#include "client/cli/session.h"
#include "client/cli/text.h"

namespace planish::cli {

void Delivery::Load(const std::vector<std::string>& inputs, const MapArguments& map) {
  if (!arguments_.output.preview.empty()) CheckOutput(arguments_.output.preview);
  files_.emplace(inputs, arguments_.texcoord, map, arguments_.output);
}

Seconds Delivery::TimeLeft() const {
  if (arguments_.timeout_seconds <= 0) return {};
  return Seconds(std::max(0.001, arguments_.timeout_seconds - timer_.Seconds()));
}

void Delivery::Write(UnwrapResult& result, Interrupts& interrupts, ProgressView& view,
                     const std::function<void()>& draw) {
  std::stop_source stop;
  interrupts.SetCancel([stop]() mutable { stop.request_stop(); });
  files_->WriteResult(
      result, [&view](const ImageProgress& progress) { view.OnImage(0, progress); }, stop.get_token());
  interrupts.SetCancel({});
  End(view, !interrupts.interrupted());
  interrupts.LeaveIfInterrupted();
  const std::string& preview = arguments_.output.preview;
  if (!preview.empty()) {
    WriteOutput(preview, files_->input().Preview(result.uv, preview, result.report.atlas.pack));
  }
  if (draw) draw();
  result.report.times.total = Seconds(timer_.Seconds());
}

int Delivery::Tell(const UnwrapResult& result) const {
  const std::string& path = arguments_.output.path;
  if (!arguments_.terminal.quiet || !result.IsUsable()) {
    SummaryOptions summary = {path, arguments_.terminal.verbose, start_seconds_, files_->atlas_names()};
    for (const Warning& warning : result.report.warnings) {
      summary.places.push_back(Places(warning.metadata, &files_->input()));
    }
    std::cerr << Summary(result.report, summary, StderrTerminal());
  }
  if (arguments_.json) {
    Json json = ReportJson(result, result.report, path == "-" ? "" : path, files_->atlas_names());
    if (start_seconds_ > 0) json["seconds"]["start"] = start_seconds_;
    std::cout << ToText(json) << std::flush;
  }
  return result.IsUsable() ? kOk : kFailed;
}

int Delivery::Fail(const Error& sent_error) const {
  const MeshInput* const input = files_ ? &files_->input() : nullptr;
  const Error error = input != nullptr ? input->InFileIds(sent_error) : sent_error;
  const std::string places = Places(error.metadata(), input);
  // The job of a private server ends with the server, so its name is left out.
  Error told = error;
  if (arguments_.server.address.empty()) told.set_job("");
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

int Delivery::Interrupted(const std::string& what_happened, const Error& error) const {
  std::cerr << "planish: " << what_happened << "\n";
  if (arguments_.json) {
    Failure failure = FailureOf(error);
    failure.total_seconds = timer_.Seconds();
    std::cout << ToText(ReportJson(failure)) << std::flush;
  }
  return kInterrupted;
}

void End(ProgressView& view, bool succeeded) {
  BatchRow row;
  row.result = succeeded ? BatchResult::kUsable : BatchResult::kFailed;
  view.End(0, row);
  view.Finish();
}

}  // namespace planish::cli
