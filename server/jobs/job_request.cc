#include "server/jobs/job_request.h"

#include <algorithm>

#include "absl/strings/str_cat.h"
#include "core/base/error.h"
#include "core/base/sha256.h"
#include "core/base/status_macros.h"
#include "google/protobuf/descriptor.h"
#include "google/protobuf/io/coded_stream.h"
#include "google/protobuf/io/zero_copy_stream_impl_lite.h"
#include "google/protobuf/message.h"
#include "planish/v1/about.pb.h"
#include "server/link/mesh_elements.h"
#include "server/link/rpc_status.h"
#include "server/store/job_filter.h"

namespace planish {
namespace {

constexpr std::size_t kMaxRequestId = 128;
constexpr std::size_t kMaxLabels = 32;
constexpr std::size_t kMaxLabelValue = 256;
constexpr int kMaxTiles = 100;
constexpr std::size_t kVertexBytes = 3 * sizeof(float);
constexpr std::size_t kTriangleBytes = 3 * sizeof(std::uint32_t);
// A hundred years. Times are 64-bit counts of nanoseconds, which reach 292 years.
constexpr std::int64_t kMaxDurationSeconds = std::int64_t{100} * 365 * 86'400;
constexpr std::int32_t kNanosPerSecond = 1'000'000'000;

absl::Status TooLong(const std::string& field, std::size_t limit) {
  return MakeError(absl::StatusCode::kInvalidArgument, "REQUEST_INVALID",
                   absl::StrCat(field, " is longer than ", limit, " bytes"), {{"field", field}});
}

absl::Status BadArrays(const std::string& reason, const std::string& field, const std::string& message) {
  return MakeError(absl::StatusCode::kInvalidArgument, reason, absl::StrCat(field, ": ", message), {{"field", field}});
}

absl::Status CheckLabels(const std::map<std::string, std::string>& labels) {
  const auto wrong = [](const std::string& message) {
    return MakeError(absl::StatusCode::kInvalidArgument, "REQUEST_INVALID", message, {{"field", "labels"}});
  };
  if (labels.size() > kMaxLabels) return wrong(absl::StrCat("labels: there are more than ", kMaxLabels));
  for (const auto& [key, value] : labels) {
    if (!IsLabelKey(key)) {
      return wrong(absl::StrCat("labels: a key has 1 to ", kMostLabelKey,
                                R"( characters of a-z, 0-9, "-" and "_", the first one a letter)"));
    }
    if (value.size() > kMaxLabelValue) {
      return wrong(absl::StrCat("labels: the value of ", key, " is longer than ", kMaxLabelValue, " bytes"));
    }
  }
  return absl::OkStatus();
}

absl::Status CheckDuration(const std::string& field, bool is_set, const google::protobuf::Duration& duration) {
  if (!is_set) return absl::OkStatus();
  const bool has_nanos = duration.nanos() >= 0 && duration.nanos() < kNanosPerSecond;
  const bool in_range = duration.seconds() >= 0 && duration.seconds() < kMaxDurationSeconds;
  if (has_nanos && in_range && (duration.seconds() > 0 || duration.nanos() > 0)) return absl::OkStatus();
  return MakeError(absl::StatusCode::kInvalidArgument, "REQUEST_INVALID",
                   absl::StrCat(field, " must be above 0 and below 100 years"), {{"field", field}});
}

absl::Status CheckScheduling(const v1::Scheduling& scheduling) {
  if (!v1::Priority_IsValid(scheduling.priority())) {
    return MakeError(absl::StatusCode::kInvalidArgument, "REQUEST_INVALID",
                     absl::StrCat("there is no priority ", static_cast<int>(scheduling.priority())),
                     {{"field", "scheduling.priority"}});
  }
  PLANISH_RETURN_IF_ERROR(CheckDuration("scheduling.timeout", scheduling.has_timeout(), scheduling.timeout()));
  return CheckDuration("scheduling.compute_budget", scheduling.has_compute_budget(), scheduling.compute_budget());
}

// Serializes `message`; equal messages give the same bytes. Protobuf guarantees this only within one version of a
// program, which suffices for a cache: another version computes the result again.
std::string Deterministic(const google::protobuf::Message& message) {
  std::string bytes;
  google::protobuf::io::StringOutputStream stream(&bytes);
  google::protobuf::io::CodedOutputStream coded(&stream);
  coded.SetSerializationDeterministic(true);
  message.SerializeToCodedStream(&coded);
  coded.Trim();
  return bytes;
}

}  // namespace

absl::StatusOr<JobRequest> TakeJobRequest(v1::JobSpec* spec) {
  JobRequest job;
  if (spec->has_draco()) job.bytes = std::move(*spec->mutable_draco());
  if (spec->has_arrays()) {
    std::string& positions = *spec->mutable_arrays()->mutable_positions();
    const std::string& triangles = spec->arrays().triangles();
    if (positions.size() % kVertexBytes != 0) {
      return BadArrays("MESH_POSITION_INVALID", "arrays.positions",
                       absl::StrCat(positions.size(), " bytes are no multiple of ", kVertexBytes));
    }
    if (triangles.size() % kTriangleBytes != 0) {
      return BadArrays("MESH_INDEX_OUT_OF_RANGE", "arrays.triangles",
                       absl::StrCat(triangles.size(), " bytes are no multiple of ", kTriangleBytes));
    }
    if (triangles.empty()) return BadArrays("MESH_EMPTY", "arrays.triangles", "the mesh has no triangle");
    job.array_vertices = static_cast<std::int64_t>(positions.size() / kVertexBytes);
    job.bytes = std::move(positions);
    job.bytes.append(triangles);
    spec->clear_arrays();
  }
  job.elements.Swap(spec->mutable_elements());
  job.elements.DiscardUnknownFields();
  job.options = spec->options();
  job.scheduling = spec->scheduling();
  job.labels = {spec->labels().begin(), spec->labels().end()};
  return job;
}

v1::MeshSize SizeOfArrays(std::size_t bytes, std::int64_t vertices) {
  v1::MeshSize size;
  size.set_vertices(vertices);
  size.set_triangles(
      static_cast<std::int64_t>((bytes - static_cast<std::size_t>(vertices) * kVertexBytes) / kTriangleBytes));
  return size;
}

std::int64_t JobRequest::MeshBytes() const {
  const std::size_t of_elements = elements.seam_corners().size() + elements.uncut_corners().size() +
                                  elements.face_polygon().size() + elements.face_atlas().size() +
                                  elements.face_weights().size();
  return static_cast<std::int64_t>(Mesh().size() + of_elements);
}

std::optional<std::int64_t> JobRequest::FaceCount() const {
  if (!array_vertices.has_value()) return std::nullopt;
  return SizeOfArrays(Mesh().size(), *array_vertices).triangles();
}

v1::UnwrapOptions JobRequest::OptionsForNeeds() const {
  v1::UnwrapOptions with_tiles = options;
  if (elements.face_atlas().empty() || options.atlas_layout() == v1::ATLAS_LAYOUT_STACKED) return with_tiles;
  const absl::StatusOr<MeshElements> decoded = DecodeMeshElements(elements, options, FaceCount());
  if (!decoded.ok()) return with_tiles;  // ValidateJobRequest() reports this
  const std::vector<std::int32_t>& face_atlas = decoded->face_atlas;
  const std::int64_t atlases = std::int64_t{1} + *std::max_element(face_atlas.begin(), face_atlas.end());
  const std::int64_t tiles = std::clamp<std::int64_t>(atlases * std::max(1, options.tiles()), 1, kMaxTiles);
  with_tiles.set_tiles(static_cast<std::int32_t>(tiles));
  return with_tiles;
}

absl::Status MeshTooLarge(std::int64_t bytes, std::int64_t limit) {
  return MakeError(
      absl::StatusCode::kResourceExhausted, "MESH_TOO_LARGE",
      absl::StrCat("the mesh has ", bytes, " bytes with its seams, polygons and atlases; this server takes at most ", limit),
      {{"bytes", absl::StrCat(bytes)}, {"limit", absl::StrCat(limit)}});
}

absl::Status ValidateJobRequest(const JobRequest& request, std::int64_t max_mesh_bytes,
                                const OptionsValidator& validate_options) {
  if (request.Mesh().empty()) {
    return MakeError(absl::StatusCode::kInvalidArgument, "MESH_MISSING", "the request has no mesh",
                     {{"field", "mesh"}});
  }
  if (const std::int64_t bytes = request.MeshBytes(); bytes > max_mesh_bytes)
    return MeshTooLarge(bytes, max_mesh_bytes);
  if (request.request_id.size() > kMaxRequestId) return TooLong("request_id", kMaxRequestId);
  PLANISH_RETURN_IF_ERROR(CheckLabels(request.labels));
  PLANISH_RETURN_IF_ERROR(CheckScheduling(request.scheduling));
  PLANISH_RETURN_IF_ERROR(CheckOptions(request.options, validate_options));
  return WithinField(DecodeMeshElements(request.elements, request.options, request.FaceCount()).status(), "elements.");
}

absl::Status CheckOptions(const v1::UnwrapOptions& options, const OptionsValidator& validate) {
  return validate == nullptr ? absl::OkStatus() : WithinField(validate(options), "options.");
}

std::string PackElements(const JobRequest& request) {
  return Deterministic(request.elements);
}

std::string WorkKey(const std::string& tenant, const JobRequest& request, std::string_view mesh_sha256,
                    std::string_view elements_sha256) {
  v1::UnwrapOptions options = request.options;
  const google::protobuf::Descriptor& fields = *options.GetDescriptor();
  for (int i = 0; i < fields.field_count(); ++i) {
    if (fields.field(i)->options().GetExtension(v1::about).keeps_result()) {
      options.GetReflection()->ClearField(&options, fields.field(i));
    }
  }
  // Slashes and lengths separate the fields, so that different requests never give the same text.
  return Sha256(absl::StrCat(
      PLANISH_VERSION "/", tenant, "/", absl::AlphaNum(absl::string_view(mesh_sha256.data(), mesh_sha256.size())), "/",
      absl::string_view(elements_sha256.data(), elements_sha256.size()), "/",
      request.array_vertices.has_value() ? absl::StrCat(*request.array_vertices) : "draco", "/",
      request.failpoint.size(), request.failpoint, Deterministic(options)));
}

}  // namespace planish
