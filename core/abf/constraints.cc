#include "core/abf/constraints.h"

#include <numbers>

#include "core/base/portable_math.h"
#include "core/linalg/vector_ops.h"

namespace planish {

namespace {

// The logarithm of a quotient of products of sines.
class LogQuotient {
 public:
  void Multiply(double factor) {
    numerator_ *= factor;
    if (numerator_ < kSmall) Flush();
  }
  void Divide(double factor) {
    denominator_ *= factor;
    if (denominator_ < kSmall) Flush();
  }
  double Value() const { return sum_ + portable::Log(numerator_ / denominator_); }

 private:
  // Products of sines only shrink; before they can underflow, their logarithm is added to sum_.
  static constexpr double kSmall = 1e-100;
  void Flush() {
    sum_ += portable::Log(numerator_) - portable::Log(denominator_);
    numerator_ = denominator_ = 1;
  }
  double numerator_ = 1, denominator_ = 1, sum_ = 0;
};

// Calls `of` with the sine and cosine of every angle and returns the results.
template <typename Of>
Eigen::VectorXd OfAngles(const Eigen::VectorXd& x, ThreadTeam& team, const Of& of) {
  Eigen::VectorXd result(x.size());
  team.For(x.size(), kVectorChunk, [&](std::int64_t begin, std::int64_t end) {
    const double* angle = x.data();
    double* to = result.data();
    for (std::int64_t i = begin; i < end; ++i) to[i] = of(portable::SinCosInTriangle(angle[i]));
  });
  return result;
}

}  // namespace

Eigen::VectorXd Sines(const Eigen::VectorXd& x, ThreadTeam& team) {
  return OfAngles(x, team, [](const portable::SineCosine& at) { return at.sine; });
}

Eigen::VectorXd Cotangents(const Eigen::VectorXd& x, ThreadTeam& team) {
  return OfAngles(x, team, [](const portable::SineCosine& at) { return at.cosine / at.sine; });
}

ConstraintValues EvaluateConstraints(const Topology& topology, const Eigen::VectorXd& x, const Eigen::VectorXd& sine,
                                     ThreadTeam& team) {
  ConstraintValues h;
  h.triangle.resize(topology.num_faces());
  team.ForEach(topology.num_faces(),
               [&](std::int64_t f) { h.triangle[f] = x[3 * f] + x[3 * f + 1] + x[3 * f + 2] - std::numbers::pi; });
  h.pair.resize(2 * topology.num_rows);
  team.ForEach(topology.num_rows, [&](std::int64_t v) {
    const bool has_wheel = topology.has_wheel(static_cast<std::int32_t>(v));
    double sum = has_wheel ? -2 * std::numbers::pi : -std::numbers::pi;
    LogQuotient wheel;
    for (std::int32_t i = topology.row_corner_begin[v]; i < topology.row_corner_begin[v + 1]; ++i) {
      const std::int32_t c = topology.row_corner[i], f = c / 3, k = c % 3;
      sum += x[c];
      wheel.Multiply(sine[3 * f + Next(k)]);
      wheel.Divide(sine[3 * f + Prev(k)]);
    }
    h.pair[2 * v] = sum;
    h.pair[2 * v + 1] = has_wheel ? wheel.Value() : 0;
  });
  return h;
}

void ApplyPairRows(const Topology& topology, const Eigen::VectorXd& cot, const Eigen::VectorXd& x, Eigen::VectorXd* y,
                   ThreadTeam& team) {
  y->resize(2 * topology.num_rows);
  team.ForEach(topology.num_rows, [&](std::int64_t v) {
    double sum = 0, wheel = 0;
    for (std::int32_t i = topology.row_corner_begin[v]; i < topology.row_corner_begin[v + 1]; ++i) {
      const std::int32_t c = topology.row_corner[i], f = c / 3, k = c % 3;
      const std::int32_t after = 3 * f + Next(k), before = 3 * f + Prev(k);
      sum += x[c];
      wheel += cot[after] * x[after] - cot[before] * x[before];
    }
    (*y)[2 * v] = sum;
    (*y)[2 * v + 1] = topology.has_wheel(static_cast<std::int32_t>(v)) ? wheel : 0;
  });
}

void AddPairRowsTransposed(const Topology& topology, const Eigen::VectorXd& cot,
                           const Eigen::Ref<const Eigen::VectorXd>& pair, Eigen::VectorXd* x, ThreadTeam& team) {
  team.ForEach(topology.num_faces(), [&](std::int64_t f) {
    const std::array<double, 3> wheel = WheelDifferences(topology, f, pair);
    for (int k = 0; k < 3; ++k) {
      double& angle = (*x)[3 * f + k];
      if (const std::int32_t row = topology.corner_row[3 * f + k]; row >= 0) angle += pair[2 * row];
      angle += cot[3 * f + k] * wheel[k];
    }
  });
}

}  // namespace planish
