// The modified Uzawa algorithm with conjugate directions, section 7.2 of the paper, in its letters:
//
//   x_0 = A^-1 (f - B^t lambda_0),  d_0 = B x_0 - g,  q_0 = -d_0
//   p_k = B^t d_k,  h_k = A^-1 p_k
//   alpha_k = <q_k, q_k> / <p_k, h_k>
//   lambda_{k+1} = lambda_k + alpha_k d_k,  x_{k+1} = x_k - alpha_k h_k,  q_{k+1} = g - B x_{k+1}
//   beta_k = <q_{k+1}, q_{k+1}> / <q_k, q_k>
//   d_{k+1} = -q_{k+1} + beta_k d_k
//
// (The paper prints u_0 for x_0 and a minus before beta d_k; with q = g - B x the conjugate direction needs the plus,
// as in Braess 2001, section IV.5.) A preconditioner K puts z = K^-1 q in the place of q in d and of one q in each
// scalar product; K = I is the algorithm as printed. <p_k, h_k> is the curvature d^t M d.
#include "core/linalg/linear_solver.h"

namespace planish {
namespace {

class UzawaSolver final : public LinearSolver {
  LinearSummary SolveImpl(const SaddlePointOperator& system, const Preconditioner& preconditioner,
                          const Eigen::VectorXd& f, const Eigen::VectorXd& g, const LinearSolveOptions& options,
                          SaddlePointSolution* solution) const override {
    Eigen::VectorXd &x = solution->x, &lambda = solution->lambda;
    Eigen::VectorXd q, z, p, h;

    system.ApplyBTransposed(lambda, &p);
    p = f - p;
    system.ApplyInverseA(p, &x);
    system.ApplyB(x, &q);
    q = g - q;
    preconditioner.Apply(q, &z);
    Eigen::VectorXd d = -z;
    double qz = q.dot(z);
    const double goal = options.relative_tolerance * q.norm();

    LinearSummary summary;
    const double first = q.norm();
    while (true) {
      const double residual = q.norm();
      if (!std::isfinite(residual)) {
        summary.termination = LinearTermination::kStagnated;
        break;
      }
      if (residual <= goal) break;
      if (summary.iterations >= options.max_iterations) {
        summary.termination = LinearTermination::kIterationLimit;
        break;
      }
      if (summary.iterations % kProgressInterval == 0) {
        if (options.on_progress) options.on_progress(summary.iterations, residual / first);
        if (IsInterrupted(options.interrupter)) {
          summary.termination = LinearTermination::kInterrupted;
          break;
        }
      }
      system.ApplyBTransposed(d, &p);
      system.ApplyInverseA(p, &h);
      const double curvature = p.dot(h);
      if (!(curvature > 0) || !(qz > 0)) {
        summary.termination = LinearTermination::kIndefinite;
        break;
      }
      const double alpha = qz / curvature;
      lambda += alpha * d;
      x -= alpha * h;
      system.ApplyB(x, &q);
      q = g - q;
      preconditioner.Apply(q, &z);
      const double next_qz = q.dot(z);
      const double beta = next_qz / qz;
      qz = next_qz;
      d = beta * d - z;
      ++summary.iterations;
    }
    return summary;
  }
};

}  // namespace

std::unique_ptr<LinearSolver> MakeUzawaSolver() {
  return std::make_unique<UzawaSolver>();
}

}  // namespace planish
