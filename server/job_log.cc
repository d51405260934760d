#include "server/job_log.h"

#include <string>

#include "absl/strings/escaping.h"
#include "google/protobuf/util/time_util.h"
#include "google/rpc/error_details.pb.h"
#include "server/jobs/lifecycle.h"
#include "spdlog/spdlog.h"

namespace planish {
namespace {

using google::protobuf::Timestamp;
using google::protobuf::util::TimeUtil;

double Seconds(const Timestamp& from, const Timestamp& to) {
  return static_cast<double>(TimeUtil::DurationToMicroseconds(to - from)) * 1e-6;
}

// Labels and messages come from outside: no line breaks or terminal codes in the log.
std::string Quote(const std::string& text) {
  return "\"" + absl::Utf8SafeCEscape(text) + "\"";
}

std::string Reason(const v1::Job& job) {
  google::rpc::ErrorInfo info;
  for (const auto& detail : job.error().details()) {
    if (detail.UnpackTo(&info)) return info.reason();
  }
  return "?";
}

}  // namespace

void LogTransition(const v1::Job& job) {
  const std::string state = StateName(job.state());
  const double seconds = job.has_start_time() ? Seconds(job.start_time(), job.end_time()) : 0;
  switch (job.state()) {
    case v1::JOB_STATE_QUEUED:
      spdlog::info("{} {} mesh_bytes={} label={}", job.name(), state, job.mesh_bytes(), Quote(job.label()));
      break;
    case v1::JOB_STATE_RUNNING:
      spdlog::info("{} {} waited={:.3f}s", job.name(), state, Seconds(job.create_time(), job.start_time()));
      break;
    case v1::JOB_STATE_SUCCEEDED:
      spdlog::info("{} {} ran={:.3f}s triangles={} uv_bytes={} warnings={}", job.name(), state, seconds,
                   job.report().input().triangles(), job.uv().total_bytes(), job.report().warnings_size());
      break;
    case v1::JOB_STATE_FAILED:
      spdlog::warn("{} {} ran={:.3f}s reason={} message={}", job.name(), state, seconds, Reason(job),
                   Quote(job.error().message()));
      break;
    case v1::JOB_STATE_CANCELLED:
      spdlog::info("{} {} ran={:.3f}s", job.name(), state, seconds);
      break;
    default:
      spdlog::info("{} {}", job.name(), state);
  }
}

}  // namespace planish
