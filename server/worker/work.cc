#include "server/worker/work.h"

#include <algorithm>
#include <cstdint>
#include <exception>
#include <new>
#include <string>
#include <system_error>
#include <utility>

#include "absl/strings/str_cat.h"
#include "core/base/error.h"
#include "core/base/sha256.h"
#include "core/base/status_macros.h"
#include "core/base/timer.h"
#include "core/draco/codec.h"
#include "core/unwrap/unwrap.h"
#include "planish/v1/planish.pb.h"
#include "server/link/duration.h"
#include "server/link/mesh_elements.h"
#include "server/link/rpc_status.h"
#include "server/worker/mesh_arrays.h"
#include "server/worker/options.h"
#include "server/worker/process_memory.h"
#include "server/worker/report.h"

namespace planish {
namespace {

using worker::v1::WorkRequest;

class Work {
 public:
  Work(const WorkRequest& request, const std::vector<BlobPtr>& blobs, const WorkControl& control)
      : request_(request), blobs_(blobs), control_(control) {}

  absl::StatusOr<WorkOutcome> Run() {
    PLANISH_ASSIGN_OR_RETURN(UnwrapOptions options, ToCore(request_.options()));
    const int max_threads = std::clamp(request_.max_threads(), 1, kMaxThreads);
    options.threads = request_.options().threads() == 0 ? max_threads : std::min(options.threads, max_threads);
    if (blobs_.empty() || blobs_.size() > 2) return InternalError("the server sent a job without its mesh");
    tolerance_ = options.flatten.tolerance;

    ReportStage(v1::STAGE_DECODE);
    PLANISH_RETURN_IF_ERROR(Reach("decode"));
    Timer timer;
    PLANISH_ASSIGN_OR_RETURN(const Mesh mesh, ReadMesh());
    mesh_sha256_ = Sha256(blobs_[0]->bytes());
    blobs_[0]->DropPages();  // not read any more
    const double decode_seconds = timer.Seconds();
    PLANISH_RETURN_IF_ERROR(CheckSize(mesh));
    PLANISH_RETURN_IF_ERROR(TakeElements(mesh, &options));
    PLANISH_RETURN_IF_ERROR(CheckCancel());

    PLANISH_ASSIGN_OR_RETURN(const UnwrapResult unwrapped, Solve(mesh, options));
    PLANISH_RETURN_IF_ERROR(CheckCancel());

    ReportStage(v1::STAGE_ENCODE);
    PLANISH_RETURN_IF_ERROR(Reach("encode"));
    timer.Restart();
    WorkOutcome outcome;
    PLANISH_ASSIGN_OR_RETURN(outcome.uv, PackUv(unwrapped.uv, unwrapped.precision));
    v1::Report* const report = outcome.result.mutable_report();
    *report = ToProto(unwrapped, mesh, options);
    Describe(unwrapped, outcome.uv->bytes(), outcome.result.mutable_uv());
    report->set_threads(options.threads);
    *report->mutable_times()->mutable_decode() = ToDuration(decode_seconds);
    *report->mutable_times()->mutable_encode() = ToDuration(timer.Seconds());
    report->set_peak_memory_bytes(PeakMemoryBytes());
    return outcome;
  }

 private:
  absl::StatusOr<UnwrapResult> Solve(const Mesh& mesh, const UnwrapOptions& options) {
    absl::Status failed;
    bool reached = false;
    UnwrapControl control;
    control.cancel = control_.cancel;
    control.stop = control_.stop;
    control.on_progress = [&](const UnwrapProgress& progress) {
      Report(ToProto(progress));
      if (progress.stage == UnwrapStage::kSolve && !std::exchange(reached, true)) failed = Reach("solve");
    };
    absl::StatusOr<UnwrapResult> unwrapped = Unwrap(mesh, options, control);
    if (!failed.ok()) return failed;
    return unwrapped;
  }

  // Reads the elements from the second blob.
  absl::Status TakeElements(const Mesh& mesh, UnwrapOptions* options) const {
    if (blobs_.size() < 2) return absl::OkStatus();
    v1::MeshElements elements;
    const std::string_view bytes = blobs_[1]->bytes();
    if (!elements.ParseFromArray(bytes.data(), static_cast<int>(bytes.size()))) {
      return InternalError("the server sent elements of a mesh that cannot be read");
    }
    absl::StatusOr<MeshElements> decoded = DecodeMeshElements(elements, request_.options(), mesh.num_faces());
    if (!decoded.ok()) return WithinField(decoded.status(), "elements.");
    options->seams.corners = std::move(decoded->seam_corners);
    options->seams.uncut_corners = std::move(decoded->uncut_corners);
    options->face_polygon = std::move(decoded->face_polygon);
    options->face_atlas = std::move(decoded->face_atlas);
    options->face_weights = std::move(decoded->face_weights);
    return WithinField(options->ValidateFor(mesh.num_faces()), "elements.");
  }

