#include "server/metrics/definitions.h"

#include "absl/strings/str_cat.h"
#include "absl/strings/str_replace.h"

namespace planish {

const std::vector<const MetricDefinition*>& AllMetrics() {
  using namespace metric;
  static const auto* all = new std::vector<const MetricDefinition*>{
      &kJobsAccepted,
      &kJobsEnded,
      &kJobsQueued,
      &kJobsRunning,
      &kQueueOldestWait,
      &kQueueWait,
      &kJobRun,
      &kTenantRun,
      &kRetries,
      &kRejections,
      &kStage,
      &kJobTriangles,
      &kNewtonIterations,
      &kLinearIterations,
      &kCharts,
      &kWarnings,
      &kCacheHits,
      &kWorkers,
      &kWorkersReady,
      &kWorkersBusy,
      &kWorkerStarts,
      &kWorkerEnds,
      &kMemoryReserved,
      &kMemoryLimit,
      &kStore,
      &kStoreLimit,
      &kStoreErrors,
      &kMeshBytes,
      &kUploads,
      &kUploadsAnnounced,
      &kUploadsLimit,
      &kUploadBytes,
      &kUvBytes,
      &kCalls,
      &kCallTime,
      &kStreams,
      &kReady,
      &kDraining,
      &kClockSkew,
      &kCertificateEnd,
      &kBuildInfo,
      &kProcessStart,
      &kProcessCpu,
      &kProcessResident,
      &kProcessDescriptors,
      &kProcessMaxDescriptors,
  };
  return *all;
}

const char* NameOf(MetricKind kind) {
  switch (kind) {
    case MetricKind::kCounter:
      return "counter";
    case MetricKind::kGauge:
      return "gauge";
    case MetricKind::kHistogram:
      return "histogram";
  }
  return "";
}

std::string MetricsTable() {
  std::string table = "| metric | kind | labels | |\n|---|---|---|---|\n";
  for (const MetricDefinition* metric : AllMetrics()) {
    absl::StrAppend(&table, "| `", metric->name, "` | ", NameOf(metric->kind), " | ", metric->labels, " | ",
                    absl::StrReplaceAll(metric->help, {{"|", "\\|"}}), " |\n");
  }
  return table;
}

}  // namespace planish
