// Converts the core's progress and results to messages of the API.
#pragma once

#include <cstdint>
#include <vector>

#include "absl/status/statusor.h"
#include "core/mesh/mesh.h"
#include "core/unwrap/unwrap.h"
#include "planish/v1/job.pb.h"
#include "server/link/blob.h"

namespace planish {

// Does not set `elapsed` and the tolerance.
v1::Progress ToProto(const UnwrapProgress& progress);

// Most charts that a report describes one by one (planish.v1.Report.charts): a few hundred KB.
inline constexpr std::size_t kMaxChartReports = 1024;
// Most AtlasParts in a report.
inline constexpr std::size_t kMaxAtlasParts = 1024;

// Does not set times.queue, times.decode, times.encode, peak_memory_bytes and threads. `options`: those of the unwrap
// that made `result`.
v1::Report ToProto(const UnwrapResult& result, const Mesh& mesh, const UnwrapOptions& options);

// The UV bytes of planish.v1.UvDescription: little-endian float32 when `precision` is kFloat (every number must then
// be a float), float64 otherwise. RESOURCE_EXHAUSTED with OUT_OF_MEMORY.
absl::StatusOr<BlobPtr> PackUv(const std::vector<double>& uv, Precision precision);

}  // namespace planish
