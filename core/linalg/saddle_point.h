// The saddle-point system of one Newton step, seen as three maps (eq. 7 of the paper):
//
//   A x + B^t lambda = f
//   B x              = g
//
// Eliminating x gives the Schur complement  M lambda = B A^-1 f - g,  M = B A^-1 B^t,  x = A^-1 (f - B^t lambda). The
// iterative solvers never form M; a system that has M as a matrix may multiply by it (ApplySchur).
#pragma once

#include "Eigen/Core"
#include "core/base/thread_team.h"

namespace planish {

// Implementations are immutable while a solver uses them. Output vectors are resized.
class SaddlePointOperator {
 public:
  virtual ~SaddlePointOperator() = default;

  virtual Eigen::Index num_multipliers() const = 0;  // entries of lambda and g

  virtual void ApplyB(const Eigen::VectorXd& x, Eigen::VectorXd* y) const = 0;
  virtual void ApplyBTransposed(const Eigen::VectorXd& lambda, Eigen::VectorXd* x) const = 0;
  virtual void ApplyInverseA(const Eigen::VectorXd& f, Eigen::VectorXd* x) const = 0;

  // y = M lambda, by default B (A^-1 (B^t lambda)).
  virtual void ApplySchur(const Eigen::VectorXd& lambda, Eigen::VectorXd* y) const;
  // Whether ApplySchur multiplies by an M rounded to float. ApplyExactSchur never does.
  virtual bool rounds_schur() const { return false; }
  virtual void ApplyExactSchur(const Eigen::VectorXd& lambda, Eigen::VectorXd* y) const { ApplySchur(lambda, y); }
  // The diagonal of M.
  virtual Eigen::VectorXd SchurDiagonal() const = 0;

  // The threads that work on vectors of this system.
  virtual ThreadTeam& team() const { return Alone(); }

 private:
  mutable Eigen::VectorXd p_, h_;  // for ApplySchur, which is therefore not thread-safe
};

}  // namespace planish
