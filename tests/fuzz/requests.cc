// Messages that anybody may send. The first byte chooses the kind, the rest is the message in the wire format; what is
// no such message gets no further than gRPC.
#include <cmath>
#include <string>

#include "core/base/error.h"
#include "core/base/sha256.h"
#include "planish/v1/planish.pb.h"
#include "server/access/caller.h"
#include "server/jobs/job_request.h"
#include "server/worker/needs.h"
#include "server/worker/options.h"
#include "tests/fuzz/check.h"
#include "tests/fuzz/memory_budget.h"

namespace planish::fuzz {
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
  Require(std::isfinite(core->seams.max_stretch) && std::isfinite(core->seams.hard_edge_degrees), "seams are numbers");
  Require(core->atlas.texture_size > 0 && core->atlas.padding >= 0 && core->atlas.tiles > 0, "a texture has a size");
}

void CheckNeeds(std::string_view draco, std::int64_t mesh_bytes, const v1::MeshSize& size,
                const v1::UnwrapOptions& options) {
  const auto needs = EstimateNeeds(draco, mesh_bytes, size, options);
  if (!needs.ok()) return RequireReason(needs.status(), {"OPTIONS_INVALID", "MESH_DECODE_FAILED", "REQUEST_INVALID"});
  Require(needs->memory_bytes > 0, "a job needs memory");
  Require(std::isfinite(needs->run_seconds) && needs->run_seconds >= 0, "a job takes some time");
}

// As server/rpc makes it.
template <class Request>
JobRequest ToJobRequest(const Request& request) {
  JobRequest job;
  job.draco = request.draco();
  job.seam_corners = {request.seam_corners().begin(), request.seam_corners().end()};
  job.uncut_corners = {request.uncut_corners().begin(), request.uncut_corners().end()};
  job.options = request.options();
  job.scheduling = request.scheduling();
  job.request_id = request.request_id();
  job.label = request.label();
  return job;
}

template <class Request>
void CheckRequest(std::string_view bytes) {
  Request request;
  if (!request.ParseFromArray(bytes.data(), static_cast<int>(bytes.size()))) return;
  const JobRequest job = ToJobRequest(request);
  const absl::Status status = ValidateJobRequest(job, kMaxMeshBytes, ValidateOptions);
  if (!status.ok()) {
    return RequireReason(status, {"MESH_MISSING", "REQUEST_INVALID", "OPTIONS_INVALID", "MESH_TOO_LARGE"});
  }
  Require(!job.draco.empty() && job.MeshBytes() <= kMaxMeshBytes, "a mesh within the limit");
  const std::string corners = PackCorners(job);
  Require(corners.size() == 4 * (job.seam_corners.size() + job.uncut_corners.size()), "four bytes a corner");
  const std::string key = WorkKey(kDefaultTenant, job, Sha256(job.draco), Sha256(corners));
  Require(key.size() == 32 && key == WorkKey(kDefaultTenant, job, Sha256(job.draco), Sha256(corners)),
          "the same key for the same work");
  for (const auto* duration : {&job.scheduling.timeout(), &job.scheduling.compute_budget()}) {
    // What the manager counts in, 64 bits of nanoseconds, holds 292 years.
    Require(duration->seconds() >= 0 && duration->seconds() < 9'000'000'000, "limits of time are in range");
    Require(duration->nanos() >= 0 && duration->nanos() < 1'000'000'000, "nanoseconds are less than a second");
  }
  CheckNeeds(job.draco, job.MeshBytes(), {}, job.options);
}

}  // namespace
}  // namespace planish::fuzz

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace planish;
  using namespace planish::fuzz;
  const MemoryBudget budget(kMemory);
  Bytes input(data, size);
  const int kind = input.Below(4);
  const std::string_view bytes = input.Rest();
  if (kind == 0) {
    v1::UnwrapOptions options;
    if (options.ParseFromArray(bytes.data(), static_cast<int>(bytes.size()))) CheckOptions(options);
  } else if (kind == 1) {
    CheckRequest<v1::UnwrapRequest>(bytes);
  } else if (kind == 2) {
    CheckRequest<v1::CreateJobRequest>(bytes);
  } else {
    v1::EstimateJobRequest request;
    if (!request.ParseFromArray(bytes.data(), static_cast<int>(bytes.size()))) return 0;
    CheckNeeds(request.draco(), request.mesh_bytes(), request.size(), request.options());
  }
  return 0;
}
