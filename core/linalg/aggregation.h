// Sets of strongly coupled neighbours, the coarse unknowns of the multigrid.
#pragma once

#include <cstdint>
#include <vector>

#include "core/linalg/block_matrix.h"

namespace planish {

// Whether each off-diagonal block couples its row strongly: |A_ij|^2 >= theta^2 |A_ii| |A_jj| (Frobenius norms).
std::vector<char> StrongCouplings(const BlockMatrix<float>& matrix, double theta);

struct Aggregates {
  std::vector<std::int32_t> of_row;  // -1: no strong neighbour, left to the smoother
  std::int32_t count = 0;
};

// Greedy (Vanek, Mandel, Brezina 1996): whole strong neighbourhoods first, then the rows between them.
Aggregates Aggregate(const BlockMatrix<float>& matrix, const std::vector<char>& strong);

}  // namespace planish
