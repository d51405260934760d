// Every metric that planishd serves at /metrics. This file is their documentation; README.md beside it has the same as
// a table. Dashboards and rules rely on the names: a metric whose meaning changes gets a new name.
//
// Counters begin at 0 with each process. Label values that are not known beforehand (tenants, reasons) appear with
// their first event; all others exist from the start. Reasons are those of errors and warnings in proto/planish/v1.
// Without a reason the value is "NONE". Malformed reasons, and new ones once there are too many, are "OTHER".
#pragma once

#include <string>
#include <vector>

namespace planish {

enum class MetricKind { kCounter, kGauge, kHistogram };

struct MetricDefinition {
  const char* name;
  MetricKind kind;
  const char* labels;  // names of the labels, separated by ", "; "": none
  const char* help;
  std::vector<double> buckets = {};  // histograms: upper bounds, ascending
};

namespace metric {

using enum MetricKind;

// Histogram buckets. kSeconds reaches from the smallest mesh to the largest, in steps of 1, 2.5, 5 where most jobs are.
inline const std::vector<double> kSeconds = {0.001, 0.0025, 0.005, 0.01, 0.025, 0.05, 0.1, 0.25, 0.5,  1,    2.5,
                                             5,     10,     25,    60,   150,   300,  600, 1800, 3600, 14400};
inline const std::vector<double> kWaitSeconds = {0.01, 0.1, 0.5, 1,    5,    15,   30,   60,
                                                 120,  300, 600, 1200, 1800, 3600, 14400};
inline const std::vector<double> kCallSeconds = {0.001, 0.005, 0.025, 0.1, 0.5, 2.5, 10};
inline const std::vector<double> kTriangles = {100, 1e3, 3e3, 1e4, 3e4, 1e5, 3e5, 1e6, 3e6, 1e7};
inline const std::vector<double> kNewton = {5, 10, 20, 50, 100, 200, 500, 1000, 5000, 20000};
inline const std::vector<double> kLinear = {10, 30, 100, 300, 1e3, 3e3, 1e4, 3e4, 1e5, 1e6};

// ---- jobs

inline const MetricDefinition kJobsAccepted = {"planish_jobs_accepted_total", kCounter, "tenant, priority",
                                               "Jobs that were accepted. priority: low, normal, high."};
inline const MetricDefinition kJobsEnded = {"planish_jobs_ended_total", kCounter, "tenant, state, reason",
                                            "Jobs that ended. state: succeeded, failed, cancelled; reason: that of "
                                            "planish.v1.Job.error for failed jobs, else NONE."};
inline const MetricDefinition kJobsQueued = {"planish_jobs_queued", kGauge, "tenant, priority",
                                             "Jobs that wait for a worker."};
inline const MetricDefinition kJobsRunning = {
    "planish_jobs_running", kGauge, "tenant",
    "Jobs that a worker runs; jobs that share one piece of work count individually."};
inline const MetricDefinition kQueueOldestWait = {
    "planish_queue_oldest_wait_seconds", kGauge, "priority",
    "How long the longest waiting job has waited so far; 0 if none waits."};
inline const MetricDefinition kQueueWait = {
    "planish_queue_wait_seconds", kHistogram, "priority",
    "Seconds from a job's acceptance to its first start on a worker. Jobs that never started are not included.",
    kWaitSeconds};
inline const MetricDefinition kJobRun = {"planish_job_run_seconds", kHistogram, "state",
                                         "Seconds from a job's last start to its end, for jobs that started on a "
                                         "worker. state: as in planish_jobs_ended_total.",
                                         kSeconds};
inline const MetricDefinition kTenantRun = {
    "planish_tenant_run_seconds_total", kCounter, "tenant",
    "Seconds that workers spent on the tenant's work, whether it succeeded or not; shared work counts once."};
inline const MetricDefinition kRetries = {
    "planish_job_retries_total", kCounter, "reason",
    "Jobs that were queued again because their worker was lost. reason: WORKER_CRASHED, WORKER_HUNG, INTERNAL."};
inline const MetricDefinition kRejections = {
    "planish_rejections_total", kCounter, "call, reason",
    "Refused calls that would have made a job or an upload or added to an upload (Unwrap, CreateJob, CreateUpload, "
    "WriteUpload). reason: that of the error."};

// ---- what jobs computed

inline const MetricDefinition kStage = {
    "planish_stage_seconds", kHistogram, "stage",
    "Seconds of each stage of a job with a result: decode, charts, solve, layout, pack, verify, encode.", kSeconds};
inline const MetricDefinition kJobTriangles = {"planish_job_triangles", kHistogram, "",
                                               "Triangles of the meshes of jobs with a result.", kTriangles};
inline const MetricDefinition kNewtonIterations = {"planish_job_newton_iterations", kHistogram, "",
                                                   "Newton iterations over all charts of a job with a result.",
                                                   kNewton};
inline const MetricDefinition kLinearIterations = {"planish_job_linear_iterations", kHistogram, "",
                                                   "Linear iterations over all charts of a job with a result.",
                                                   kLinear};
inline const MetricDefinition kCharts = {"planish_charts_total", kCounter, "converged",
                                         "Charts of jobs with a result. converged: yes, no."};
inline const MetricDefinition kWarnings = {
    "planish_job_warnings_total", kCounter, "reason",
    "Warnings in the reports of jobs with a result (planish.v1.Warning). Fallbacks among them: PRECONDITIONER_CHANGED "
    "(a Cholesky factorization in place of multigrid), BARRIER_KEPT, BARYCENTRIC_MAP, UV_PRECISION (double in place of "
    "float), SEAMS_ADDED."};

// ---- avoided work

inline const MetricDefinition kCacheHits = {
    "planish_cache_hits_total", kCounter, "kind",
    "Work that was avoided. kind: shared_work (a job joined work that waits or runs), kept_result (a job took an "
    "existing result), upload (an upload was complete at once)."};

// ---- workers and memory

inline const MetricDefinition kWorkers = {"planish_workers", kGauge, "", "Configured workers."};
inline const MetricDefinition kWorkersReady = {"planish_workers_ready", kGauge, "",
                                               "Workers that are ready, idle or with a job."};
inline const MetricDefinition kWorkersBusy = {"planish_workers_busy", kGauge, "", "Workers that have a job."};
inline const MetricDefinition kWorkerStarts = {"planish_worker_starts_total", kCounter, "result",
                                               "Workers that were started. result: ok, failed."};
inline const MetricDefinition kWorkerEnds = {
    "planish_worker_ends_total", kCounter, "cause",
    "Workers that ended. cause: recycled, grown (too much memory), crashed, hung, disobedient (killed, because its job "
    "was to end and did not), shutdown."};
inline const MetricDefinition kMemoryReserved = {"planish_memory_reserved_bytes", kGauge, "",
                                                 "Memory that running jobs have reserved, by their estimates."};
inline const MetricDefinition kMemoryLimit = {"planish_memory_limit_bytes", kGauge, "",
                                              "Memory that running jobs may reserve together (--memory-mb)."};

// ---- store and bytes

inline const MetricDefinition kStore = {"planish_store_bytes", kGauge, "", "Bytes of meshes and UV in the store."};
inline const MetricDefinition kStoreLimit = {"planish_store_limit_bytes", kGauge, "",
                                             "Capacity of the store (--store-mb)."};
inline const MetricDefinition kStoreErrors = {"planish_store_errors_total", kCounter, "",
                                              "Records of jobs that could not be written at once; writing is retried."};
inline const MetricDefinition kMeshBytes = {
    "planish_mesh_bytes_total", kCounter, "",
    "Bytes of the meshes and seams of accepted jobs, in requests and in uploads."};
inline const MetricDefinition kUploads = {"planish_uploads_open", kGauge, "", "Uploads under way."};
inline const MetricDefinition kUploadsAnnounced = {"planish_uploads_open_bytes", kGauge, "",
                                                   "Bytes that the uploads under way announced."};
inline const MetricDefinition kUploadsLimit = {"planish_uploads_limit_bytes", kGauge, "",
                                               "Bytes that uploads under way may announce (--uploads-mb)."};
inline const MetricDefinition kUploadBytes = {"planish_upload_received_bytes_total", kCounter, "",
                                              "Bytes that uploads received; repeated bytes count once."};
inline const MetricDefinition kUvBytes = {"planish_uv_sent_bytes_total", kCounter, "", "Bytes of UV sent in streams."};

// ---- calls

inline const MetricDefinition kCalls = {
    "planish_calls_total", kCounter, "call, code",
    "Calls that ended. call: the method's name, OTHER for unknown methods; code: gRPC's name of the status."};
inline const MetricDefinition kCallTime = {"planish_call_seconds", kHistogram, "call",
                                           "Seconds that calls took, without streams.", kCallSeconds};
inline const MetricDefinition kStreams = {"planish_streams_open", kGauge, "", "Open streams of Unwrap and WatchJob."};

// ---- the server

inline const MetricDefinition kReady = {"planish_ready", kGauge, "", "1 if /readyz reports ready, else 0."};
inline const MetricDefinition kStoreAnswers = {"planish_store_answers", kGauge, "",
                                               "1 if the store answered the scrape within a second; else 0, and the "
                                               "figures of jobs, uploads and tenants are from its last answer."};
inline const MetricDefinition kDraining = {"planish_draining", kGauge, "", "1 while new jobs are refused, else 0."};
inline const MetricDefinition kClockSkew = {"planish_clock_skew_seconds", kGauge, "",
                                            "How far the machine's clock is ahead of the store's (negative: behind), "
                                            "measured every few seconds; 0 without a farm."};
inline const MetricDefinition kCertificateEnd = {
    "planish_tls_certificate_not_after_seconds", kGauge, "",
    "When the server's TLS certificate expires, Unix time; 0 without one."};
inline const MetricDefinition kBuildInfo = {
    "planish_build_info", kGauge, "version, store",
    "Always 1. store: an id that is the same for all servers that share a store."};
inline const MetricDefinition kProcessStart = {"planish_process_start_time_seconds", kGauge, "",
                                               "When the server's process started, Unix time."};
inline const MetricDefinition kProcessCpu = {
    "planish_process_cpu_seconds_total", kCounter, "process",
    "CPU seconds, user and system. process: server, workers (ended workers only; 0 with --isolation=thread)."};
inline const MetricDefinition kProcessResident = {"planish_process_resident_memory_bytes", kGauge, "",
                                                  "Resident memory of the server's process, without its workers."};
inline const MetricDefinition kProcessDescriptors = {"planish_process_open_fds", kGauge, "",
                                                     "Open file descriptors of the server's process."};
inline const MetricDefinition kProcessMaxDescriptors = {
    "planish_process_max_fds", kGauge, "", "Most file descriptors that the server's process may have open."};

}  // namespace metric

// All of the above, in this order.
const std::vector<const MetricDefinition*>& AllMetrics();

// "counter", "gauge", "histogram".
const char* NameOf(MetricKind kind);

// The table in README.md.
std::string MetricsTable();

}  // namespace planish
