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

// From the smallest mesh to the largest, in steps of 1, 2.5, 5 where most jobs are.
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
                                            "Jobs that ended. state: succeeded, failed, cancelled; reason: of "
                                            "planish.v1.Job.error for failed ones, else NONE."};
inline const MetricDefinition kJobsQueued = {"planish_jobs_queued", kGauge, "tenant, priority",
                                             "Jobs that wait for a worker."};
inline const MetricDefinition kJobsRunning = {
    "planish_jobs_running", kGauge, "tenant",
    "Jobs that a worker is at; those that share one piece of work count each."};
inline const MetricDefinition kQueueOldestWait = {"planish_queue_oldest_wait_seconds", kGauge, "priority",
                                                  "How long the job that waits longest has waited; 0: none waits."};
inline const MetricDefinition kQueueWait = {
    "planish_queue_wait_seconds", kHistogram, "priority",
    "From a job's acceptance to its first start on a worker. Jobs that never started are not in it.", kWaitSeconds};
inline const MetricDefinition kJobRun = {
    "planish_job_run_seconds", kHistogram, "state",
    "From a job's last start to its end, for jobs that a worker was at. state: as of planish_jobs_ended_total.",
    kSeconds};
inline const MetricDefinition kTenantRun = {
    "planish_tenant_run_seconds_total", kCounter, "tenant",
    "Seconds that workers spent on the tenant's work, whatever came of it; shared work counts once."};
inline const MetricDefinition kRetries = {
    "planish_job_retries_total", kCounter, "reason",
    "Jobs that were queued again because their worker was lost. reason: WORKER_CRASHED, WORKER_HUNG, INTERNAL."};
inline const MetricDefinition kRejections = {"planish_rejections_total", kCounter, "call, reason",
                                             "Calls that would have made a job or an upload (Unwrap, CreateJob, "
                                             "CreateUpload, WriteUpload) and were refused before "
                                             "there was one, or before it grew. reason: of the error."};

// ---- what jobs computed

inline const MetricDefinition kStage = {
    "planish_stage_seconds", kHistogram, "stage",
    "Seconds of each stage of a job that a worker delivered: decode, charts, solve, layout, pack, verify, encode.",
    kSeconds};
inline const MetricDefinition kJobTriangles = {"planish_job_triangles", kHistogram, "",
                                               "Triangles of a mesh that a worker delivered UV for.", kTriangles};
inline const MetricDefinition kNewtonIterations = {"planish_job_newton_iterations", kHistogram, "",
                                                   "Newton iterations over all charts of a delivered job.", kNewton};
inline const MetricDefinition kLinearIterations = {"planish_job_linear_iterations", kHistogram, "",
                                                   "Linear iterations over all charts of a delivered job.", kLinear};
inline const MetricDefinition kCharts = {"planish_charts_total", kCounter, "converged",
                                         "Charts of delivered jobs. converged: yes, no."};
inline const MetricDefinition kWarnings = {
    "planish_job_warnings_total", kCounter, "reason",
    "Warnings in delivered reports (planish.v1.Warning), fall-backs among them: PRECONDITIONER_CHANGED (multigrid gave "
    "way to a Cholesky factorization), BARRIER_KEPT, BARYCENTRIC_MAP, UV_PRECISION (double in place of float), "
    "SEAMS_ADDED."};

// ---- what spared work

inline const MetricDefinition kCacheHits = {"planish_cache_hits_total", kCounter, "kind",
                                            "What was not done twice. kind: shared_work (a job joined work that waits "
                                            "or runs), kept_result (a job took a result "
                                            "that was there), upload (an upload was complete at once)."};

// ---- workers and memory

inline const MetricDefinition kWorkers = {"planish_workers", kGauge, "", "Workers the server is to have."};
inline const MetricDefinition kWorkersReady = {"planish_workers_ready", kGauge, "",
                                               "Workers that are there: with a job, or ready for one."};
inline const MetricDefinition kWorkersBusy = {"planish_workers_busy", kGauge, "", "Workers that have a job."};
inline const MetricDefinition kWorkerStarts = {"planish_worker_starts_total", kCounter, "result",
                                               "Workers that were started. result: ok, failed."};
inline const MetricDefinition kWorkerEnds = {"planish_worker_ends_total", kCounter, "cause",
                                             "Workers that ended. cause: recycled, grown (too much memory), crashed, "
                                             "hung, disobedient (killed, for a job that was "
                                             "to end), shutdown."};
