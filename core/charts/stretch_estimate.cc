#include "core/charts/stretch_estimate.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>

namespace planish {
namespace {

constexpr std::int32_t kOutline = -2;
constexpr std::int32_t kUnknown = -1;
constexpr double kMaxCotangent = 1e4;  // of angles below 0.006 degrees: an estimate need not resolve more
constexpr double kTolerance = 1e-2;    // of the residual, in the norm of the diagonal
constexpr int kMaxIterations = 200;

}  // namespace

StretchEstimate::StretchEstimate(const Gluing& gluing)
    : gluing_(gluing),
      cotangent_(gluing.opposite().size()),
      vertex_(gluing.opposite().size(), kUnknown),
      kept_(gluing.opposite().size(), 0.0F) {
  const std::vector<double>& angle = gluing.surface().angle;
  for (std::size_t c = 0; c < angle.size(); ++c) {
    const double sine = std::sin(angle[c]);
    cotangent_[c] = std::clamp(sine > 0 ? std::cos(angle[c]) / sine : kMaxCotangent, -kMaxCotangent, kMaxCotangent);
  }
}

void StretchEstimate::NumberVertices(const std::vector<std::int32_t>& faces) {
  const std::vector<std::int32_t>& opposite = gluing_.opposite();
  for (const std::int32_t f : faces) {
    for (std::int32_t c = 3 * f; c < 3 * f + 3; ++c) vertex_[c] = kUnknown;
  }
  num_interior_ = 0;
  for (const std::int32_t f : faces) {
    for (int k = 0; k < 3; ++k) {
      const std::int32_t start = 3 * f + k;
      if (vertex_[start] != kUnknown) continue;
      // Once round the vertex, counter-clockwise: either back to the start or up to the outline, and then the rest of
      // the way clockwise.
      const std::int32_t number = num_interior_;
      std::int32_t c = start;
      bool closed = false;
      for (;;) {
        vertex_[c] = number;
        const std::int32_t o = opposite[3 * (c / 3) + Next(c % 3)];
        if (o < 0) break;
        c = 3 * (o / 3) + Next(o % 3);
        if (c == start) {
          closed = true;
          break;
        }
      }
      if (closed) {
        ++num_interior_;
        continue;
      }
      // `c` is the last one counter-clockwise: from there all the way back.
      for (;;) {
        vertex_[c] = kOutline;
        const std::int32_t o = opposite[3 * (c / 3) + Prev(c % 3)];
        if (o < 0) break;
        c = 3 * (o / 3) + Prev(o % 3);
      }
    }
  }
}

void StretchEstimate::Assemble(const std::vector<std::int32_t>& faces) {
  const std::vector<std::int32_t>& opposite = gluing_.opposite();
  const std::vector<double>& angle = gluing_.surface().angle;
  defect_.assign(num_interior_, 2 * std::numbers::pi);
  diagonal_.assign(num_interior_, 0.0);
  u_.assign(num_interior_, 0.0);
  edges_.clear();
  for (const std::int32_t f : faces) {
    for (int k = 0; k < 3; ++k) {
      const std::int32_t c = 3 * f + k, v = vertex_[c];
      if (v >= 0) {
        defect_[v] -= angle[c];
        u_[v] = kept_[c];
      }
      const std::int32_t o = opposite[c];
      if (o < c) continue;  // on the outline, or seen from the other side
      const double weight = (cotangent_[c] + cotangent_[o]) / 2;
      const std::int32_t from = vertex_[3 * f + Next(k)], to = vertex_[3 * f + Prev(k)];
      if (from >= 0) diagonal_[from] += weight;
      if (to >= 0) diagonal_[to] += weight;
      if (from >= 0 && to >= 0) edges_.push_back({from, to, weight});
    }
  }
}

void StretchEstimate::Solve() {
  const std::int32_t n = num_interior_;
  residual_.resize(n);
  direction_.resize(n);
  product_.resize(n);
  const auto multiply = [&](const std::vector<double>& x) {
    for (std::int32_t i = 0; i < n; ++i) product_[i] = diagonal_[i] * x[i];
    for (const Edge& e : edges_) {
      product_[e.from] -= e.weight * x[e.to];
      product_[e.to] -= e.weight * x[e.from];
    }
  };
  // Conjugate gradients with the diagonal. Positive unless triangles are hopeless.
  double norm = 0;
  for (std::int32_t i = 0; i < n; ++i) {
    if (!(diagonal_[i] > 0)) diagonal_[i] = 1;
    norm += defect_[i] * defect_[i] / diagonal_[i];
  }
  multiply(u_);
  double rho = 0;
  for (std::int32_t i = 0; i < n; ++i) {
    residual_[i] = -defect_[i] - product_[i];
    direction_[i] = residual_[i] / diagonal_[i];
    rho += residual_[i] * direction_[i];
  }
  for (int iteration = 0; iteration < kMaxIterations && rho > kTolerance * kTolerance * norm; ++iteration) {
    multiply(direction_);
    double curvature = 0;
    for (std::int32_t i = 0; i < n; ++i) curvature += direction_[i] * product_[i];
    if (!(curvature > 0)) break;
    const double step = rho / curvature;
    double next_rho = 0;
    for (std::int32_t i = 0; i < n; ++i) {
      u_[i] += step * direction_[i];
      residual_[i] -= step * product_[i];
      next_rho += residual_[i] * residual_[i] / diagonal_[i];
    }
    const double beta = next_rho / rho;
    for (std::int32_t i = 0; i < n; ++i) direction_[i] = residual_[i] / diagonal_[i] + beta * direction_[i];
    rho = next_rho;
  }
}

double StretchEstimate::operator()(const std::vector<std::int32_t>& first, const std::vector<std::int32_t>& second) {
  faces_ = first;
  faces_.insert(faces_.end(), second.begin(), second.end());
  NumberVertices(faces_);
  Assemble(faces_);
  Solve();
  const std::vector<double>& area = gluing_.surface().area;
  double total = 0, larger = 0, smaller = 0;
  for (const std::int32_t f : faces_) {
    for (std::int32_t c = 3 * f; c < 3 * f + 3; ++c) {
      const double scale = vertex_[c] >= 0 ? std::exp(2 * u_[vertex_[c]]) : 1.0;
      larger += area[f] * scale;
      smaller += area[f] / scale;
    }
    total += 3 * area[f];
  }
  if (!(total > 0)) return 1;
  const double stretch = std::sqrt(larger / total) * std::sqrt(smaller / total);
  return std::isfinite(stretch) ? std::max(1.0, stretch) : std::numeric_limits<double>::infinity();
}

void StretchEstimate::Keep() {
  for (const std::int32_t f : faces_) {
    for (std::int32_t c = 3 * f; c < 3 * f + 3; ++c) {
      kept_[c] = vertex_[c] >= 0 ? static_cast<float>(u_[vertex_[c]]) : 0.0F;
    }
  }
}

}  // namespace planish
