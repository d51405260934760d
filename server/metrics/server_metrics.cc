#include "server/metrics/server_metrics.h"

#include <algorithm>
#include <array>
#include <atomic>
#include <cmath>
#include <locale>
#include <map>
#include <sstream>
#include <utility>
#include <vector>

#include "absl/strings/ascii.h"
#include "absl/strings/strip.h"
#include "google/protobuf/util/time_util.h"
#include "prometheus/counter.h"
#include "prometheus/histogram.h"
#include "prometheus/registry.h"
#include "prometheus/text_serializer.h"
#include "server/access/caller.h"
#include "server/link/duration.h"
#include "server/link/rpc_status.h"
#include "server/metrics/definitions.h"
#include "server/metrics/label_guard.h"
#include "server/metrics/process_stats.h"

namespace planish {
namespace {

using google::protobuf::util::TimeUtil;
using prometheus::ClientMetric;
using prometheus::MetricFamily;
using Labels = std::map<std::string, std::string>;

constexpr std::size_t kMostReasons = 100;

constexpr std::array kPriorities = {v1::PRIORITY_LOW, v1::PRIORITY_NORMAL, v1::PRIORITY_HIGH};
constexpr std::array kCauses = {WorkerEndCause::kRecycled, WorkerEndCause::kGrown,       WorkerEndCause::kCrashed,
                                WorkerEndCause::kHung,     WorkerEndCause::kDisobedient, WorkerEndCause::kShutdown};
constexpr std::array kStages = {"decode", "charts", "solve", "layout", "pack", "verify", "encode"};
constexpr std::array kEndStates = {"succeeded", "failed", "cancelled"};
constexpr std::array kCacheKinds = {"shared_work", "kept_result"};

std::string PriorityLabel(v1::Priority priority) {
  if (priority == v1::PRIORITY_UNSPECIFIED) priority = v1::PRIORITY_NORMAL;
  return absl::AsciiStrToLower(absl::StripPrefix(v1::Priority_Name(priority), "PRIORITY_"));
}

double SecondsBetween(const google::protobuf::Timestamp& from, const google::protobuf::Timestamp& to) {
  return static_cast<double>(TimeUtil::DurationToNanoseconds(to - from)) * 1e-9;
}

// Jobs from before there were tenants have no tenant.
std::string TenantOf(const std::string& tenant) {
  return tenant.empty() ? kDefaultTenant : tenant;
}
std::string TenantOf(const v1::Job& job) {
  return TenantOf(job.tenant());
}

// A number reported by a worker, or 0 if it is not finite or negative: such a number would spoil a sum for good.
double Sane(double number) {
  return std::isfinite(number) && number > 0 ? number : 0;
}

// Codes that are caused by the caller, not by the server.
bool IsCallersEnd(absl::StatusCode code) {
  return code == absl::StatusCode::kCancelled || code == absl::StatusCode::kDeadlineExceeded;
}

prometheus::Family<prometheus::Counter>& AddCounter(prometheus::Registry* registry, const MetricDefinition& metric) {
  return prometheus::BuildCounter().Name(metric.name).Help(metric.help).Register(*registry);
}

// Histograms of one definition share its buckets.
struct HistogramFamily {
  HistogramFamily(prometheus::Registry* registry, const MetricDefinition& metric)
      : family(prometheus::BuildHistogram().Name(metric.name).Help(metric.help).Register(*registry)),
        buckets(metric.buckets) {}
  prometheus::Histogram& Add(const Labels& labels) { return family.Add(labels, buckets); }

  prometheus::Family<prometheus::Histogram>& family;
  const std::vector<double>& buckets;
};

// Builds the families whose values are read at a scrape.
class Pulled {
 public:
  void Add(const MetricDefinition& metric, double value, const Labels& labels = {}) {
    if (families_.empty() || families_.back().name != metric.name) Begin(metric);
    ClientMetric sample;
    for (const auto& [name, label] : labels) sample.label.push_back({name, label});
    (metric.kind == MetricKind::kCounter ? sample.counter.value : sample.gauge.value) = value;
    families_.back().metric.push_back(std::move(sample));
  }
  std::vector<MetricFamily> Take() { return std::move(families_); }

