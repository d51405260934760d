// Aggregates: sets of strongly coupled rows, each of which becomes one row of the next coarser level of the multigrid.
#pragma once

#include <cstdint>
#include <vector>

#include "core/linalg/level_matrix.h"

namespace planish {

// Per block of the matrix, whether it is a strong coupling, which binds rows into one aggregate: |A_ij|^2 >= theta^2
// |A_ii| |A_jj| (Frobenius norms of the leading 2x2 parts), both rows below `num_coupled`. No diagonal block may be
// missing.
template <int N>
std::vector<char> StrongCouplings(const LevelMatrix<N>& matrix, double theta, std::int32_t num_coupled,
                                  ThreadTeam* team);

struct Aggregates {
  std::vector<std::int32_t> of_row;  // -1: the row has no strong coupling and is left to the smoother
  std::int32_t count = 0;
};

// Greedy aggregation (Vanek, Mandel, Brezina 1996): whole strong neighbourhoods first, then the rows between them. If
// `second_ring_neighbours` is positive, a neighbourhood also takes the rows of the second ring that are coupled to at
// least so many rows of the first (MultigridTuning); if 0, it takes the first ring alone.
template <int N>
Aggregates Aggregate(const LevelMatrix<N>& matrix, const std::vector<char>& strong,
                     std::int64_t second_ring_neighbours);

}  // namespace planish
