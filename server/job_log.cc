#include "server/job_log.h"

#include <string>
#include <string_view>

#include "absl/strings/escaping.h"
#include "core/base/trace_context.h"
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
  const std::string_view trace = TraceIdOf(job.traceparent());
  const double seconds = job.has_start_time() ? Seconds(job.start_time(), job.end_time()) : 0;
  switch (job.state()) {
    case v1::JOB_STATE_QUEUED:
      spdlog::info("{} {} trace={} mesh_bytes={} label={}", job.name(), state, trace, job.mesh_bytes(),
                   Quote(job.label()));
      break;
    case v1::JOB_STATE_RUNNING:
      spdlog::info("{} {} trace={} waited={:.3f}s", job.name(), state, trace,
                   Seconds(job.create_time(), job.start_time()));
      break;
    case v1::JOB_STATE_SUCCEEDED:
      spdlog::info("{} {} trace={} ran={:.3f}s triangles={} uv_bytes={} warnings={}", job.name(), state, trace, seconds,
                   job.report().input().triangles(), job.uv().total_bytes(), job.report().warnings_size());
      break;
    case v1::JOB_STATE_FAILED:
      spdlog::warn("{} {} trace={} ran={:.3f}s reason={} message={}", job.name(), state, trace, seconds, Reason(job),
                   Quote(job.error().message()));
      break;
    case v1::JOB_STATE_CANCELLED:
      spdlog::info("{} {} trace={} ran={:.3f}s", job.name(), state, trace, seconds);
      break;
    default:
      spdlog::info("{} {} trace={}", job.name(), state, trace);
  }
}

}  // namespace planish
