#pragma once

#include <cstdint>
#include <string_view>

#include "absl/status/statusor.h"
#include "planish/v1/job.pb.h"

namespace planish {

// An estimate of what a worker needs for a mesh, from the counts that the file declares.
struct WorkNeeds {
  v1::MeshSize size;              // as declared
  std::int64_t memory_bytes = 0;  // beyond what an idle worker holds
  double run_seconds = 0;         // on one idle core, roughly
};

// Estimates the needs without decoding the mesh. `draco`: at least the first bytes of a file of `mesh_bytes` bytes; may
// be empty. `size`: the counts to use if `draco` does not tell them. Numbers below 0 count as 0. INVALID_ARGUMENT with
// MESH_DECODE_FAILED or OPTIONS_INVALID.
absl::StatusOr<WorkNeeds> EstimateNeeds(std::string_view draco, std::int64_t mesh_bytes, const v1::MeshSize& size,
                                        const v1::UnwrapOptions& options);

}  // namespace planish
