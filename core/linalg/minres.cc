// MINRES (Paige & Saunders 1975, reference [15]) on M lambda = B A^-1 f - g, section 7.1 of the paper, with a symmetric
// positive definite preconditioner K; K = I is the paper's. M is applied as B (A^-1 (B^t .)), never formed.
//
// Letters as in Paige & Saunders: Lanczos vectors v with coefficients alfa, beta; the tridiagonal matrix is reduced by
// plane rotations (cs, sn); w are the search directions.
#include <cmath>
#include <limits>

#include "core/linalg/linear_solver.h"

namespace planish {
namespace {

class MinresSolver final : public LinearSolver {
  LinearSummary SolveImpl(const SaddlePointOperator& system, const Preconditioner& preconditioner,
                          const Eigen::VectorXd& f, const Eigen::VectorXd& g, const LinearSolveOptions& options,
                          SaddlePointSolution* solution) const override {
    Eigen::VectorXd p, h;
    system.ApplyInverseA(f, &h);
    Eigen::VectorXd r1;
    system.ApplyB(h, &r1);
    r1 -= g;  // B A^-1 f - g

    Eigen::VectorXd r2 = r1, y, v, w, w1, w2;
    const Eigen::Index n = r1.size();
    w = w1 = w2 = Eigen::VectorXd::Zero(n);
    preconditioner.Apply(r1, &y);

    LinearSummary summary;
    const double beta1 = std::sqrt(r1.dot(y));
    double beta = beta1, old_beta = 0;
    double delta_bar = 0, epsilon = 0;
    double phi_bar = beta1;  // norm of the residual
    double cs = -1, sn = 0;
    while (true) {
      if (!std::isfinite(phi_bar)) {
        summary.termination = LinearTermination::kStagnated;
        break;
      }
      if (phi_bar <= options.relative_tolerance * beta1) break;
      if (summary.iterations >= options.max_iterations) {
        summary.termination = LinearTermination::kIterationLimit;
        break;
      }
      if (summary.iterations % kProgressInterval == 0) {
        if (options.on_progress) options.on_progress(summary.iterations, phi_bar / beta1);
        if (IsInterrupted(options.interrupter)) {
          summary.termination = LinearTermination::kInterrupted;
          break;
        }
      }

      v = y / beta;
      system.ApplyBTransposed(v, &p);
      system.ApplyInverseA(p, &h);
      system.ApplyB(h, &y);
      if (summary.iterations > 0) y -= (beta / old_beta) * r1;
      const double alfa = v.dot(y);
      y -= (alfa / beta) * r2;
      r1.swap(r2);
      r2 = y;
      preconditioner.Apply(r2, &y);
      old_beta = beta;
      const double beta_squared = r2.dot(y);
      if (beta_squared < 0) {
        summary.termination = LinearTermination::kStagnated;
        break;
      }
      beta = std::sqrt(beta_squared);

      const double old_epsilon = epsilon;
      const double delta = cs * delta_bar + sn * alfa;
      const double gamma_bar = sn * delta_bar - cs * alfa;
      epsilon = sn * beta;
      delta_bar = -cs * beta;
      const double gamma = std::max(std::hypot(gamma_bar, beta), std::numeric_limits<double>::min());
      cs = gamma_bar / gamma;
      sn = beta / gamma;
      const double phi = cs * phi_bar;
      phi_bar = sn * phi_bar;

      w1.swap(w2);
      w2.swap(w);
      w = (v - old_epsilon * w1 - delta * w2) / gamma;
      solution->lambda += phi * w;
      ++summary.iterations;
      if (beta == 0) break;  // the Krylov space is exhausted
    }
    return summary;
  }
};

}  // namespace

std::unique_ptr<LinearSolver> MakeMinresSolver() {
  return std::make_unique<MinresSolver>();
}

}  // namespace planish
