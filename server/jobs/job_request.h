// A caller's wish, before it is a job.
#pragma once

#include <cstdint>
#include <functional>
#include <string>
#include <vector>

#include "absl/status/status.h"
#include "planish/v1/job.pb.h"

namespace planish {

using OptionsValidator = std::function<absl::Status(const v1::UnwrapOptions&)>;

// Fields as in planish.v1.UnwrapRequest.
struct JobRequest {
  std::string draco;
  std::vector<std::int32_t> seam_corners;
  std::vector<std::int32_t> uncut_corners;
  v1::UnwrapOptions options;
  std::string request_id;
  std::string label;
  // The job belongs to its callers: it is cancelled when the last JobAttachment goes.
  bool attached = false;

  // Of the mesh and its seams, as they count towards limits.
  std::int64_t MeshBytes() const;
};

// INVALID_ARGUMENT naming the field (metadata "field"; reason MESH_MISSING, REQUEST_INVALID, OPTIONS_INVALID for a
// negative corner, with its id as "corner", or what `validate_options` says); RESOURCE_EXHAUSTED with
// MESH_TOO_LARGE. `validate_options` may be null.
absl::Status ValidateJobRequest(const JobRequest& request, std::int64_t max_mesh_bytes,
                                const OptionsValidator& validate_options);

}  // namespace planish