  absl::StatusOr<Mesh> ReadMesh() const {
    const std::string_view bytes = blobs_[0]->bytes();
    return request_.has_array_vertices() ? ReadMeshArrays(bytes, request_.array_vertices()) : DecodeDraco(bytes);
  }

  absl::Status Reach(std::string_view point) const {
    return control_.at_point ? control_.at_point(point) : absl::OkStatus();
  }

  absl::Status CheckSize(const Mesh& mesh) const {
    if (request_.max_triangles() <= 0 || mesh.num_faces() <= request_.max_triangles()) return absl::OkStatus();
    return MakeError(
        absl::StatusCode::kResourceExhausted, "MESH_TOO_LARGE",
        absl::StrCat("the mesh has ", mesh.num_faces(), " triangles, this server takes ", request_.max_triangles(),
                     " at most"),
        {{"triangles", absl::StrCat(mesh.num_faces())}, {"max_triangles", absl::StrCat(request_.max_triangles())}});
  }

  absl::Status CheckCancel() const {
    if (!IsInterrupted(control_.cancel)) return absl::OkStatus();
    return MakeError(absl::StatusCode::kCancelled, "CANCELLED", "the job was cancelled");
  }

  void ReportStage(v1::Stage stage) {
    v1::Progress progress = last_;
    progress.set_stage(stage);
    progress.set_linear_residual(0);
    progress.set_stage_fraction(0);
    Report(std::move(progress));
  }

  void Report(v1::Progress progress) {
    *progress.mutable_elapsed() = ToDuration(since_start_.Seconds());
    progress.set_tolerance(tolerance_);
    last_ = progress;
    if (throttle_.Pass(progress) && control_.on_progress) control_.on_progress(progress);
  }

  void Describe(const UnwrapResult& unwrapped, std::string_view bytes, v1::UvDescription* uv) const {
    uv->set_precision(ToProto(unwrapped.precision));
    uv->set_corner_count(static_cast<std::int64_t>(unwrapped.uv.size() / 2));
    uv->set_total_bytes(static_cast<std::int64_t>(bytes.size()));
    uv->set_mesh_sha256(mesh_sha256_);
    uv->set_uv_sha256(Sha256(bytes));
  }

  const WorkRequest& request_;
  const std::vector<BlobPtr>& blobs_;
  const WorkControl& control_;
  const Timer since_start_;
  double tolerance_ = 0;
  std::string mesh_sha256_;
  v1::Progress last_;
  ProgressThrottle throttle_;
};

WorkOutcome Failure(const absl::Status& status) {
  WorkOutcome outcome;
  // The core returns this error without a reason if a library ran out of memory.
  const bool out_of_memory =
      status.code() == absl::StatusCode::kResourceExhausted && ErrorInfoOf(status).reason.empty();
  *outcome.result.mutable_status() =
      ToRpcStatus(out_of_memory ? MakeError(status.code(), "OUT_OF_MEMORY", std::string(status.message())) : status);
  return outcome;
}

}  // namespace

bool ProgressThrottle::Pass(const v1::Progress& progress) {
  const bool one_chart = progress.chart_count() <= 1;
  const bool news =
      !last_.has_value() || progress.stage() != last_->stage() ||
      ToSeconds(progress.elapsed()) - ToSeconds(last_->elapsed()) >= kIntervalSeconds ||
      (one_chart && (progress.linear_residual() == 0 || progress.newton_iteration() != last_->newton_iteration()));
  if (news) last_ = progress;
  return news;
}

absl::Status OutOfMemory() {
  return MakeError(absl::StatusCode::kResourceExhausted, "OUT_OF_MEMORY",
                   "the job needed more memory than was reserved for it, for instance because its mesh makes very many "
                   "charts; weld its vertices, simplify it, or unwrap it in parts");
}

WorkOutcome DoWork(const WorkRequest& request, const std::vector<BlobPtr>& blobs, const WorkControl& control) {
  try {
    absl::StatusOr<WorkOutcome> outcome = Work(request, blobs, control).Run();
    return outcome.ok() ? *std::move(outcome) : Failure(outcome.status());
  } catch (const std::bad_alloc&) {
    return Failure(OutOfMemory());
  } catch (const std::system_error& error) {
    // Threads that cannot be started, usually because there is no memory for their stacks.
    const bool exhausted =
        error.code() == std::errc::resource_unavailable_try_again || error.code() == std::errc::not_enough_memory;
    return Failure(exhausted ? OutOfMemory() : InternalError(absl::StrCat("the worker failed: ", error.what())));
  } catch (const std::exception& error) {
    return Failure(InternalError(absl::StrCat("the worker failed: ", error.what())));
  }
}

}  // namespace planish
