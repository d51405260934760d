// Sets of strongly coupled neighbours, the coarse unknowns of the multigrid.
#pragma once

#include <cstdint>
#include <vector>

#include "core/linalg/level_matrix.h"

namespace planish {

// Couplings weaker than this do not bind rows into one aggregate: |A_ij|^2 < theta^2 |A_ii| |A_jj| (Frobenius norms of
// the leading 2x2 parts). Nor do those of rows from `num_coupled` on. No diagonal block may be missing.
template <int N>
std::vector<char> StrongCouplings(const LevelMatrix<N>& matrix, double theta, std::int32_t num_coupled,
                                  ThreadTeam* team);

struct Aggregates {
  std::vector<std::int32_t> of_row;  // -1: no strong neighbour, left to the smoother
  std::int32_t count = 0;
};

// Greedy (Vanek, Mandel, Brezina 1996): whole strong neighbourhoods first, then the rows between them. A `wide`
// neighbourhood also has the second neighbours that two of its rows are coupled to: about 13 rows of a triangulation
// instead of 7.
template <int N>
Aggregates Aggregate(const LevelMatrix<N>& matrix, const std::vector<char>& strong, bool wide);

}  // namespace planish
