#include "server/rpc/methods.h"

#include <cstdlib>

#include "absl/strings/str_cat.h"

namespace planish {
namespace {

constexpr std::string_view kPlanish = "planish.v1.Planish";
constexpr std::string_view kAdmin = "planish.admin.v1.Admin";
constexpr std::string_view kHealth = "grpc.health.v1.Health";
constexpr std::string_view kReflection = "grpc.reflection.v1alpha.ServerReflection";

constexpr std::int64_t kSmallBytes = std::int64_t{64} << 10;

constexpr std::int64_t kFewFields = 64;
// A job has some 150 fields: about fifty for the mesh, options and scheduling, and three for each of up to 32 labels.
constexpr std::int64_t kJobFields = 512;
// A list may have 1000 entries. This limit is higher, so that a list that is somewhat too long is refused by the method
// itself, with a clearer error.
constexpr std::int64_t kListFields = 4096;
constexpr std::int64_t kBatchFields = 1024 * kJobFields;

using enum MessageSize;

constexpr Method kMethods[] = {
    {kPlanish, "Unwrap", Need::kSubmit, kJob, kJobFields, Work::kWrites, /*streams=*/true, /*submits=*/true},
    {kPlanish, "CreateJob", Need::kSubmit, kJob, kJobFields, Work::kWrites, /*streams=*/false, /*submits=*/true},
    {kPlanish, "BatchCreateJobs", Need::kSubmit, kJob, kBatchFields, Work::kWrites, /*streams=*/false,
     /*submits=*/true},
    {kPlanish, "EstimateJob", Need::kSubmit, kJob, kJobFields, Work::kReads},
    {kPlanish, "FindMissingMeshes", Need::kSubmit, kSmall, kListFields, Work::kReads},
    {kPlanish, "GetJob", Need::kJobs, kSmall, kFewFields, Work::kReads},
    {kPlanish, "WaitJob", Need::kFollow, kSmall, kFewFields, Work::kReads, /*streams=*/true},
    {kPlanish, "WatchJob", Need::kFollow, kSmall, kFewFields, Work::kReads, /*streams=*/true},
    {kPlanish, "ReadResult", Need::kFollow, kSmall, kFewFields, Work::kReads},
    {kPlanish, "ListJobs", Need::kJobs, kSmall, kFewFields, Work::kReads},
    {kPlanish, "StopJob", Need::kFollow, kSmall, kFewFields, Work::kWrites},
    {kPlanish, "CancelJob", Need::kFollow, kSmall, kFewFields, Work::kWrites},
    {kPlanish, "DeleteJob", Need::kJobs, kSmall, kFewFields, Work::kWrites},
    {kPlanish, "CreateUpload", Need::kSubmit, kSmall, kFewFields, Work::kWrites, /*streams=*/false, /*submits=*/true},
    {kPlanish, "WriteUpload", Need::kSubmit, kPiece, kFewFields, Work::kMoves, /*streams=*/true, /*submits=*/true},
    {kPlanish, "GetUpload", Need::kSubmit, kSmall, kFewFields, Work::kReads},
    {kPlanish, "ListUploads", Need::kSubmit, kSmall, kFewFields, Work::kReads},
    {kPlanish, "DeleteUpload", Need::kSubmit, kSmall, kFewFields, Work::kWrites},
    {kPlanish, "GetCapabilities", Need::kNothing, kSmall, kFewFields, Work::kNone},
    {kAdmin, "Drain", Need::kAdmin, kSmall, kFewFields, Work::kReads},
    {kAdmin, "Undrain", Need::kAdmin, kSmall, kFewFields, Work::kReads},
    {kAdmin, "GetStats", Need::kAdmin, kSmall, kFewFields, Work::kReads},
    {kAdmin, "GetConfig", Need::kAdmin, kSmall, kFewFields, Work::kReads},
    {kHealth, "Check", Need::kNobody, kSmall, kFewFields, Work::kNone},
    {kHealth, "Watch", Need::kNobody, kSmall, kFewFields, Work::kNone, /*streams=*/true},
    {kReflection, "ServerReflectionInfo", Need::kNobody, kSmall, kFewFields, Work::kNone, /*streams=*/true},
};

}  // namespace

std::string Method::path() const {
  return absl::StrCat("/", std::string(service), "/", std::string(name));
}

const google::protobuf::Descriptor* Method::request() const {
  const auto* found = google::protobuf::DescriptorPool::generated_pool()->FindMethodByName(
      absl::StrCat(std::string(service), ".", std::string(name)));
  return found == nullptr ? nullptr : found->input_type();
}

const Method& MethodAt(std::string_view path) {
  for (const Method& method : kMethods) {
    if (method.path() == path) return method;
  }
  std::abort();
}

std::int64_t MethodLimits::MaxBytes(const Method& method) const {
  if (method.size == kJob) return job_bytes;
  if (method.size == kPiece) return piece_bytes;
  return kSmallBytes;
}

}  // namespace planish
