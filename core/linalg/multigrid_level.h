// One level of a multigrid hierarchy: its matrix, the smoother, and the transfer to the next level.
#pragma once

#include <complex>
#include <cstdint>
#include <vector>

#include "absl/status/status.h"
#include "core/base/interrupter.h"
#include "core/base/thread_team.h"
#include "core/linalg/level_matrix.h"
#include "core/linalg/tuning.h"

namespace planish {

// ---- Aggregates: sets of strongly coupled rows, each of which becomes one row of the next coarser level.

// Per block of the matrix, whether it is a strong coupling, which joins rows into an aggregate: |A_ij|^2 >= theta^2
// |A_ii| |A_jj| (Frobenius norms of the leading 2x2 parts), both rows below `num_coupled`. Every row must have a
// diagonal block.
template <int N>
std::vector<char> StrongCouplings(const LevelMatrix<N>& matrix, double theta, std::int32_t num_coupled,
                                  ThreadTeam* team);

struct Aggregates {
  std::vector<std::int32_t> of_row;  // -1: the row has no strong coupling; only the smoother treats it
  std::int32_t count = 0;
};

// Greedy aggregation (Vanek, Mandel, Brezina 1996): whole strong neighbourhoods first, then the rows between them. If
// `second_ring_neighbours` is positive, a neighbourhood includes the rows of the second ring that are coupled to at
// least that many rows of the first (MultigridTuning); if 0, only the first ring.
template <int N>
Aggregates Aggregate(const LevelMatrix<N>& matrix, const std::vector<char>& strong,
                     std::int64_t second_ring_neighbours);

// ---- Levels.

// The positions of a level's unknowns in the plane: the centre of the vertices that row i represents, and the extent,
// about their root mean square distance from the centre. On the finest level a row is one vertex, and `extent` is
// empty. See multigrid.h.
struct LevelCoordinates {
  std::vector<std::complex<double>> centre;
  std::vector<double> extent;
};

// P = (I - omega D^-1 A) P_0, except for rows with many couplings, which are those of P_0. In P_0, row i of aggregate I
// gets from the coarse unknowns (alpha_I, beta_I), complex numbers,
//
//   alpha_i = alpha_I + offset_i beta_I,   beta_i = scale_i beta_I   (beta_i: not on the finest level)
//
// so that alpha + beta (z - centre_I) / extent_I on the aggregate is alpha_i at z = centre_i.
struct Prolongation {
  Aggregates aggregates;
  std::vector<float> offset;  // pairs
  std::vector<float> scale;
  double omega = 0;
  std::int64_t most_smoothed_couplings = 0;  // as in MultigridTuning

  // Row i: blocks [row_begin[i], row_begin[i + 1]) of N x 4, as 2x2 parts by rows, each by rows.
  std::vector<std::int32_t> row_begin = {0};
  std::vector<std::int32_t> column;
  std::vector<float> value;
  // Row I of the transpose: rows of P, and the block in each.
  struct Place {
    std::int32_t row, block;
  };
  std::vector<std::int32_t> transposed_begin;
  std::vector<Place> transposed;

  // The columns of A P.
  std::vector<std::int32_t> product_begin, product_column;
};

template <int N>
struct MultigridLevel {
  using Vector = LevelVector<N>;

  LevelMatrix<N> a;
  LevelCoordinates coordinates;
  Prolongation prolongation;
  // Vectors of the cycle: the right-hand side, the solution, and the solution before a sweep. N floats a row.
  std::vector<float> b, x, old;

  std::int32_t num_rows() const { return a.num_rows(); }
  void ResizeVectors();

  // Sets x to one forward sweep on a x = b from zero, Gauss-Seidel within chunks and Jacobi between them:
  // (D + L + E) x = b (multigrid.h).
  void RelaxFromZero(ThreadTeam* team);
  // coarse_b = P^t (b - a x). Call right after RelaxFromZero(), whose result it uses.
  void Restrict(std::vector<float>* coarse_b, ThreadTeam* team);
  // x += P coarse_x, then one backward sweep, the transpose of the forward one.
  void CorrectAndRelax(const std::vector<float>& coarse_x, ThreadTeam* team);

  // Builds the pattern of P and of P^t A P, and omega. False: too few couplings of strength `theta` for a coarser
  // level. Rows from `num_coupled` on are left out of aggregates. After a cancellation the results of BuildCoarse() and
  // FillCoarse() are incomplete.
  bool BuildCoarse(const MultigridTuning& tuning, double theta, std::int32_t num_coupled, LevelMatrix<4>* coarse,
                   ThreadTeam* team, const Interrupter* interrupter);
  // Computes the numbers of P, the coordinates of the aggregates, and `coarse`, which is P^t A P, with its diagonal
  // inverted. CANCELLED: interrupted. FAILED_PRECONDITION: LevelMatrix::InvertDiagonal().
  absl::Status FillCoarse(const MultigridTuning& tuning, MultigridLevel<4>* coarse, ThreadTeam* team,
                          const Interrupter* interrupter);

 private:
  void FillOffsets(LevelCoordinates* coarse_coordinates);
  void FillProlongation(ThreadTeam* team);
};

}  // namespace planish
