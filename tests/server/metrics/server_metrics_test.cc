#include "server/metrics/server_metrics.h"

#include <cmath>
#include <limits>

#include "core/base/error.h"
#include "gmock/gmock.h"
#include "gtest/gtest.h"
#include "server/link/rpc_status.h"
#include "server/metrics/label_guard.h"
#include "server/metrics/process_stats.h"
#include "server/metrics/readiness.h"
#include "server/metrics/store_probe.h"
#include "tests/testing/files.h"

namespace planish {
namespace {

using ::testing::HasSubstr;
using ::testing::Not;

v1::Job JobAt(v1::JobState state, double created, double started, double ended) {
  v1::Job job;
  job.set_tenant("lighting");
  job.set_state(state);
  job.set_attempts(1);
  job.mutable_create_time()->set_seconds(static_cast<std::int64_t>(created));
  job.mutable_start_time()->set_seconds(static_cast<std::int64_t>(started));
  job.mutable_end_time()->set_seconds(static_cast<std::int64_t>(ended));
  job.set_mesh_bytes(1000);
  return job;
}

worker::v1::WorkResult Delivered() {
  worker::v1::WorkResult result;
  v1::Report& report = *result.mutable_report();
  report.mutable_input()->set_triangles(20000);
  report.mutable_times()->mutable_solve()->set_nanos(300'000'000);
  report.mutable_chart_totals()->set_charts(5);
  report.mutable_chart_totals()->set_not_converged(1);
  report.mutable_chart_totals()->set_newton_iterations(30);
  report.mutable_chart_totals()->set_linear_iterations(200);
  report.add_warnings()->set_reason("PRECONDITIONER_CHANGED");
  return result;
}

TEST(ServerMetrics, FollowsAJob) {
  ServerMetrics metrics("1.2.3");
  v1::Job job = JobAt(v1::JOB_STATE_RUNNING, 100, 107, 0);
  job.mutable_scheduling()->set_priority(v1::PRIORITY_HIGH);
  metrics.OnAccepted(job, JobOrigin::kSharedWork);
  metrics.OnTransition(job);
  metrics.OnWorkEnded(job, Delivered(), absl::Seconds(12));
  metrics.OnTransition(JobAt(v1::JOB_STATE_SUCCEEDED, 100, 107, 119));
  ServerGauges gauges;
  gauges.jobs.store_id = "of-test";
  const std::string text = metrics.Text(gauges);
  EXPECT_THAT(text, HasSubstr(R"(planish_jobs_accepted_total{priority="high",tenant="lighting"} 1)"));
  EXPECT_THAT(text, HasSubstr("planish_mesh_bytes_total 1000"));
  EXPECT_THAT(text, HasSubstr(R"(planish_cache_hits_total{kind="shared_work"} 1)"));
  EXPECT_THAT(text, HasSubstr(R"(planish_queue_wait_seconds_sum{priority="high"} 7)"));
  EXPECT_THAT(text, HasSubstr(R"(planish_queue_wait_seconds_bucket{priority="high",le="5"} 0)"));
  EXPECT_THAT(text, HasSubstr(R"(planish_queue_wait_seconds_bucket{priority="high",le="15"} 1)"));
  EXPECT_THAT(text, HasSubstr(R"(planish_tenant_run_seconds_total{tenant="lighting"} 12)"));
  EXPECT_THAT(text, HasSubstr(R"(planish_stage_seconds_sum{stage="solve"} 0.3)"));
  EXPECT_THAT(text, HasSubstr("planish_job_newton_iterations_sum 30"));
  EXPECT_THAT(text, HasSubstr("planish_job_linear_iterations_sum 200"));
  EXPECT_THAT(text, HasSubstr(R"(planish_charts_total{converged="yes"} 4)"));
  EXPECT_THAT(text, HasSubstr(R"(planish_charts_total{converged="no"} 1)"));
  EXPECT_THAT(text, HasSubstr(R"(planish_job_warnings_total{reason="PRECONDITIONER_CHANGED"} 1)"));
  EXPECT_THAT(text, HasSubstr(R"(planish_jobs_ended_total{reason="NONE",state="succeeded",tenant="lighting"} 1)"));
  EXPECT_THAT(text, HasSubstr(R"(planish_job_run_seconds_sum{state="succeeded"} 12)"));
  EXPECT_THAT(text, HasSubstr(R"(planish_build_info{store="of-test",version="1.2.3"} 1)"));
}

TEST(ServerMetrics, WaitsCountOnceHoweverOftenAJobStarts) {
  ServerMetrics metrics("1");
  v1::Job job = JobAt(v1::JOB_STATE_RUNNING, 100, 107, 0);
  metrics.OnTransition(job);
  job.set_attempts(2);
  metrics.OnTransition(job);
  EXPECT_THAT(metrics.Text({}), HasSubstr(R"(planish_queue_wait_seconds_count{priority="normal"} 1)"));
}

TEST(ServerMetrics, FailuresHaveReasons) {
  ServerMetrics metrics("1");
  v1::Job job = JobAt(v1::JOB_STATE_FAILED, 100, 107, 119);
  *job.mutable_error() = ToRpcStatus(MakeError(absl::StatusCode::kInvalidArgument, "MESH_CLOSED", "closed"));
  metrics.OnTransition(job);
  metrics.OnWorkLost(job, {"WORKER_CRASHED", "", {}}, 2, absl::Seconds(3));
  metrics.OnCallEnded("CreateJob", absl::StatusCode::kResourceExhausted, "QUEUE_FULL", absl::Milliseconds(3),
                      {false, true});
  metrics.OnCallEnded("Unwrap", absl::StatusCode::kCancelled, "", absl::Seconds(3), {true, true});
  metrics.OnCallEnded("GetJob", absl::StatusCode::kNotFound, "JOB_NOT_FOUND", absl::Milliseconds(1), {});
  const std::string text = metrics.Text({});
  EXPECT_THAT(text, HasSubstr(R"(planish_jobs_ended_total{reason="MESH_CLOSED",state="failed",tenant="lighting"} 1)"));
  EXPECT_THAT(text, HasSubstr(R"(planish_job_retries_total{reason="WORKER_CRASHED"} 2)"));
  EXPECT_THAT(text, HasSubstr(R"(planish_rejections_total{call="CreateJob",reason="QUEUE_FULL"} 1)"));
  EXPECT_THAT(text, HasSubstr(R"(planish_calls_total{call="GetJob",code="NOT_FOUND"} 1)"));
  EXPECT_THAT(text, Not(HasSubstr(R"(planish_rejections_total{call="GetJob")"))) << "asks for no job";
  EXPECT_THAT(text, Not(HasSubstr(R"(planish_rejections_total{call="Unwrap")"))) << "the caller hung up";
  EXPECT_THAT(text, Not(HasSubstr(R"(planish_call_seconds_count{call="Unwrap")"))) << "lasts as long as its job";
}

// A worker that was taken over may say anything.
TEST(ServerMetrics, WorkersCannotSpoilTheNumbers) {
  ServerMetrics metrics("1");
  worker::v1::WorkResult result = Delivered();
  result.mutable_report()->mutable_times()->mutable_solve()->set_seconds(-5);
  result.mutable_report()->mutable_chart_totals()->set_charts(-5);
  for (int i = 0; i < 1000; ++i) result.mutable_report()->add_warnings()->set_reason("MADE_UP_" + std::to_string(i));
  result.mutable_report()->add_warnings()->set_reason("\"} 1\nplanish_ready 1");
  metrics.OnWorkEnded({}, result, absl::Seconds(1));
  const std::string text = metrics.Text({});
  EXPECT_THAT(text, HasSubstr(R"(planish_stage_seconds_sum{stage="solve"} 0)"));
  EXPECT_THAT(text, HasSubstr(R"(planish_charts_total{converged="yes"} 0)"));
  EXPECT_THAT(text, HasSubstr("\nplanish_ready 0\n"));
  EXPECT_THAT(text, Not(HasSubstr("\nplanish_ready 1\n")));
  EXPECT_THAT(text, HasSubstr(R"(planish_job_warnings_total{reason="OTHER"})"));
  EXPECT_THAT(text, Not(HasSubstr("MADE_UP_900")));
}

TEST(ServerMetrics, SaysWhatIsNow) {
  ServerMetrics metrics("1");
  metrics.OnWorkerStarted();
  metrics.OnWorkerStarted();
  metrics.OnWorkerEnded(WorkerEndCause::kCrashed);
  metrics.OnWorkerStartFailed();
  metrics.OnStoreError();
  ServerGauges gauges;
  gauges.jobs.tenants.resize(2);
  gauges.jobs.tenants[0].tenant = "a";
  gauges.jobs.tenants[0].waiting[v1::PRIORITY_LOW] = {3, absl::Seconds(40)};
  gauges.jobs.tenants[0].running = 2;
  gauges.jobs.tenants[1].tenant = "b";
  gauges.jobs.tenants[1].waiting[v1::PRIORITY_LOW] = {1, absl::Seconds(90)};
  gauges.jobs.reserved_memory_bytes = 5000000000;
  gauges.uploads.complete_at_once = 7;
  gauges.uploads.received_bytes = 123456789012;
  gauges.workers = 4;
  gauges.ready = true;
  gauges.certificate_end = absl::FromUnixSeconds(1800000000);
  const std::string text = metrics.Text(gauges);
  EXPECT_THAT(text, HasSubstr("planish_workers_ready 1"));
  EXPECT_THAT(text, HasSubstr("planish_workers 4"));
  EXPECT_THAT(text, HasSubstr(R"(planish_worker_ends_total{cause="crashed"} 1)"));
  EXPECT_THAT(text, HasSubstr(R"(planish_worker_ends_total{cause="recycled"} 0)"));
  EXPECT_THAT(text, HasSubstr(R"(planish_worker_starts_total{result="failed"} 1)"));
  EXPECT_THAT(text, HasSubstr("planish_store_errors_total 1"));
  EXPECT_THAT(text, HasSubstr(R"(planish_jobs_queued{priority="low",tenant="a"} 3)"));
  EXPECT_THAT(text, HasSubstr(R"(planish_queue_oldest_wait_seconds{priority="low"} 90)"));
  EXPECT_THAT(text, HasSubstr(R"(planish_queue_oldest_wait_seconds{priority="high"} 0)"));
  EXPECT_THAT(text, HasSubstr(R"(planish_jobs_running{tenant="a"} 2)"));
  EXPECT_THAT(text, HasSubstr("planish_memory_reserved_bytes 5000000000"));
  EXPECT_THAT(text, HasSubstr(R"(planish_cache_hits_total{kind="upload"} 7)"));
  EXPECT_THAT(text, HasSubstr("planish_upload_received_bytes_total 123456789012"));
  EXPECT_THAT(text, HasSubstr("planish_tls_certificate_not_after_seconds 1800000000"));
  EXPECT_THAT(text, HasSubstr("\nplanish_ready 1\n"));
}

TEST(LabelGuard, LetsReasonsPass) {
  LabelGuard guard(2);
  EXPECT_EQ(guard.Reason("QUEUE_FULL"), "QUEUE_FULL");
  EXPECT_EQ(guard.Reason(""), "NONE");
  EXPECT_EQ(guard.Reason("queue full"), "OTHER");
  EXPECT_EQ(guard.Reason(std::string(65, 'A')), "OTHER");
  EXPECT_EQ(guard.Reason("MESH_CLOSED"), "MESH_CLOSED");
  EXPECT_EQ(guard.Reason("ONE_TOO_MANY"), "OTHER");
  EXPECT_EQ(guard.Reason("QUEUE_FULL"), "QUEUE_FULL");
}

TEST(ProcessStats, AreOurs) {
  const ProcessStats stats = ReadProcessStats();
  EXPECT_LT(std::abs(stats.start_time - absl::ToDoubleSeconds(absl::Now() - absl::UnixEpoch())), 600);
  EXPECT_GT(stats.resident_bytes, 1 << 20);
  EXPECT_GE(stats.open_descriptors, 3);
  EXPECT_GE(stats.max_descriptors, stats.open_descriptors);
}

TEST(Readiness, NamesAllObstacles) {
  Readiness readiness;
  EXPECT_EQ(readiness.WhyNot(), "the server is starting");
  readiness.Set(Readiness::Obstacle::kStore, "no disk");
  EXPECT_EQ(readiness.WhyNot(), "the server is starting; no disk");
  readiness.Set(Readiness::Obstacle::kStarting, "");
  EXPECT_EQ(readiness.WhyNot(), "no disk");
  readiness.Set(Readiness::Obstacle::kStore, "");
  EXPECT_EQ(readiness.WhyNot(), "");
}

TEST(StoreProbe, TriesItOut) {
  TempDir dir;
  EXPECT_EQ(TryToWrite(dir.Path("")), absl::OkStatus());
  EXPECT_TRUE(std::filesystem::is_empty(dir.Path(""))) << "and leaves nothing behind";
  EXPECT_THAT(std::string(TryToWrite(dir.Path("gone")).message()), HasSubstr("No such file or directory"));
}

}  // namespace
}  // namespace planish
