#include "server/worker/work.h"

#include <algorithm>
#include <exception>
#include <new>
#include <string>
#include <utility>

#include "absl/strings/str_cat.h"
#include "core/base/error.h"
#include "core/base/sha256.h"
#include "core/base/status_macros.h"
#include "core/base/timer.h"
#include "core/io/draco_codec.h"
#include "core/unwrap/unwrap.h"
#include "server/link/rpc_status.h"
#include "server/worker/options.h"
#include "server/worker/report.h"

namespace planish {
namespace {

using worker::v1::WorkRequest;
using worker::v1::WorkResult;

class Work {
 public:
  Work(const WorkRequest& request, const Interrupter& interrupter,
       const std::function<void(const v1::Progress&)>& on_progress)
      : request_(request), interrupter_(interrupter), on_progress_(on_progress) {}

  absl::StatusOr<WorkResult> Run() {
    PLANISH_ASSIGN_OR_RETURN(UnwrapOptions options, ToCore(request_.options()));
    const int max_threads = std::clamp(request_.max_threads(), 1, kMaxThreads);
    options.threads = request_.options().threads() == 0 ? max_threads : std::min(options.threads, max_threads);
    options.seams.corners.assign(request_.seam_corners().begin(), request_.seam_corners().end());
    options.seams.uncut_corners.assign(request_.uncut_corners().begin(), request_.uncut_corners().end());
    tolerance_ = options.flatten.tolerance;

    ReportStage(v1::STAGE_DECODE);
    Timer timer;
    PLANISH_ASSIGN_OR_RETURN(const Mesh mesh, DecodeDraco(request_.draco()));
    const double decode_seconds = timer.Seconds();
    PLANISH_RETURN_IF_ERROR(CheckInterrupt());

    UnwrapControl control;
    control.interrupter = &interrupter_;
    control.on_progress = [this](const UnwrapProgress& progress) { Report(ToProto(progress)); };
    PLANISH_ASSIGN_OR_RETURN(const UnwrapResult unwrapped, Unwrap(mesh, options, control));
    PLANISH_RETURN_IF_ERROR(CheckInterrupt());

    ReportStage(v1::STAGE_ENCODE);
    timer.Restart();
    WorkResult result;
    Describe(unwrapped, mesh, options, &result);
    result.mutable_report()->set_threads(options.threads);
    result.mutable_report()->mutable_seconds()->set_decode(decode_seconds);
    result.mutable_report()->mutable_seconds()->set_encode(timer.Seconds());
    result.mutable_report()->set_peak_memory_bytes(PeakMemoryBytes());
    return result;
  }

 private:
  absl::Status CheckInterrupt() const {
    if (!interrupter_.IsInterrupted()) return absl::OkStatus();
    return MakeError(absl::StatusCode::kCancelled, "CANCELLED", "the job was cancelled");
  }

  void ReportStage(v1::Stage stage) {
    v1::Progress progress = last_;
    progress.set_stage(stage);
    progress.set_linear_residual(0);
    Report(std::move(progress));
  }

  void Report(v1::Progress progress) {
    progress.set_elapsed_seconds(since_start_.Seconds());
    progress.set_tolerance(tolerance_);
    last_ = progress;
    if (throttle_.Pass(progress)) on_progress_(progress);
  }

  void Describe(const UnwrapResult& unwrapped, const Mesh& mesh, const UnwrapOptions& options,
                WorkResult* result) const {
    *result->mutable_report() = ToProto(unwrapped, mesh, options);
    result->set_uv_bytes(PackUv(unwrapped.uv, unwrapped.precision));
    v1::UvDescription* uv = result->mutable_uv();
    uv->set_precision(ToProto(unwrapped.precision));
    uv->set_corner_count(static_cast<std::int64_t>(unwrapped.uv.size() / 2));
    uv->set_total_bytes(static_cast<std::int64_t>(result->uv_bytes().size()));
    uv->set_mesh_sha256(Sha256(request_.draco()));
    uv->set_uv_sha256(Sha256(result->uv_bytes()));
  }

  const WorkRequest& request_;
  const Interrupter& interrupter_;
  const std::function<void(const v1::Progress&)>& on_progress_;
  const Timer since_start_;
  double tolerance_ = 0;
  v1::Progress last_;
  ProgressThrottle throttle_;
};

WorkResult Failure(const absl::Status& status) {
  WorkResult result;
  *result.mutable_status() = ToRpcStatus(status);
  return result;
}

}  // namespace

bool ProgressThrottle::Pass(const v1::Progress& progress) {
  const bool one_chart = progress.chart_count() <= 1;
  const bool news =
      !last_.has_value() || progress.stage() != last_->stage() ||
      progress.elapsed_seconds() - last_->elapsed_seconds() >= kIntervalSeconds ||
      (one_chart && (progress.linear_residual() == 0 || progress.newton_iteration() != last_->newton_iteration()));
  if (news) last_ = progress;
  return news;
}

WorkResult DoWork(const WorkRequest& request, const Interrupter& interrupter,
                  const std::function<void(const v1::Progress&)>& on_progress) {
  try {
    absl::StatusOr<WorkResult> result = Work(request, interrupter, on_progress).Run();
    return result.ok() ? *std::move(result) : Failure(result.status());
  } catch (const std::bad_alloc&) {
    return Failure(
        MakeError(absl::StatusCode::kResourceExhausted, "OUT_OF_MEMORY", "the worker ran out of memory on this mesh"));
  } catch (const std::exception& error) {
    return Failure(InternalError(absl::StrCat("the worker failed: ", error.what())));
  }
}

}  // namespace planish
