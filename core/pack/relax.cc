#include "core/pack/relax.h"

#include <algorithm>
#include <cmath>
#include <numeric>

#include "Eigen/Cholesky"
#include "core/mesh/box_tree.h"

namespace planish {
namespace {

constexpr int kContactLife = 5;              // steps
constexpr double kMomentum = 0.7;            // of a step that the next one keeps
constexpr std::int64_t kMostSteps = 200000;  // of single charts, for growing
constexpr double kShare = 0.5;               // of what is missing that one of two charts gives way

// Along the edges, no more than `spacing` apart; every vertex that is no closer than half of that to the last.
std::vector<Vec2> SampleOutline(const Outline& outline, double spacing) {
  std::vector<Vec2> samples;
  for (const auto& [from, to] : outline.edges) {
    const Vec2 &a = outline.points[from], &b = outline.points[to];
    const int parts = std::max(1, static_cast<int>(std::ceil((b - a).norm() / spacing)));
    for (int i = 0; i < parts; ++i) samples.push_back(a + (1.0 * i / parts) * (b - a));
  }
  return samples;
}

}  // namespace

Relaxer::Relaxer(const std::vector<Outline>& outlines, const std::vector<DistanceField>& fields,
                 std::vector<double> relative_scales, double scale, const RelaxOptions& options,
                 const Execution& execution)
    : outlines_(outlines),
      fields_(fields),
      relative_(std::move(relative_scales)),
      scale_(scale),
      options_(options),
      execution_(execution),
      bodies_(outlines.size()),
      margins_(outlines.size(), 0),
      velocity_(outlines.size()),
      skin_(2 * options.spacing) {
  shapes_.reserve(outlines.size());
  for (std::size_t i = 0; i < outlines.size(); ++i) {
    const double unit = relative_[i] * scale_;  // length in the texture of 1
    const double spacing = std::max(std::min(options_.spacing, outlines[i].radius * unit / 6), 1e-6) / unit;
    shapes_.push_back({SampleOutline(outlines[i], spacing), std::max(outlines[i].radius, 1e-12) / 1.5});
  }
}

void Relaxer::FindContacts() {
  age_ = 0;
  contacts_.clear();
  const std::size_t n = bodies_.size();
  std::vector<std::vector<Vec2>> samples(n);
  std::vector<Box> boxes(n);
  const double reach = options_.distance + skin_;
  for (std::size_t i = 0; i < n; ++i) {
    const double unit = scale_ * relative_[i], c = unit * std::cos(bodies_[i].angle),
                 s = unit * std::sin(bodies_[i].angle);
    samples[i].reserve(shapes_[i].samples.size());
    for (const Vec2& u : shapes_[i].samples) {
      samples[i].push_back(bodies_[i].centre + Vec2(c * u.x() - s * u.y(), s * u.x() + c * u.y()));
      boxes[i].Add(samples[i].back());
    }
    const double low = options_.low + skin_, high = 1 - low;
    const bool near_rim = boxes[i].low.minCoeff() < low || boxes[i].high.maxCoeff() > high;
    for (std::size_t k = 0; near_rim && k < samples[i].size(); ++k) {
      const Vec2& p = samples[i][k];
      const auto add = [&](bool near, std::int32_t side) {
        if (near) contacts_.push_back({static_cast<std::int32_t>(i), static_cast<std::int32_t>(k), side});
      };
      add(p.x() < low, -1);
      add(p.x() > high, -2);
      add(p.y() < low, -3);
      add(p.y() > high, -4);
    }
  }
  std::vector<std::int32_t> order(n);
  std::iota(order.begin(), order.end(), 0);
  std::sort(order.begin(), order.end(), [&](std::int32_t a, std::int32_t b) {
    return boxes[a].low.x() != boxes[b].low.x() ? boxes[a].low.x() < boxes[b].low.x() : a < b;
  });
  const auto collect = [&](std::int32_t a, std::int32_t b) {  // samples of a near b
    const double unit = scale_ * relative_[b], c = std::cos(bodies_[b].angle) / unit,
                 s = std::sin(bodies_[b].angle) / unit;
    Box box = boxes[b];
    box.low -= Vec2::Constant(reach);
    box.high += Vec2::Constant(reach);
    for (std::size_t k = 0; k < samples[a].size(); ++k) {
      const Vec2& p = samples[a][k];
      if (p.x() < box.low.x() || p.x() > box.high.x() || p.y() < box.low.y() || p.y() > box.high.y()) continue;
      ++looks_;
      const Vec2 q = p - bodies_[b].centre, local(c * q.x() + s * q.y(), c * q.y() - s * q.x());
      if (!fields_[b].Contains(local) || fields_[b].DistanceAt(local) * unit > reach) continue;
      contacts_.push_back({a, static_cast<std::int32_t>(k), b});
    }
  };
  for (std::size_t i = 0; i < n; ++i) {
    const std::int32_t a = order[i];
    for (std::size_t j = i + 1; j < n && boxes[order[j]].low.x() <= boxes[a].high.x() + reach; ++j) {
      const std::int32_t b = order[j];
      if (bodies_[a].tile != bodies_[b].tile) continue;
      if (boxes[b].low.y() > boxes[a].high.y() + reach || boxes[a].low.y() > boxes[b].high.y() + reach) continue;
      collect(a, b);
      collect(b, a);
    }
  }
}

double Relaxer::Step() {
  ++steps_;
  looks_ += static_cast<std::int64_t>(contacts_.size());
  if (age_ == 0) FindContacts();
  age_ = (age_ + 1) % kContactLife;
  struct Pull {
    Eigen::Matrix3d hessian = Eigen::Matrix3d::Zero();
    Vec3 gradient = Vec3::Zero();
  };
  const std::size_t n = bodies_.size();
  std::vector<Pull> pulls(n);
  std::vector<Vec2> turns(n);
  for (std::size_t i = 0; i < n; ++i) turns[i] = Vec2(std::cos(bodies_[i].angle), std::sin(bodies_[i].angle));
  double worst = 0, energy = 0;
  const auto push = [&](std::int32_t body, const Vec2& p, const Vec2& direction, double missing) {
    const Vec2 arm = p - bodies_[body].centre;
    const double radius = shapes_[body].turning_radius * scale_ * relative_[body];
    const Vec3 row(direction.x(), direction.y(), (arm.x() * direction.y() - arm.y() * direction.x()) / radius);
    pulls[body].hessian += row * row.transpose();
    pulls[body].gradient += missing * row;
  };
  for (const Contact& contact : contacts_) {
    const std::int32_t a = contact.body;
    const double unit = scale_ * relative_[a];
    const Vec2& u = shapes_[a].samples[contact.sample];
    const Vec2 p = bodies_[a].centre + unit * Vec2(turns[a].x() * u.x() - turns[a].y() * u.y(),
                                                   turns[a].y() * u.x() + turns[a].x() * u.y());
    double missing = 0;
    Vec2 direction;
    if (contact.other < 0) {
      const double low = options_.low + 2 * margins_[a], high = 1 - low;
      switch (contact.other) {
        case -1:
          missing = low - p.x();
          direction = Vec2(1, 0);
          break;
        case -2:
          missing = p.x() - high;
          direction = Vec2(-1, 0);
          break;
        case -3:
          missing = low - p.y();
          direction = Vec2(0, 1);
          break;
        default:
          missing = p.y() - high;
          direction = Vec2(0, -1);
          break;
      }
      if (missing <= 0) continue;
      push(a, p, direction, 2 * missing);
    } else {
      const std::int32_t b = contact.other;
      const double other_unit = scale_ * relative_[b];
      const Vec2 q = (p - bodies_[b].centre) / other_unit;
      const Vec2 local(turns[b].x() * q.x() + turns[b].y() * q.y(), turns[b].x() * q.y() - turns[b].y() * q.x());
      if (!fields_[b].Contains(local)) continue;
      const DistanceField::Value value = fields_[b].At(local);
      missing = options_.distance + margins_[a] + margins_[b] - value.distance * other_unit;
      if (missing <= 0) continue;
      direction = Vec2(turns[b].x() * value.gradient.x() - turns[b].y() * value.gradient.y(),
                       turns[b].y() * value.gradient.x() + turns[b].x() * value.gradient.y());
      push(a, p, direction, missing);
      push(b, p, -direction, missing);
    }
    worst = std::max(worst, missing);
    energy += missing * missing;
  }
  const double momentum = energy > 1.05 * last_energy_ ? 0.3 : kMomentum;
  last_energy_ = energy;
  for (std::size_t i = 0; i < n; ++i) {
    Vec3 step = Vec3::Zero();
    if (pulls[i].hessian(0, 0) + pulls[i].hessian(1, 1) > 0) {
      Eigen::Matrix3d hessian = pulls[i].hessian;
      const double damping = 0.05 * (hessian(0, 0) + hessian(1, 1));
      hessian.diagonal().array() += damping;
      step = kShare * hessian.ldlt().solve(pulls[i].gradient);
      const double most = skin_;
      const double length = step.norm();
      if (length > most) step *= most / length;
    }
    Motion& v = velocity_[i];
    v.x = momentum * v.x + step.x();
    v.y = momentum * v.y + step.y();
    v.turn = momentum * v.turn + step.z();
    bodies_[i].centre += Vec2(v.x, v.y);
    bodies_[i].angle += v.turn / (shapes_[i].turning_radius * scale_ * relative_[i]);
  }
  return worst;
}

void Relaxer::Grow(int patience) {
  constexpr double kGrowth = 1.002;
  std::vector<Body> best = bodies_;
  double best_scale = scale_;
  const std::int64_t most = steps_ + std::max<std::int64_t>(40, kMostSteps / static_cast<std::int64_t>(bodies_.size()));
  for (int stalled = 0; stalled < patience && steps_ < most && !execution_.IsStopped() && !execution_.IsHurried();
       ++stalled) {
    const std::vector<Body> before = bodies_;
    if (Step() > options_.tolerance) continue;
    best = before;
    best_scale = scale_;
    scale_ *= kGrowth;
    stalled = 0;
  }
  bodies_ = best;
  scale_ = best_scale;
  age_ = 0;
  velocity_.assign(bodies_.size(), {});
}

bool Relaxer::Separate(int steps) {
  velocity_.assign(bodies_.size(), {});
  age_ = 0;
  for (int i = 0; i < steps && !execution_.IsStopped(); ++i) {
    const std::vector<Body> before = bodies_;
    if (Step() > options_.tolerance) continue;
    bodies_ = before;
    return true;
  }
  return false;
}

}  // namespace planish
