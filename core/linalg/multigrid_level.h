// One level of a multigrid hierarchy: its matrix, the smoother, and the transfer to the next level.
#pragma once

#include <complex>
#include <cstdint>
#include <vector>

#include "core/base/interrupter.h"
#include "core/base/thread_team.h"
#include "core/linalg/aggregation.h"
#include "core/linalg/level_matrix.h"

namespace planish {

// Where the unknowns of a level are: row i is the centre of what it stands for, with an extent that is zero on the
// finest level. See multigrid.h.
struct LevelCoordinates {
  std::vector<std::complex<double>> centre;
  std::vector<double> extent;
};

// P = (I - omega D^-1 A) P_0. In P_0, row i of aggregate I takes from the coarse unknowns (alpha_I, beta_I), complex
// numbers,
//
//   alpha_i = alpha_I + offset_i beta_I,   beta_i = scale_i beta_I   (beta_i: not on the finest level)
//
// so that alpha + beta (z - centre_I) / extent_I on the aggregate is alpha_i at z = centre_i.
struct Prolongation {
  Aggregates aggregates;
  std::vector<float> offset;  // pairs
  std::vector<float> scale;
  double omega = 0;

  // Row i: blocks [row_begin[i], row_begin[i + 1]) of N x 4, as 2x2 parts by rows, each by rows.
  std::vector<std::int32_t> row_begin = {0};
  std::vector<std::int32_t> column;
  std::vector<float> value;
  // Row I of the transpose: a row of P and a block in it each.
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
  using Vector = typename LevelVector<N>::Type;

  LevelMatrix<N> a;
  LevelCoordinates coordinates;
  Prolongation prolongation;
  // The cycle's right-hand side, solution and the solution before a sweep: N floats a row.
  std::vector<float> b, x, old;

  std::int32_t num_rows() const { return a.num_rows(); }
  void ResizeVectors();

  // x = one forward sweep of Gauss-Seidel within chunks on a x = b from zero, Jacobi between them.
  void RelaxFromZero(ThreadTeam* team);
  // coarse_b = P^t (b - a x), right after RelaxFromZero.
  void Restrict(std::vector<float>* coarse_b, ThreadTeam* team);
  // x += P coarse_x, then one backward sweep: the transpose of RelaxFromZero's.
  void CorrectAndRelax(const std::vector<float>& coarse_x, ThreadTeam* team);
  // Both of these leave things half done after an interrupt.
  //
  // The structure of P and of P^t A P, and omega. False: the rows hold together too little for a coarser level. Rows
  // from `num_coupled` on stay out of aggregates.
  bool BuildCoarse(double theta, std::int32_t num_coupled, LevelMatrix<4>* coarse, ThreadTeam* team,
                   const Interrupter* interrupter);
  // The numbers of P, the coordinates of the aggregates, and P^t A P.
  void FillCoarse(LevelCoordinates* coarse_coordinates, LevelMatrix<4>* coarse, ThreadTeam* team,
                  const Interrupter* interrupter);

 private:
  void FillOffsets(LevelCoordinates* coarse_coordinates);
  void FillProlongation(ThreadTeam* team);
};

}  // namespace planish
