// The two saddle-point systems of a Newton step: the full system M = B A^-1 B^t of the paper, with all F + 2 num_rows
// multipliers, and the reduced system S, from which the multipliers of triangle consistency have been eliminated too.
//
// With J the pair rows of B, D = A^-1 on the three angles of a face and s their sum, P = D - D 1 1^t D / s is the
// inverse of A on the plane of angle changes that sum to zero, and
//
//   S = J P J^t,   S lambda_2 = J P f - (g_2 - J x_p),   x = x_p + P (f - J^t lambda_2)
//
// where x_p = D 1 g_1 / s meets the triangle rows. To the solvers this is a saddle-point system with J for B and P for
// A^-1, so MINRES and Uzawa run on S unchanged, and every x they see keeps the angle sum of each face.
//
// P is computed from A without dividing by its entries, which may be zero or negative as long as A is positive
// definite on the plane: with e = a0 a1 + a1 a2 + a2 a0, P_00 = (a1 + a2) / e and P_01 = -a2 / e.
#pragma once

#include <cstdint>
#include <functional>
#include <type_traits>
#include <vector>

#include "core/abf/constraints.h"
#include "core/linalg/block_matrix.h"
#include "core/linalg/saddle_point.h"

namespace planish {

// The full system M. Applies M without storing it.
class FullSystem final : public SaddlePointOperator {
 public:
  // `hessian` is the diagonal A (no zeros), `cot` the cotangents at which B is taken. `topology` must outlive this.
  FullSystem(const Topology& topology, const Eigen::VectorXd& hessian, const Eigen::VectorXd& cot);

  Eigen::Index num_multipliers() const override { return topology_.num_faces() + 2 * topology_.num_rows; }
  void ApplyB(const Eigen::VectorXd& x, Eigen::VectorXd* y) const override;
  void ApplyBTransposed(const Eigen::VectorXd& lambda, Eigen::VectorXd* x) const override;
  void ApplyInverseA(const Eigen::VectorXd& f, Eigen::VectorXd* x) const override;
  Eigen::VectorXd SchurDiagonal() const override;

 private:
  const Topology& topology_;
  Eigen::VectorXd inverse_hessian_, cot_;
};

// The reduced system S.
class ReducedSystem final : public SaddlePointOperator {
 public:
  // `hessian` is the diagonal A, non-singular on the plane of every face; `cot` the cotangents at which J is taken. All
  // arguments must outlive this.
  ReducedSystem(const Topology& topology, const Eigen::VectorXd& hessian, const Eigen::VectorXd& cot,
                ThreadTeam& team = Alone());
  ReducedSystem(const Topology&, Eigen::VectorXd&&, const Eigen::VectorXd&, ThreadTeam& = Alone()) = delete;
  ReducedSystem(const Topology&, const Eigen::VectorXd&, Eigen::VectorXd&&, ThreadTeam& = Alone()) = delete;

  // From now on ApplySchur multiplies by `matrix`: S of this system, exact or rounded to float. It must outlive this.
  template <typename Scalar>
  void set_matrix(const BlockMatrix<Scalar>* matrix) {
    rounds_ = std::is_same_v<Scalar, float>;
    multiply_ = [matrix, &team = team_](const auto& x, auto* y) { Multiply(*matrix, x, y, team); };
  }

  Eigen::Index num_multipliers() const override { return 2 * topology_.num_rows; }
  void ApplyB(const Eigen::VectorXd& x, Eigen::VectorXd* y) const override;
  void ApplyBTransposed(const Eigen::VectorXd& lambda, Eigen::VectorXd* x) const override;
  void ApplyInverseA(const Eigen::VectorXd& f, Eigen::VectorXd* x) const override;
  void ApplySchur(const Eigen::VectorXd& lambda, Eigen::VectorXd* y) const override;
  bool rounds_schur() const override { return rounds_; }
  void ApplyExactSchur(const Eigen::VectorXd& lambda, Eigen::VectorXd* y) const override;
  Eigen::VectorXd SchurDiagonal() const override;
  ThreadTeam& team() const override { return team_; }

  // The rest of the step from lambda_2, with f = -gradient and g_1 = -h_1: x as above, and lambda_1 unless null.
  void Recover(const Eigen::VectorXd& gradient, const Eigen::VectorXd& h1, const Eigen::VectorXd& lambda2,
               Eigen::VectorXd* x, Eigen::VectorXd* lambda1) const;

 private:
  const Topology& topology_;
  ThreadTeam& team_;
  const Eigen::VectorXd &hessian_, &cot_;
  Eigen::VectorXd inverse_e_;                                               // 1 / e per face
  std::function<void(const Eigen::VectorXd&, Eigen::VectorXd*)> multiply_;  // set by set_matrix(); empty before
  bool rounds_ = false;                                                     // whether that matrix is rounded
};

// The rows of the vertices of `faces`, ascending.
std::vector<std::int32_t> RowsOfFaces(const Topology& topology, const std::vector<std::int32_t>& faces);

// S as a matrix of double or of float. Float halves the memory that a product reads, which is most of its cost. The
// pattern, one 2x2 block per pair of rows whose vertices share a face, is made once; Assemble() only changes values.
template <typename Scalar = double>
class ReducedMatrix {
 public:
  // `topology` and `team` must outlive this.
  explicit ReducedMatrix(const Topology& topology, ThreadTeam& team = Alone());
  // S for the diagonal A and the cotangents at which J is taken. While the team assembles, one thread calls `beside`,
  // which must not touch this matrix.
  const BlockMatrix<Scalar>& Assemble(
      const Eigen::VectorXd& hessian, const Eigen::VectorXd& cot, const std::function<void()>& beside = [] {});

 private:
  const Topology& topology_;
  ThreadTeam& team_;
  BlockMatrix<Scalar> matrix_;
  std::vector<std::int32_t> diagonal_;  // per row: its diagonal block
};

}  // namespace planish
