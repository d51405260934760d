#include "server/job_log.h"

#include <map>
#include <string>
#include <utility>

#include "absl/strings/str_cat.h"
#include "core/base/trace_context.h"
#include "google/protobuf/util/time_util.h"
#include "google/rpc/error_details.pb.h"
#include "server/store/lifecycle.h"

namespace planish {
namespace {

using google::protobuf::Timestamp;
using google::protobuf::util::TimeUtil;

double Seconds(const Timestamp& from, const Timestamp& to) {
  return static_cast<double>(TimeUtil::DurationToMicroseconds(to - from)) * 1e-6;
}

std::string Reason(const v1::Job& job) {
  google::rpc::ErrorInfo info;
  for (const auto& detail : job.error().details()) {
    if (detail.UnpackTo(&info)) return info.reason();
  }
  return "?";
}

// "build=1234 file=spot.obj", in order of the keys.
std::string LabelsOf(const v1::Job& job) {
  const std::map<std::string, std::string> labels(job.labels().begin(), job.labels().end());
  std::string text;
  for (const auto& [key, value] : labels) absl::StrAppend(&text, text.empty() ? "" : " ", key, "=", value);
  return text;
}

// The fields that describe the event.
LogFields Facts(const v1::Job& job) {
  const double ran = job.has_start_time() ? Seconds(job.start_time(), job.end_time()) : 0;
  switch (job.state()) {
    case v1::JOB_STATE_QUEUED:
      return {{"mesh_bytes", job.mesh_bytes()}, {"labels", LabelsOf(job)}};
    case v1::JOB_STATE_RUNNING:
      return {{"waited_seconds", Seconds(job.create_time(), job.start_time())}};
    case v1::JOB_STATE_SUCCEEDED:
      return {{"ran_seconds", ran},
              {"triangles", job.report().input().triangles()},
              {"uv_bytes", job.uv().total_bytes()},
              {"warnings", job.report().warnings_size()}};
    case v1::JOB_STATE_FAILED:
      return {{"ran_seconds", ran}, {"reason", Reason(job)}, {"error", job.error().message()}};
    case v1::JOB_STATE_CANCELLED:
      return {{"ran_seconds", ran}};
    default:
      return {};
  }
}

}  // namespace

LogFields JobFields(const v1::Job& job) {
  return {{"job", job.name()}, {"tenant", job.tenant()}, {"trace", std::string(TraceIdOf(job.traceparent()))}};
}

void LogTransition(const v1::Job& job) {
  LogFields fields = JobFields(job);
  for (LogField& fact : Facts(job)) fields.push_back(std::move(fact));
  Log(job.state() == v1::JOB_STATE_FAILED ? LogLevel::kWarn : LogLevel::kInfo, StateName(job.state()), fields);
}

}  // namespace planish
