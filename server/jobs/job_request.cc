#include "server/jobs/job_request.h"

#include <algorithm>

#include "absl/strings/str_cat.h"
#include "core/base/error.h"

namespace planish {
namespace {

constexpr std::size_t kMaxRequestId = 128;
constexpr std::size_t kMaxLabel = 256;

absl::Status TooLong(const std::string& field, std::size_t limit) {
  return MakeError(absl::StatusCode::kInvalidArgument, "REQUEST_INVALID",
                   absl::StrCat(field, " is longer than ", limit, " bytes"), {{"field", field}});
}

// Corners beyond the mesh are found when it has been decoded.
absl::Status CheckCorners(const std::string& field, const std::vector<std::int32_t>& corners) {
  const auto negative = std::find_if(corners.begin(), corners.end(), [](std::int32_t c) { return c < 0; });
  if (negative == corners.end()) return absl::OkStatus();
  return MakeError(absl::StatusCode::kInvalidArgument, "OPTIONS_INVALID",
                   absl::StrCat(field, ": there is no corner ", *negative),
                   {{"field", field}, {"corner", absl::StrCat(*negative)}});
}

}  // namespace

std::int64_t JobRequest::MeshBytes() const {
  return static_cast<std::int64_t>(draco.size() + sizeof(std::int32_t) * (seam_corners.size() + uncut_corners.size()));
}

absl::Status ValidateJobRequest(const JobRequest& request, std::int64_t max_mesh_bytes,
                                const OptionsValidator& validate_options) {
  if (request.draco.empty()) {
    return MakeError(absl::StatusCode::kInvalidArgument, "MESH_MISSING", "the request has no mesh",
                     {{"field", "draco"}});
  }
  const std::int64_t bytes = request.MeshBytes(), draco_bytes = static_cast<std::int64_t>(request.draco.size());
  if (bytes > max_mesh_bytes) {
    return MakeError(absl::StatusCode::kResourceExhausted, "MESH_TOO_LARGE",
                     absl::StrCat("the mesh has ", bytes, " bytes", bytes > draco_bytes ? " with its seams" : "",
                                  "; this server takes at most ", max_mesh_bytes),
                     {{"bytes", absl::StrCat(bytes)}, {"max_mesh_bytes", absl::StrCat(max_mesh_bytes)}});
  }
  if (request.request_id.size() > kMaxRequestId) return TooLong("request_id", kMaxRequestId);
  if (request.label.size() > kMaxLabel) return TooLong("label", kMaxLabel);
  if (absl::Status status = CheckCorners("seam_corners", request.seam_corners); !status.ok()) return status;
  if (absl::Status status = CheckCorners("uncut_corners", request.uncut_corners); !status.ok()) return status;
  return validate_options == nullptr ? absl::OkStatus() : validate_options(request.options);
}

}  // namespace planish
