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
// scalar product; K = I is the algorithm as printed.
//
// p, h and x do not appear below: <p_k, h_k> = <d_k, M d_k> is the curvature of M, q_{k+1} = q_k + alpha_k M d_k, and x
// follows from the last lambda. So a system that has M as a matrix can use it.
//
// The energy of the error, e^t M e with e = lambda - lambda_k, falls by alpha_k <q_k, z_k> in iteration k (Hestenes and
// Stiefel 1952, theorem 6:1); the rest is estimated from how fast it falls.
#include <algorithm>
#include <cmath>

#include "core/linalg/linear_solver.h"
#include "core/linalg/vector_ops.h"

namespace planish {
namespace {

// The error in the norm of M relative to the start, estimated from the decrease of the energy in each iteration.
class ErrorEstimate {
 public:
  explicit ErrorEstimate(double slowest_rate) : slowest_rate_(slowest_rate) {}

  void Add(double decrease) {
    rate_before_ = rate_;
    rate_ = last_ > 0 ? decrease / last_ : 1;
    last_ = decrease;
    total_ += decrease;
  }
  double Taken() const { return total_; }
  // Assumes that the energy keeps falling as in the slower of the last two iterations.
  double Left() const {
    if (!(total_ > 0)) return 1;
    const double rate = std::min(std::max(rate_, rate_before_), slowest_rate_);
    const double left = last_ * rate / (1 - rate);
    return std::sqrt(left / (total_ + left));
  }

 private:
  const double slowest_rate_;  // LinearTuning::slowest_rate
  double total_ = 0, last_ = 0, rate_ = 1, rate_before_ = 1;
};

}  // namespace

LinearSolver MakeUzawaSolver() {
  return [](const SaddlePointOperator& system, const Preconditioner& preconditioner, const Eigen::VectorXd& rhs,
            const LinearSolveOptions& options, Eigen::VectorXd* lambda) {
    ThreadTeam& team = system.team();
    Eigen::VectorXd q = -rhs, z, d = Eigen::VectorXd::Zero(rhs.size()), schur;
    double qz = 1;
    const double first = Norm(team, q);
    ErrorEstimate error(options.tuning.slowest_rate);
    double residual = first;
    const auto is_good_enough = [&] {
      if (options.rough.empty()) return residual <= options.relative_tolerance * first;
      return residual == 0 || IsMet(options.rough, error.Left(), q, team);
    };

    LinearSummary summary;
    while (GoesOn(residual / first, is_good_enough(), options, &summary)) {
      preconditioner(q, &z);
      const double next_qz = Dot(team, q, z);
      const double beta = next_qz / qz;
      qz = next_qz;
      Assign(team, beta * d - z, &d);
      system.ApplySchur(d, &schur);
      const double curvature = Dot(team, d, schur);
      if (!(curvature > 0) || !(qz > 0)) {
        summary.termination = LinearTermination::kIndefinite;
        break;
      }
      const double alpha = qz / curvature;
      residual = std::sqrt(team.Sum(q.size(), kVectorChunk, [&](std::int64_t begin, std::int64_t end) {
        const std::int64_t n = end - begin;
        lambda->segment(begin, n) += alpha * d.segment(begin, n);
        q.segment(begin, n) += alpha * schur.segment(begin, n);
        return q.segment(begin, n).squaredNorm();
      }));
      error.Add(alpha * qz);
      ++summary.iterations;
    }
    summary.energy = residual == 0 ? 0 : error.Left();
    summary.energy_taken = error.Taken();
    return summary;
  };
}

}  // namespace planish
