// Exact solves on a few rows before and after another preconditioner: a symmetric multiplicative Schwarz method.
#pragma once

#include <cstdint>
#include <limits>
#include <vector>

#include "absl/status/statusor.h"
#include "core/linalg/block_matrix.h"
#include "core/linalg/preconditioner.h"

namespace planish {

// Improves another preconditioner M^-1 of a matrix S on a patch: rows of blocks for which M^-1 works badly.
// With P^-1 the inverse of the patch's own part of S, and zero elsewhere,
//   1 - K^-1 S = (1 - P^-1 S) (1 - M^-1 S) (1 - P^-1 S).
// K^-1 is symmetric, and positive definite if M^-1 is. The patch is the ascending `rows` of `matrix`, whose numbers are
// copied. FAILED_PRECONDITION: the patch's own part is not positive definite. RESOURCE_EXHAUSTED: its factor takes more
// than `max_bytes`, or memory ran out.
absl::StatusOr<Preconditioner> PatchedPreconditioner(Preconditioner other, const BlockMatrix<float>& matrix,
                                                     std::vector<std::int32_t> rows,
                                                     std::int64_t max_bytes = std::numeric_limits<std::int64_t>::max());

}  // namespace planish
