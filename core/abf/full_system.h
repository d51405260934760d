// The full system M = B A^-1 B^t of the paper: all F + 2 num_rows multipliers, matrix-free.
#pragma once

#include "core/abf/constraints.h"
#include "core/linalg/saddle_point.h"

namespace planish {

class FullSystem final : public SaddlePointOperator {
 public:
  // `hessian` is the diagonal A (no zeros), `cot` the cotangents at which B is taken. `topology` must outlive this.
  FullSystem(const Topology& topology, const Eigen::VectorXd& hessian, const Eigen::VectorXd& cot);

  Eigen::Index num_unknowns() const override { return topology_.num_corners(); }
  Eigen::Index num_multipliers() const override { return topology_.num_faces() + 2 * topology_.num_rows; }
  void ApplyB(const Eigen::VectorXd& x, Eigen::VectorXd* y) const override;
  void ApplyBTransposed(const Eigen::VectorXd& lambda, Eigen::VectorXd* x) const override;
  void ApplyInverseA(const Eigen::VectorXd& f, Eigen::VectorXd* x) const override;
  Eigen::VectorXd SchurDiagonal() const override;

 private:
  const Topology& topology_;
  Eigen::VectorXd inverse_hessian_, cot_;
};

}  // namespace planish
