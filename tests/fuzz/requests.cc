// Messages that anybody may send. The first byte chooses the kind, the rest is the message in the wire format (what is
// no such message gets no further than gRPC), or the text of a filter.
#include <cmath>
#include <string>

#include "core/base/error.h"
#include "core/base/sha256.h"
#include "planish/v1/planish.pb.h"
#include "server/access/caller.h"
#include "server/jobs/job_request.h"
#include "server/store/job_filter.h"
#include "server/worker/mesh_arrays.h"
#include "server/worker/needs.h"
#include "server/worker/options.h"
#include "tests/fuzz/check.h"
#include "tests/fuzz/memory_budget.h"

namespace planish::fuzz::requests {
namespace {

constexpr std::int64_t kMemory = std::int64_t{64} << 20;
constexpr std::int64_t kMaxMeshBytes = 1000;

void CheckOptions(const v1::UnwrapOptions& options) {
  const auto core = ToCore(options);
  Require(ValidateOptions(options) == core.status(), "one check, whoever asks");
  if (!core.ok()) {
    RequireReason(core.status(), {"OPTIONS_INVALID"});
    Require(!ErrorInfoOf(core.status()).metadata["field"].empty(), "the field is named");
    return;
  }
  Require(core->Validate().ok(), "options that were taken are valid");
  Require(std::isfinite(core->flatten.tolerance) && core->flatten.tolerance > 0, "tolerance is a number above 0");
  Require(core->flatten.max_newton_iterations >= 0, "iterations are counted from 0");
  Require(core->threads >= 1 && core->threads <= kMaxThreads, "threads in range");
  Require(std::isfinite(core->MaxStretch()) && std::isfinite(core->seams.hard_edge_degrees), "seams are numbers");
  Require(core->atlas.texture_size > 0 && core->atlas.padding >= 0 && core->atlas.tiles > 0, "a texture has a size");
}

void CheckNeeds(std::string_view draco, std::int64_t mesh_bytes, const v1::MeshSize& size,
                const v1::UnwrapOptions& options) {
  const auto needs = EstimateNeeds(draco, mesh_bytes, size, options);
  if (!needs.ok()) return RequireReason(needs.status(), {"OPTIONS_INVALID", "MESH_DECODE_FAILED", "REQUEST_INVALID"});
  Require(needs->memory_bytes > 0, "a job needs memory");
  Require(std::isfinite(needs->run_seconds) && needs->run_seconds >= 0, "a job takes some time");
}

void CheckArrays(const JobRequest& job) {
  const v1::MeshSize size = SizeOfArrays(job.Mesh().size(), *job.array_vertices);
  Require(size.triangles() > 0 && size.vertices() >= 0, "arrays have a size");
  Require(12 * (size.triangles() + size.vertices()) == static_cast<std::int64_t>(job.Mesh().size()),
          "that of their bytes");
  const auto mesh = ReadMeshArrays(job.Mesh(), size.vertices());
  if (!mesh.ok()) return RequireReason(mesh.status(), {"MESH_INDEX_OUT_OF_RANGE"});
  Require(mesh->num_faces() == size.triangles() && mesh->num_vertices() == size.vertices(), "all of them are read");
}

void CheckJobRequest(v1::JobSpec spec, const std::string& request_id) {
  auto taken = TakeJobRequest(&spec);
  if (!taken.ok()) {
    return RequireReason(taken.status(), {"MESH_POSITION_INVALID", "MESH_INDEX_OUT_OF_RANGE", "MESH_EMPTY"});
  }
  taken->request_id = request_id;
  const JobRequest& job = *taken;
  const absl::Status status = ValidateJobRequest(job, kMaxMeshBytes, ValidateOptions);
  if (!status.ok()) {
    if (status.code() == absl::StatusCode::kInvalidArgument) {
      Require(!ErrorInfoOf(status).metadata["field"].empty(), "the field is named");
    }
    return RequireReason(status, {"MESH_MISSING", "REQUEST_INVALID", "OPTIONS_INVALID", "MESH_TOO_LARGE"});
  }
  Require(!job.bytes.empty() && job.MeshBytes() <= kMaxMeshBytes, "a mesh within the limit");
  if (job.array_vertices.has_value()) CheckArrays(job);
  const std::string elements = PackElements(job);
  Require(job.OptionsForNeeds().tiles() <= std::max(100, job.options.tiles()), "tiles are in range");
  const std::string key = WorkKey(kDefaultTenant, job, Sha256(job.bytes), Sha256(elements));
  Require(key.size() == 32 && key == WorkKey(kDefaultTenant, job, Sha256(job.bytes), Sha256(elements)),
          "the same key for the same work");
  for (const auto& [name, value] : job.labels) Require(IsLabelKey(name) && value.size() <= 256, "labels are in range");
  for (const auto* duration : {&job.scheduling.timeout(), &job.scheduling.compute_budget()}) {
    // What the manager counts in, 64 bits of nanoseconds, holds 292 years.
    Require(duration->seconds() >= 0 && duration->seconds() < 9'000'000'000, "limits of time are in range");
    Require(duration->nanos() >= 0 && duration->nanos() < 1'000'000'000, "nanoseconds are less than a second");
  }
  const bool is_arrays = job.array_vertices.has_value();
  const v1::MeshSize size = is_arrays ? SizeOfArrays(job.Mesh().size(), *job.array_vertices) : v1::MeshSize();
  CheckNeeds(is_arrays ? std::string_view() : job.Mesh(), job.MeshBytes(), size, job.options);
}

template <class Request>
void CheckRequest(std::string_view bytes) {
  Request request;
  if (!request.ParseFromArray(bytes.data(), static_cast<int>(bytes.size()))) return;
  CheckJobRequest(request.spec(), request.request_id());
}

void CheckFilter(std::string_view text) {
  const auto filter = ParseJobFilter(text);
  if (!filter.ok()) return RequireReason(filter.status(), {"REQUEST_INVALID"});
  for (const LabelCondition& condition : filter->labels)
    Require(IsLabelKey(condition.key), "keys can be those of labels");
  for (const StateCondition& condition : filter->states) {
    Require(v1::JobState_IsValid(condition.state) && condition.state != v1::JOB_STATE_UNSPECIFIED, "states are real");
  }
}

}  // namespace

FUZZ_TARGET(requests, bytes) {
  const MemoryBudget budget(kMemory);
  Bytes input(bytes);
  const int kind = input.Below(6);
  const std::string_view message = input.Rest();
  if (kind == 0) {
    v1::UnwrapOptions options;
    if (options.ParseFromArray(message.data(), static_cast<int>(message.size()))) CheckOptions(options);
  } else if (kind == 1) {
    CheckRequest<v1::UnwrapRequest>(message);
  } else if (kind == 2) {
    CheckRequest<v1::CreateJobRequest>(message);
  } else if (kind == 3) {
    v1::EstimateJobRequest request;
    if (!request.ParseFromArray(message.data(), static_cast<int>(message.size()))) return;
    CheckNeeds(request.spec().draco(), request.mesh_bytes(), request.size(), request.spec().options());
  } else if (kind == 4) {
    v1::BatchCreateJobsRequest batch;
    if (!batch.ParseFromArray(message.data(), static_cast<int>(message.size()))) return;
    for (const v1::CreateJobRequest& request : batch.requests()) CheckJobRequest(request.spec(), request.request_id());
  } else {
    CheckFilter(message);
  }
}

}  // namespace planish::fuzz::requests
