// Smoothed-aggregation multigrid (Vanek, Mandel, Brezina 1996, "Algebraic multigrid by smoothed aggregation for second
// and fourth order elliptic problems") for the reduced system S. A preconditioner: one V-cycle in float.
//
// The near-null vectors. Read the pair of row i as a complex number lambda_i = u_i + i w_i, u of the vertex and w of
// the wheel multiplier. Let the angles meet the constraints, and let z_i be the vertices' places in the plane. Then S
// maps the constants and lambda = z to zero, except for rows next to the boundary: a face contributes the squared norm
// of the part of u_k + cot_k (w_{k-1} - w_{k+1}) that differs between its three angles, and for lambda = z that number
// is the same for all three, a coordinate of the triangle's orthocentre. So S is the energy of a map's deviation from
// the similarities a + b z, and the coarse spaces hold both a and b, as those of elasticity hold the rotations. With
// the constants alone the iterations grow with the mesh (27, 39, 46 for 20K, 200K, 1M triangles); with both they do
// not.
//
// Per level, with D the diagonal blocks:
//   aggregates     sets of strongly coupled neighbours
//   prolongation   P = (I - omega D^-1 A) P_0, P_0 the functions a + b z on every aggregate,
//                  omega = 4/3 over the largest eigenvalue of D^-1 A
//   coarse matrix  P^t A P, of 4x4 blocks: the complex unknowns a and b of every aggregate
//   smoother       Gauss-Seidel within chunks of rows and Jacobi between them, forward before and backward after the
//                  coarse correction: the cycle is symmetric. With couplings Out between chunks, and M what a forward
//                  sweep inverts, the cycle is positive definite if M + M^t - A is (Baker, Falgout, Kolev, Yang 2011,
//                  "Multigrid smoothers for ultraparallel computing"). For M = D + L, with L the part below
//                  the diagonal within chunks, M + M^t - A is D - Out, which need not be positive: on a foot of ten
//                  million triangles it was not, and conjugate directions broke down. So M = D + L + E, with a diagonal
//                  matrix E just large enough that D + 2 E - Out is positive (the l1 smoother of that paper;
//                  LevelMatrix::damping)
// The coarsest matrix is inverted.
#pragma once

#include <complex>
#include <cstdint>
#include <vector>

#include "Eigen/Core"
#include "absl/status/status.h"
#include "core/base/interrupter.h"
#include "core/base/thread_team.h"
#include "core/linalg/block_matrix.h"
#include "core/linalg/multigrid_level.h"
#include "core/linalg/preconditioner.h"
#include "core/linalg/tuning.h"

namespace planish {

// The levels, and the V-cycle as a preconditioner. Not thread-safe.
class Multigrid {
 public:
  explicit Multigrid(const MultigridTuning& tuning = {}) : tuning_(tuning) {}

  // Builds aggregates and the matrices of all levels for `matrix` and the positions z of its rows, known up to a
  // similarity; if all z are zero, the coarse spaces hold only the constants. Rows from `num_coupled` on (boundary
  // control) have no second unknown and are left out of aggregates. O(blocks). `team` must outlive this.
  // FAILED_PRECONDITION: a diagonal block or the coarsest matrix is not positive definite, or coarsening ends too early
  // (MultigridTuning::max_dense_rows). CANCELLED: interrupted.
  absl::Status Build(const BlockMatrix<float>& matrix, const std::vector<std::complex<double>>& z,
                     std::int32_t num_coupled, ThreadTeam& team = Alone(), const Interrupter* interrupter = nullptr);
  // Recomputes the entries of all matrices for the aggregates of the last Build(); `matrix` must have the same pattern.
  absl::Status Refresh(const BlockMatrix<float>& matrix, const std::vector<std::complex<double>>& z,
                       const Interrupter* interrupter = nullptr);

  // z = one V-cycle on r from zero.
  void Apply(const Eigen::VectorXd& r, Eigen::VectorXd* z) const;

  int num_levels() const { return static_cast<int>(coarse_.size()) + 1; }
  // Entries of the matrices of all levels, relative to the finest.
  double operator_complexity() const;

 private:
  absl::Status InvertCoarsest();
  // One V-cycle: computes x of the finest level from its b.
  void Cycle() const;

  const MultigridTuning tuning_;
  ThreadTeam* team_ = nullptr;
  // Mutable, since Apply() writes the vectors of the levels.
  mutable MultigridLevel<2> finest_;
  mutable std::vector<MultigridLevel<4>> coarse_;
  Eigen::MatrixXf inverse_;  // of the coarsest matrix
};

// K^-1 = one V-cycle of `multigrid`, which must outlive this.
inline Preconditioner MultigridPreconditioner(const Multigrid* multigrid) {
  return [multigrid](const Eigen::VectorXd& r, Eigen::VectorXd* z) { multigrid->Apply(r, z); };
}

}  // namespace planish