inline const MetricDefinition kMemoryReserved = {"planish_memory_reserved_bytes", kGauge, "",
                                                 "Memory that running jobs reserve, by their estimates."};
inline const MetricDefinition kMemoryLimit = {"planish_memory_limit_bytes", kGauge, "",
                                              "Memory that running jobs may reserve together (--memory-mb)."};

// ---- store and bytes

inline const MetricDefinition kStore = {"planish_store_bytes", kGauge, "", "Meshes and UV in the store."};
inline const MetricDefinition kStoreLimit = {"planish_store_limit_bytes", kGauge, "",
                                             "What the store may hold (--store-mb)."};
inline const MetricDefinition kStoreErrors = {
    "planish_store_errors_total", kCounter, "",
    "Records of jobs that could not be written when they should; they are tried again."};
inline const MetricDefinition kMeshBytes = {"planish_mesh_bytes_total", kCounter, "",
                                            "Bytes of the meshes and seams of accepted jobs, however they came."};
inline const MetricDefinition kUploads = {"planish_uploads_open", kGauge, "", "Uploads under way."};
inline const MetricDefinition kUploadsAnnounced = {"planish_uploads_open_bytes", kGauge, "",
                                                   "Bytes that the uploads under way announced."};
inline const MetricDefinition kUploadsLimit = {"planish_uploads_limit_bytes", kGauge, "",
                                               "Bytes that uploads under way may announce (--uploads-mb)."};
inline const MetricDefinition kUploadBytes = {"planish_upload_received_bytes_total", kCounter, "",
                                              "Bytes that uploads took in; what came twice counts once."};
inline const MetricDefinition kUvBytes = {"planish_uv_sent_bytes_total", kCounter, "",
                                          "Bytes of UV given to callers' streams."};

// ---- calls

inline const MetricDefinition kCalls = {"planish_calls_total", kCounter, "call, code",
                                        "Calls that ended. call: the method's name, OTHER for calls of methods that "
                                        "there are not; code: gRPC's name of how it "
                                        "ended."};
inline const MetricDefinition kCallTime = {"planish_call_seconds", kHistogram, "call",
                                           "Seconds that calls took, those that stream left out.", kCallSeconds};
inline const MetricDefinition kStreams = {"planish_streams_open", kGauge, "", "Streams of Unwrap and WatchJob."};

// ---- the server

inline const MetricDefinition kReady = {"planish_ready", kGauge, "", "1 where /readyz says ready, else 0."};
inline const MetricDefinition kStoreAnswers = {
    "planish_store_answers", kGauge, "",
    "1 where the store answered the scrape within a second, else 0: then the figures of jobs, uploads and tenants are "
    "those of its last answer."};
inline const MetricDefinition kDraining = {"planish_draining", kGauge, "", "1 while no new jobs are taken, else 0."};
inline const MetricDefinition kClockSkew = {"planish_clock_skew_seconds", kGauge, "",
                                            "How far the machine's clock is ahead of the store's (negative: behind), "
                                            "as of the last seconds; 0 without a farm."};
inline const MetricDefinition kCertificateEnd = {
    "planish_tls_certificate_not_after_seconds", kGauge, "",
    "When the server's TLS certificate expires, Unix time; 0: the server has none."};
inline const MetricDefinition kBuildInfo = {
    "planish_build_info", kGauge, "version, store",
    "Always 1. store: an id that servers of a farm have in common, as they have their jobs."};
inline const MetricDefinition kProcessStart = {"planish_process_start_time_seconds", kGauge, "",
                                               "When the server's process began, Unix time."};
inline const MetricDefinition kProcessCpu = {
    "planish_process_cpu_seconds_total", kCounter, "process",
    "CPU seconds, user and system. process: server, workers (those that ended; 0 with --isolation=thread)."};
inline const MetricDefinition kProcessResident = {"planish_process_resident_memory_bytes", kGauge, "",
                                                  "Resident memory of the server's process, without its workers."};
inline const MetricDefinition kProcessDescriptors = {"planish_process_open_fds", kGauge, "",
                                                     "File descriptors the server's process has open."};
inline const MetricDefinition kProcessMaxDescriptors = {"planish_process_max_fds", kGauge, "",
                                                        "File descriptors it may have open."};

}  // namespace metric

// All of the above, in this order.
const std::vector<const MetricDefinition*>& AllMetrics();

// "counter", "gauge", "histogram".
const char* NameOf(MetricKind kind);

// The table in README.md.
std::string MetricsTable();

}  // namespace planish
