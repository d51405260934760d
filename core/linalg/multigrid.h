// Smoothed-aggregation multigrid (Vanek, Mandel, Brezina 1996) for the reduced system S. A preconditioner: one V-cycle
// in float.
//
// The near-null vectors. Take the pair of row i for a complex number lambda_i. Where the angles meet the constraints
// and z_i are the vertices' places in the plane, S maps both the constants and lambda = z to zero, but for rows next to
// the boundary: with w the wheel and u the vertex multipliers, a face adds the squared norm of the part of u_k + cot_k
// (w_{k-1} - w_{k+1}) that is not constant over its three angles, and for u + i w = z that is the orthocentre of the
// triangle, whatever its shape. So S is the energy of a map's deviation from all similarities a + b z, and the coarse
// spaces hold both, as those of elasticity hold the rotations. With the constants alone the iterations grow with the
// mesh (27, 39, 46 for 20K, 200K, 1M triangles); with both they do not.
//
// Per level, with D the diagonal blocks:
//   aggregates     sets of strongly coupled neighbours
//   prolongation   P = (I - omega D^-1 A) P_0, P_0 the functions a + b z on every aggregate,
//                  omega = 4/3 over the largest eigenvalue of D^-1 A
//   coarse matrix  P^t A P, of 4x4 blocks: the complex unknowns a and b of every aggregate
//   smoother       Gauss-Seidel within chunks of rows, forward before and backward after the coarse
//                  correction: the cycle is symmetric
// The coarsest matrix is inverted.
#pragma once

#include <complex>
#include <cstdint>
#include <memory>
#include <vector>

#include "Eigen/Core"
#include "absl/status/status.h"
#include "core/base/interrupter.h"
#include "core/base/thread_team.h"
#include "core/linalg/block_matrix.h"
#include "core/linalg/preconditioner.h"

namespace planish {

struct MultigridOptions {
  double strength = 0.08;           // theta on the finest level, halved on every coarser one; in [0, 1)
  std::int32_t coarsest_rows = 40;  // block rows at which coarsening ends
  int max_levels = 20;
};

// Not thread-safe.
class Multigrid {
 public:
  explicit Multigrid(const MultigridOptions& options = {});
  ~Multigrid();
  Multigrid(const Multigrid&) = delete;
  Multigrid& operator=(const Multigrid&) = delete;

  // Builds aggregates and numbers for `matrix` and the places z of its rows, up to a similarity; if all are zero the
  // coarse spaces hold the constants only. Rows from `num_coupled` on (boundary control) have no second unknown and
  // stay out of aggregates. O(blocks). `team` must outlive this. FAILED_PRECONDITION: a diagonal block or the coarsest
  // matrix is not positive definite. CANCELLED: interrupted.
  absl::Status Build(const BlockMatrix<float>& matrix, const std::vector<std::complex<double>>& z,
                     std::int32_t num_coupled, ThreadTeam& team = Alone(), const Interrupter* interrupter = nullptr);
  // New numbers on the aggregates of the last Build(); the pattern must be the same.
  absl::Status Refresh(const BlockMatrix<float>& matrix, const std::vector<std::complex<double>>& z,
                       const Interrupter* interrupter = nullptr);

  // z = one V-cycle on r from zero.
  void Apply(const Eigen::VectorXd& r, Eigen::VectorXd* z) const;

  int num_levels() const;
  // Numbers in the matrices of all levels over those of the finest.
  double operator_complexity() const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

// K^-1 = one V-cycle of `multigrid`, which must outlive this.
class MultigridPreconditioner final : public Preconditioner {
 public:
  explicit MultigridPreconditioner(const Multigrid* multigrid) : multigrid_(multigrid) {}
  void Apply(const Eigen::VectorXd& r, Eigen::VectorXd* z) const override { multigrid_->Apply(r, z); }

 private:
  const Multigrid* multigrid_;
};

}  // namespace planish
