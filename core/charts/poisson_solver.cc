#include "core/charts/poisson_solver.h"

#include <algorithm>

namespace planish {

// Products of rows of one triangle of -A with a vector. Rows must be asked for in ascending, or in descending, order.
class PoissonSolver::Products {
 public:
  static Products Ascending(const Triangle& triangle) { return Products(triangle, 0, 1); }
  static Products Descending(const Triangle& triangle) {
    return Products(triangle, static_cast<std::ptrdiff_t>(triangle.more.size()) - 1, -1);
  }

  double Row(std::int32_t i, const std::vector<double>& x) {
    const auto& [weight, column] = triangle_.rows[i];
    double sum =
        (weight[0] * x[column[0]] + weight[1] * x[column[1]]) + (weight[2] * x[column[2]] + weight[3] * x[column[3]]);
    for (; next_ >= 0 && next_ < std::ssize(triangle_.more) && triangle_.more[next_].row == i; next_ += step_) {
      sum += triangle_.more[next_].weight * x[triangle_.more[next_].column];
    }
    return sum;
  }

 private:
  Products(const Triangle& triangle, std::ptrdiff_t next, int step) : triangle_(triangle), next_(next), step_(step) {}

  const Triangle& triangle_;
  std::ptrdiff_t next_;
  const int step_;
};

void PoissonSolver::Start(std::int32_t n) {
  size_ = 0;
  for (Triangle* triangle : {&lower_, &upper_}) {
    if (std::ssize(triangle->rows) < n) triangle->rows.resize(n);
    triangle->more.clear();
  }
  for (std::vector<double>* numbers : {&diagonal_, &b_, &u_}) numbers->resize(n);
}

// With A = D - L - L^t and D' = D / omega, the preconditioner is M = (D' - L) D'^-1 (D' - L^t), up to a factor.
// Conjugate gradients run with (D' - L)^-1 A (D' - L^t)^-1 in place of A, and D'^-1 in place of M. That matrix maps p
// to t + (D' - L)^-1 (p + (D - 2 D') t), where t = (D' - L^t)^-1 p is also the change of u.
void PoissonSolver::Solve(double tolerance, int most_iterations) {
  constexpr double kOmega = 1.3;  // 1.2 to 1.4 take the fewest iterations
  const std::int32_t n = size_;
  inverse_.resize(n);
  direction_.resize(n);
  for (std::vector<double>* numbers : {&residual_, &step_, &product_}) numbers->assign(n, 0.0);
  double norm = 0, rho = 0;
  {
    // Computes (D' - L)^-1 (b - A u), and (D' - L)^-1 b in `product_`.
    Products lower = Products::Ascending(lower_), upper = Products::Ascending(upper_);
    Products of_residual = lower, of_b = lower;
    for (std::int32_t i = 0; i < n; ++i) {
      const double residual = b_[i] - diagonal_[i] * u_[i] + lower.Row(i, u_) + upper.Row(i, u_);
      diagonal_[i] /= kOmega;
      inverse_[i] = 1 / diagonal_[i];
      residual_[i] = (residual + of_residual.Row(i, residual_)) * inverse_[i];
      product_[i] = (b_[i] + of_b.Row(i, product_)) * inverse_[i];
      direction_[i] = diagonal_[i] * residual_[i];
      norm += diagonal_[i] * product_[i] * product_[i];
      rho += direction_[i] * residual_[i];
    }
  }
  const double enough = tolerance * tolerance * norm;
  for (int iteration = 0; iteration < most_iterations && rho > enough; ++iteration) {
    Products upper = Products::Descending(upper_);
    for (std::int32_t i = n; i-- > 0;) step_[i] = (direction_[i] + upper.Row(i, step_)) * inverse_[i];
    Products lower = Products::Ascending(lower_);
    for (std::int32_t i = 0; i < n; ++i) {
      product_[i] = (direction_[i] + (kOmega - 2) * diagonal_[i] * step_[i] + lower.Row(i, product_)) * inverse_[i];
    }
    double curvature = 0;
    for (std::int32_t i = 0; i < n; ++i) {
      product_[i] += step_[i];
      curvature += direction_[i] * product_[i];
    }
    if (!(curvature > 0)) break;
    const double length = rho / curvature;
    double next_rho = 0;
    for (std::int32_t i = 0; i < n; ++i) {
      u_[i] += length * step_[i];
      residual_[i] -= length * product_[i];
      next_rho += diagonal_[i] * residual_[i] * residual_[i];
    }
    const double beta = next_rho / rho;
    for (std::int32_t i = 0; i < n; ++i) direction_[i] = diagonal_[i] * residual_[i] + beta * direction_[i];
    rho = next_rho;
  }
}

}  // namespace planish
