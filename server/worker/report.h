// The core's progress and results in the service's words.
#pragma once

#include <cstdint>
#include <vector>

#include "absl/status/statusor.h"
#include "core/mesh/mesh.h"
#include "core/unwrap/unwrap.h"
#include "planish/v1/job.pb.h"
#include "server/link/blob.h"

namespace planish {

// Without `elapsed` and tolerance.
v1::Progress ToProto(const UnwrapProgress& progress);

// Charts that a report describes one by one (planish.v1.Report.charts): a few hundred KB.
inline constexpr std::size_t kMaxChartReports = 1024;
// AtlasParts in a report at most.
inline constexpr std::size_t kMaxAtlasParts = 1024;

// Without times.queue, times.decode, times.encode, peak_memory_bytes and threads. `result` came from `options`.
v1::Report ToProto(const UnwrapResult& result, const Mesh& mesh, const UnwrapOptions& options);

// The UV bytes of planish.v1.UvDescription: little-endian float32 when `precision` is kFloat (every number must then
// be a float), float64 otherwise. RESOURCE_EXHAUSTED with OUT_OF_MEMORY.
absl::StatusOr<BlobPtr> PackUv(const std::vector<double>& uv, Precision precision);

}  // namespace planish
