#include "core/abf/full_system.h"

namespace planish {

FullSystem::FullSystem(const Topology& topology, const Eigen::VectorXd& hessian, const Eigen::VectorXd& cot)
    : topology_(topology), inverse_hessian_(hessian.cwiseInverse()), cot_(cot) {}

void FullSystem::ApplyB(const Eigen::VectorXd& x, Eigen::VectorXd* y) const {
  Eigen::VectorXd pair;
  ApplyPairRows(topology_, cot_, x, &pair);
  y->resize(num_multipliers());
  for (std::int32_t f = 0; f < topology_.num_faces(); ++f) (*y)[f] = x[3 * f] + x[3 * f + 1] + x[3 * f + 2];
  y->tail(pair.size()) = pair;
}

void FullSystem::ApplyBTransposed(const Eigen::VectorXd& lambda, Eigen::VectorXd* x) const {
  x->resize(num_unknowns());
  for (std::int32_t c = 0; c < topology_.num_corners(); ++c) (*x)[c] = lambda[c / 3];
  AddPairRowsTransposed(topology_, cot_, lambda.tail(2 * topology_.num_rows), x);
}

void FullSystem::ApplyInverseA(const Eigen::VectorXd& f, Eigen::VectorXd* x) const {
  *x = inverse_hessian_.cwiseProduct(f);
}

Eigen::VectorXd FullSystem::SchurDiagonal() const {
  Eigen::VectorXd diagonal = Eigen::VectorXd::Zero(num_multipliers());
  for (std::int32_t c = 0; c < topology_.num_corners(); ++c) {
    const std::int32_t f = c / 3, k = c % 3;
    diagonal[f] += inverse_hessian_[c];
    const std::int32_t v = topology_.corner_row[c];
    if (v < 0) continue;
    double* pair = &diagonal[topology_.num_faces() + 2 * v];
    const std::int32_t after = 3 * f + Next(k), before = 3 * f + Prev(k);
    pair[0] += inverse_hessian_[c];
    if (!topology_.has_wheel(v)) {
      pair[1] = pair[0];  // the row is absent: anything positive
      continue;
    }
    pair[1] +=
        cot_[after] * cot_[after] * inverse_hessian_[after] + cot_[before] * cot_[before] * inverse_hessian_[before];
  }
  return diagonal;
}

}  // namespace planish
