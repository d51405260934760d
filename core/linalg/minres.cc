// MINRES (Paige & Saunders 1975, reference [15]) on M lambda = B A^-1 f - g, section 7.1 of the paper, with a symmetric
// positive definite preconditioner K; the paper has K = I. M is applied as B (A^-1 (B^t .)), or as a matrix if the
// system has it.
//
// Letters as in Paige & Saunders: Lanczos vectors v with coefficients alfa, beta; the tridiagonal matrix is reduced by
// plane rotations (cs, sn); w are the search directions. The residual itself, r, follows from its norm phi_bar and the
// last Lanczos vector, r_k = sn_k^2 r_{k-1} - phi_bar_k cs_k v_{k+1} (Choi, Paige & Saunders 2011, section 2.2).
#include <cmath>
#include <limits>

#include "core/base/portable_math.h"
#include "core/linalg/linear_solver.h"
#include "core/linalg/vector_ops.h"

namespace planish {

LinearSolver MakeMinresSolver() {
  return [](const SaddlePointOperator& system, const Preconditioner& preconditioner, const Eigen::VectorXd& rhs,
            const LinearSolveOptions& options, Eigen::VectorXd* lambda) {
    ThreadTeam& team = system.team();
    Eigen::VectorXd r1 = rhs;
    Eigen::VectorXd r2 = r1, y, v, w, w1, w2;
    const bool rough = !options.rough.empty();
    Eigen::VectorXd r;
    if (rough) r = rhs;
    const Eigen::Index n = r1.size();
    w = w1 = w2 = Eigen::VectorXd::Zero(n);
    preconditioner(r1, &y);

    LinearSummary summary;
    const double beta1 = std::sqrt(Dot(team, r1, y));
    double beta = beta1, old_beta = 0;
    double delta_bar = 0, epsilon = 0;
    double phi_bar = beta1;  // norm of the residual
    double cs = -1, sn = 0;
    const auto is_good_enough = [&] {
      return rough ? IsMet(options.rough, phi_bar / beta1, r, team) : phi_bar <= options.relative_tolerance * beta1;
    };
    while (GoesOn(phi_bar / beta1, is_good_enough(), options, &summary)) {
      Assign(team, y / beta, &v);
      system.ApplySchur(v, &y);
      if (summary.iterations > 0) Assign(team, y - (beta / old_beta) * r1, &y);
      const double alfa = Dot(team, v, y);
      r1.swap(r2);
      Assign(team, y - (alfa / beta) * r1, &r2);
      preconditioner(r2, &y);
      old_beta = beta;
      const double beta_squared = Dot(team, r2, y);
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
      const double gamma = std::max(portable::Hypot(gamma_bar, beta), std::numeric_limits<double>::min());
      cs = gamma_bar / gamma;
      sn = beta / gamma;
      const double phi = cs * phi_bar;
      phi_bar = sn * phi_bar;
      if (rough) Assign(team, (sn * sn) * r - (beta > 0 ? phi_bar * cs / beta : 0) * r2, &r);

      w1.swap(w2);
      w2.swap(w);
      Assign(team, (v - old_epsilon * w1 - delta * w2) / gamma, &w);
      Assign(team, *lambda + phi * w, lambda);
      ++summary.iterations;
      if (beta == 0) break;  // the Krylov space is exhausted
    }
    summary.energy = phi_bar / beta1;
    return summary;
  };
}

}  // namespace planish
