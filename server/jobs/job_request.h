// A caller's request for a job, before the job exists.
#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <map>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "absl/time/time.h"
#include "planish/v1/planish.pb.h"
#include "server/link/blob.h"

namespace planish {

using OptionsValidator = std::function<absl::Status(const v1::UnwrapOptions&)>;

// What a job will need.
struct JobNeeds {
  v1::MeshSize size;              // as declared by the mesh; zeros: unknown
  std::int64_t memory_bytes = 0;  // memory of its worker beyond that of an idle worker
  double run_seconds = 0;         // on one idle core, roughly
};

// Estimates from the first bytes of a Draco file of `mesh_bytes` bytes, or from `size` if they do not tell the counts.
// INVALID_ARGUMENT with MESH_DECODE_FAILED for bytes that are no Draco file.
using NeedsEstimator = std::function<absl::StatusOr<JobNeeds>(std::string_view draco, std::int64_t mesh_bytes,
                                                              const v1::MeshSize& size, const v1::UnwrapOptions&)>;

// The contents of a caller's JobSpec.
struct JobRequest {
  std::string bytes;        // of the mesh: Draco, or arrays as a worker gets them (planish.worker.v1.WorkRequest)
  BlobPtr mesh;             // in place of `bytes`: a mesh that the server already has
  std::string mesh_sha256;  // of `mesh`; empty: unknown
  std::optional<std::int64_t> array_vertices;  // number of vertices, if the mesh comes as arrays
  v1::MeshElements elements;
  v1::UnwrapOptions options;
  v1::Scheduling scheduling;
  std::string request_id;
  std::map<std::string, std::string> labels;
  // The job belongs to its callers: it is cancelled when the last JobAttachment goes.
  bool attached = false;
  // The fault to inject, for tests: planish.worker.v1.WorkRequest.failpoint.
  std::string failpoint;

  // The bytes of the mesh, from `mesh` or `bytes`.
  std::string_view Mesh() const { return mesh != nullptr ? mesh->bytes() : std::string_view(bytes); }
  // The bytes of the mesh and its elements, which count towards limits.
  std::int64_t MeshBytes() const;
  // The number of triangles, if the mesh comes as arrays. For Draco data only the worker knows it.
  std::optional<std::int64_t> FaceCount() const;
  // The options, with the number of tiles that the charts may be packed into concurrently: for estimates.
  v1::UnwrapOptions OptionsForNeeds() const;
};

// The numbers of triangles and vertices of a mesh that is sent as arrays of `bytes` bytes in all.
v1::MeshSize SizeOfArrays(std::size_t bytes, std::int64_t vertices);

// The error for a mesh of more than `limit` bytes: RESOURCE_EXHAUSTED with MESH_TOO_LARGE.
absl::Status MeshTooLarge(std::int64_t bytes, std::int64_t limit);

// Moves the mesh, its seams and everything else out of `spec`. The caller of this function looks up an upload or a
// digest. INVALID_ARGUMENT for arrays that do not come in threes (MESH_POSITION_INVALID, MESH_INDEX_OUT_OF_RANGE) or
// have no triangle (MESH_EMPTY), naming the field.
absl::StatusOr<JobRequest> TakeJobRequest(v1::JobSpec* spec);

// Checks a request. INVALID_ARGUMENT with the wrong field of planish.v1.JobSpec, or "request_id", as metadata "field";
// the reason is MESH_MISSING, REQUEST_INVALID, OPTIONS_INVALID of DecodeMeshElements() (server/link/mesh_elements.h),
// or that of `validate_options`, which may be null. RESOURCE_EXHAUSTED with MESH_TOO_LARGE.
absl::Status ValidateJobRequest(const JobRequest& request, std::int64_t max_mesh_bytes,
                                const OptionsValidator& validate_options);

// The result of `validate` (may be null), with the field's path in planish.v1.JobSpec.
absl::Status CheckOptions(const v1::UnwrapOptions& options, const OptionsValidator& validate);

// The elements as the bytes of a WorkRequest's second blob; empty if the request says nothing about elements.
std::string PackElements(const JobRequest& request);

// SHA-256 of everything that determines the result, and of the tenant, since tenants share nothing. Options that do not
// change the result (threads) are left out.
std::string WorkKey(const std::string& tenant, const JobRequest& request, std::string_view mesh_sha256,
                    std::string_view elements_sha256);

}  // namespace planish
