// Loops over long vectors on a team of threads. Sums are added up chunk by chunk, so every team gives the same bits.
#pragma once

#include <cmath>
#include <cstdint>

#include "Eigen/Core"
#include "core/base/thread_team.h"

namespace planish {

inline constexpr std::int64_t kVectorChunk = 8192;

// *y = expression, entry by entry; y may occur in the expression.
template <typename Expression>
void Assign(ThreadTeam& team, const Expression& expression, Eigen::VectorXd* y) {
  if (y->size() != expression.size()) y->resize(expression.size());
  team.For(y->size(), kVectorChunk, [&](std::int64_t begin, std::int64_t end) {
    y->segment(begin, end - begin) = expression.segment(begin, end - begin);
  });
}

// Sum of the entries of an expression.
template <typename Expression>
double Sum(ThreadTeam& team, const Expression& expression) {
  return team.Sum(expression.size(), kVectorChunk,
                  [&](std::int64_t begin, std::int64_t end) { return expression.segment(begin, end - begin).sum(); });
}

inline double Dot(ThreadTeam& team, const Eigen::VectorXd& a, const Eigen::VectorXd& b) {
  return Sum(team, a.cwiseProduct(b));
}
inline double Norm(ThreadTeam& team, const Eigen::VectorXd& a) {
  return std::sqrt(Dot(team, a, a));
}

// Largest entry of an expression without negative entries; NaN if an entry is NaN, 0 if there are no entries.
template <typename Expression>
double Largest(ThreadTeam& team, const Expression& expression) {
  const auto of_part = [&](std::int64_t begin, std::int64_t end) -> double {
    return expression.segment(begin, end - begin).template maxCoeff<Eigen::PropagateNaN>();
  };
  double largest = 0;
  for (const double part : team.Collect<double>(expression.size(), kVectorChunk, of_part)) {
    largest = part > largest || std::isnan(part) ? part : largest;
  }
  return largest;
}

}  // namespace planish
