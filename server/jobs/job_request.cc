#include "server/jobs/job_request.h"

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

}  // namespace

absl::Status ValidateJobRequest(const JobRequest& request, std::int64_t max_mesh_bytes,
                                const OptionsValidator& validate_options) {
  if (request.draco.empty()) {
    return MakeError(absl::StatusCode::kInvalidArgument, "MESH_MISSING", "the request has no mesh",
                     {{"field", "draco"}});
  }
  const auto bytes = static_cast<std::int64_t>(request.draco.size());
  if (bytes > max_mesh_bytes) {
    return MakeError(absl::StatusCode::kResourceExhausted, "MESH_TOO_LARGE",
                     absl::StrCat("the mesh has ", bytes, " bytes, this server takes at most ", max_mesh_bytes),
                     {{"bytes", absl::StrCat(bytes)}, {"max_mesh_bytes", absl::StrCat(max_mesh_bytes)}});
  }
  if (request.request_id.size() > kMaxRequestId) return TooLong("request_id", kMaxRequestId);
  if (request.label.size() > kMaxLabel) return TooLong("label", kMaxLabel);
  return validate_options == nullptr ? absl::OkStatus() : validate_options(request.options);
}

}  // namespace planish