 private:
  void Begin(const MetricDefinition& metric) {
    MetricFamily family;
    family.name = metric.name;
    family.help = metric.help;
    family.type = metric.kind == MetricKind::kCounter ? prometheus::MetricType::Counter : prometheus::MetricType::Gauge;
    families_.push_back(std::move(family));
  }
  std::vector<MetricFamily> families_;
};

void AddJobs(const ManagerStats& jobs, Pulled* pulled) {
  std::map<v1::Priority, absl::Duration> longest;
  std::map<std::pair<std::string, v1::Priority>, int> queued;
  std::map<std::string, int> running = {{kDefaultTenant, 0}};
  for (const v1::Priority priority : kPriorities) queued[{kDefaultTenant, priority}] = 0;
  for (const TenantStats& tenant : jobs.tenants) {
    const std::string label = TenantOf(tenant.tenant);
    running[label] += tenant.running;
    for (const auto& [priority, waiting] : tenant.waiting) {
      queued[{label, priority}] += waiting.jobs;
      longest[priority] = std::max(longest[priority], waiting.longest);
    }
  }
  for (const auto& [of, count] : queued) {
    pulled->Add(metric::kJobsQueued, count, {{"tenant", of.first}, {"priority", PriorityLabel(of.second)}});
  }
  for (const auto& [tenant, count] : running) pulled->Add(metric::kJobsRunning, count, {{"tenant", tenant}});
  for (const v1::Priority priority : kPriorities) {
    pulled->Add(metric::kQueueOldestWait, absl::ToDoubleSeconds(longest[priority]),
                {{"priority", PriorityLabel(priority)}});
  }
  pulled->Add(metric::kWorkersBusy, jobs.running_work);
  pulled->Add(metric::kMemoryReserved, static_cast<double>(jobs.reserved_memory_bytes));
  pulled->Add(metric::kDraining, jobs.draining ? 1 : 0);
}

void AddProcess(Pulled* pulled) {
  const ProcessStats process = ReadProcessStats();
  pulled->Add(metric::kProcessStart, process.start_time);
  pulled->Add(metric::kProcessCpu, process.cpu_seconds, {{"process", "server"}});
  pulled->Add(metric::kProcessCpu, process.ended_child_seconds, {{"process", "workers"}});
  pulled->Add(metric::kProcessResident, static_cast<double>(process.resident_bytes));
  pulled->Add(metric::kProcessDescriptors, static_cast<double>(process.open_descriptors));
  pulled->Add(metric::kProcessMaxDescriptors, static_cast<double>(process.max_descriptors));
}

}  // namespace

struct ServerMetrics::Families {
  explicit Families(std::string server_version) : version(std::move(server_version)) {
    for (const v1::Priority priority : kPriorities) {
      queue_wait.Add({{"priority", PriorityLabel(priority)}});
      jobs_accepted.Add({{"tenant", kDefaultTenant}, {"priority", PriorityLabel(priority)}});
    }
    for (const char* state : kEndStates) job_run.Add({{"state", state}});
    for (const char* name : kStages) stage.Add({{"stage", name}});
    for (const WorkerEndCause cause : kCauses) worker_ends.Add({{"cause", NameOf(cause)}});
    for (const char* result : {"ok", "failed"}) worker_starts.Add({{"result", result}});
    for (const char* converged : {"yes", "no"}) charts.Add({{"converged", converged}});
    for (const char* kind : kCacheKinds) cache_hits.Add({{"kind", kind}});
  }

  const std::string version;
  LabelGuard reasons{kMostReasons};         // reasons that the server gives
  LabelGuard worker_reasons{kMostReasons};  // reasons that may come from a worker, which is not trusted
  std::atomic<int> workers_ready = 0;

  prometheus::Registry registry;
  prometheus::Family<prometheus::Counter>& jobs_accepted = AddCounter(&registry, metric::kJobsAccepted);
  prometheus::Family<prometheus::Counter>& jobs_ended = AddCounter(&registry, metric::kJobsEnded);
  HistogramFamily queue_wait{&registry, metric::kQueueWait};
  HistogramFamily job_run{&registry, metric::kJobRun};
  prometheus::Family<prometheus::Counter>& tenant_run = AddCounter(&registry, metric::kTenantRun);
  prometheus::Family<prometheus::Counter>& retries = AddCounter(&registry, metric::kRetries);
  prometheus::Family<prometheus::Counter>& rejections = AddCounter(&registry, metric::kRejections);
  HistogramFamily stage{&registry, metric::kStage};
  HistogramFamily triangles_family{&registry, metric::kJobTriangles};
  prometheus::Histogram& triangles = triangles_family.Add({});
  HistogramFamily newton_family{&registry, metric::kNewtonIterations};
  prometheus::Histogram& newton = newton_family.Add({});
  HistogramFamily linear_family{&registry, metric::kLinearIterations};
  prometheus::Histogram& linear = linear_family.Add({});
  prometheus::Family<prometheus::Counter>& charts = AddCounter(&registry, metric::kCharts);
  prometheus::Family<prometheus::Counter>& warnings = AddCounter(&registry, metric::kWarnings);
  prometheus::Family<prometheus::Counter>& cache_hits = AddCounter(&registry, metric::kCacheHits);
  prometheus::Family<prometheus::Counter>& worker_starts = AddCounter(&registry, metric::kWorkerStarts);
  prometheus::Family<prometheus::Counter>& worker_ends = AddCounter(&registry, metric::kWorkerEnds);
  prometheus::Counter& store_errors = AddCounter(&registry, metric::kStoreErrors).Add({});
  prometheus::Counter& mesh_bytes = AddCounter(&registry, metric::kMeshBytes).Add({});
  prometheus::Family<prometheus::Counter>& calls = AddCounter(&registry, metric::kCalls);
  HistogramFamily call_seconds{&registry, metric::kCallTime};
};

ServerMetrics::ServerMetrics(const std::string& version) : families_(std::make_unique<Families>(version)) {}
ServerMetrics::~ServerMetrics() = default;

void ServerMetrics::OnAccepted(const v1::Job& job, JobOrigin origin) {
  Families& f = *families_;
  const std::string priority = PriorityLabel(job.scheduling().priority());
  f.jobs_accepted.Add({{"tenant", TenantOf(job)}, {"priority", priority}}).Increment();
  f.mesh_bytes.Increment(static_cast<double>(job.mesh_bytes()));
  if (origin == JobOrigin::kSharedWork) f.cache_hits.Add({{"kind", "shared_work"}}).Increment();
  if (origin == JobOrigin::kKeptResult) f.cache_hits.Add({{"kind", "kept_result"}}).Increment();
}

void ServerMetrics::OnTransition(const v1::Job& job) {
  Families& f = *families_;
  if (job.state() == v1::JOB_STATE_RUNNING && job.attempts() == 1) {
    f.queue_wait.Add({{"priority", PriorityLabel(job.scheduling().priority())}})
        .Observe(SecondsBetween(job.create_time(), job.start_time()));
  }
  const char* state = job.state() == v1::JOB_STATE_SUCCEEDED   ? "succeeded"
                      : job.state() == v1::JOB_STATE_FAILED    ? "failed"
                      : job.state() == v1::JOB_STATE_CANCELLED ? "cancelled"
                                                               : nullptr;
  if (state == nullptr) return;
  const std::string reason = job.state() == v1::JOB_STATE_FAILED ? ReasonOf(job.error()) : std::string();
  f.jobs_ended.Add({{"tenant", TenantOf(job)}, {"state", state}, {"reason", f.worker_reasons.Reason(reason)}})
      .Increment();
  if (job.has_start_time()) {
    f.job_run.Add({{"state", state}}).Observe(SecondsBetween(job.start_time(), job.end_time()));
  }
}

void ServerMetrics::OnWorkEnded(const v1::Job& job, const worker::v1::WorkResult& result, absl::Duration duration) {
  Families& f = *families_;
  f.tenant_run.Add({{"tenant", TenantOf(job)}}).Increment(absl::ToDoubleSeconds(duration));
  if (result.status().code() != 0) return;
  const v1::Report& report = result.report();
  const v1::StageTimes& times = report.times();
  const std::array values = {&times.decode(), &times.charts(), &times.solve(), &times.layout(),
                             &times.pack(),   &times.verify(), &times.encode()};
  static_assert(values.size() == kStages.size());
  for (std::size_t i = 0; i < kStages.size(); ++i)
    f.stage.Add({{"stage", kStages[i]}}).Observe(Sane(ToSeconds(*values[i])));
  f.triangles.Observe(Sane(static_cast<double>(report.input().triangles())));
  const v1::ChartTotals& totals = report.chart_totals();
  f.newton.Observe(Sane(static_cast<double>(totals.newton_iterations())));
  f.linear.Observe(Sane(static_cast<double>(totals.linear_iterations())));
  f.charts.Add({{"converged", "yes"}}).Increment(Sane(totals.charts() - totals.not_converged()));
  f.charts.Add({{"converged", "no"}}).Increment(Sane(totals.not_converged()));
  for (const v1::Warning& warning : report.warnings()) {
    f.warnings.Add({{"reason", f.worker_reasons.Reason(warning.reason())}}).Increment();
  }
}

void ServerMetrics::OnWorkLost(const v1::Job& job, const WorkerLoss& loss, int retried, absl::Duration duration) {
  Families& f = *families_;
  f.tenant_run.Add({{"tenant", TenantOf(job)}}).Increment(absl::ToDoubleSeconds(duration));
  if (retried > 0) f.retries.Add({{"reason", f.reasons.Reason(loss.reason)}}).Increment(retried);
}

void ServerMetrics::OnStoreError() {
  families_->store_errors.Increment();
}

void ServerMetrics::OnWorkerStarted() {
  ++families_->workers_ready;
  families_->worker_starts.Add({{"result", "ok"}}).Increment();
}

void ServerMetrics::OnWorkerStartFailed() {
  families_->worker_starts.Add({{"result", "failed"}}).Increment();
}

void ServerMetrics::OnWorkerEnded(WorkerEndCause cause) {
  --families_->workers_ready;
  families_->worker_ends.Add({{"cause", NameOf(cause)}}).Increment();
}

int ServerMetrics::workers_ready() const {
  return families_->workers_ready;
}

void ServerMetrics::OnCallEnded(const std::string& call, absl::StatusCode code, const std::string& reason,
                                absl::Duration duration, const CallTraits& traits) {
  Families& f = *families_;
  f.calls.Add({{"call", call}, {"code", absl::StatusCodeToString(code)}}).Increment();
  if (!traits.streams) f.call_seconds.Add({{"call", call}}).Observe(absl::ToDoubleSeconds(duration));
  if (traits.submits && code != absl::StatusCode::kOk && !IsCallersEnd(code)) {
    f.rejections.Add({{"call", call}, {"reason", f.reasons.Reason(reason)}}).Increment();
  }
}

std::string ServerMetrics::Text(const ServerGauges& gauges) const {
  Pulled pulled;
  AddJobs(gauges.jobs, &pulled);
  pulled.Add(metric::kWorkers, gauges.workers);
  pulled.Add(metric::kWorkersReady, workers_ready());
  pulled.Add(metric::kMemoryLimit, static_cast<double>(gauges.memory_limit_bytes));
  pulled.Add(metric::kStore, static_cast<double>(gauges.store_bytes));
  pulled.Add(metric::kStoreLimit, static_cast<double>(gauges.store_limit_bytes));
  pulled.Add(metric::kUploads, gauges.uploads.open);
  pulled.Add(metric::kUploadsAnnounced, static_cast<double>(gauges.uploads.announced_bytes));
  pulled.Add(metric::kUploadsLimit, static_cast<double>(gauges.uploads_limit_bytes));
  pulled.Add(metric::kUploadBytes, static_cast<double>(gauges.uploads.received_bytes));
  pulled.Add(metric::kUvBytes, static_cast<double>(gauges.uv_sent_bytes));
  pulled.Add(metric::kStreams, gauges.streams);
  pulled.Add(metric::kReady, gauges.ready ? 1 : 0);
  pulled.Add(metric::kClockSkew, absl::ToDoubleSeconds(gauges.clock_skew));
  pulled.Add(metric::kStoreAnswers, gauges.store_answers ? 1 : 0);
  pulled.Add(metric::kCertificateEnd, absl::ToDoubleSeconds(gauges.certificate_end - absl::UnixEpoch()));
  pulled.Add(metric::kBuildInfo, 1, {{"version", families_->version}, {"store", gauges.jobs.store_id}});
  AddProcess(&pulled);

  std::vector<MetricFamily> all = families_->registry.Collect();
  // The upload store counts cache hits of the kind "upload", this class all other kinds.
  for (MetricFamily& family : all) {
    if (family.name != metric::kCacheHits.name) continue;
    ClientMetric uploads;
    uploads.label.push_back({"kind", "upload"});
    uploads.counter.value = static_cast<double>(gauges.uploads.complete_at_once);
    family.metric.push_back(std::move(uploads));
  }
  for (MetricFamily& family : pulled.Take()) all.push_back(std::move(family));
  // A family without samples is left out entirely, its name too.
  std::erase_if(all, [](const MetricFamily& family) { return family.metric.empty(); });
  std::ostringstream text;
  text.imbue(std::locale::classic());
  prometheus::TextSerializer().Serialize(text, all);
  return text.str();
}

}  // namespace planish
