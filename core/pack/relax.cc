#include "core/pack/relax.h"

#include <algorithm>
#include <cmath>

namespace planish {
namespace {

constexpr std::int32_t kBlock = 16;          // samples in each
constexpr int kContactLife = 8;              // least number of steps between two searches for contacts
constexpr double kMomentum = 0.7;            // share of a step that the next one keeps
constexpr std::int64_t kMostSteps = 200000;  // moves of single charts while growing
constexpr double kSureOfDistance = 0.9;  // far from a chart, its field overestimates by up to 8 % (along the diagonals)
constexpr double kFar = 1e300;
// Costs in nanoseconds: a distance lookup, a contact in a step, a distant contact, a body in a step.
constexpr std::int64_t kLookWork = 9, kContactWork = 20, kFarContactWork = 2, kBodyWork = 200;
constexpr double kTurningPart = 1.5;  // radius of a chart over its turning radius
constexpr double kShare = 0.5;        // part of a missing distance by which each of the two charts moves

// Points along the edges, at most `spacing` apart. Skips vertices that are within half the spacing of the last sample.
std::vector<Vec2> SampleOutline(const Outline& outline, double spacing) {
  std::vector<Vec2> samples;
  std::int32_t last = -1;  // where the previous edge ended
  for (const auto& [from, to] : outline.edges) {
    const Vec2 &a = outline.points[from], &b = outline.points[to];
    const int parts = std::max(1, static_cast<int>(std::ceil((b - a).norm() / spacing)));
    const bool is_near = from == last && (a - samples.back()).squaredNorm() < spacing * spacing / 4;
    for (int i = is_near ? 1 : 0; i < parts; ++i) samples.push_back(a + (1.0 * i / parts) * (b - a));
    last = to;
  }
  return samples;
}

}  // namespace

Relaxer::Relaxer(const std::vector<Outline>& outlines, const std::vector<DistanceField>& fields,
                 std::vector<double> relative_scales, double scale, const RelaxOptions& options,
                 const Execution& execution)
    : fields_(fields),
      relative_(std::move(relative_scales)),
      scale_(scale),
      options_(options),
      execution_(execution),
      poses_(outlines.size()),
      margins_(outlines.size(), 0),
      velocity_(outlines.size(), Vec3::Zero()),
      contacts_{.skin = 2 * options.spacing, .found = {}, .moved = std::vector<double>(outlines.size(), 0)} {
  shapes_.reserve(outlines.size());
  for (std::size_t i = 0; i < outlines.size(); ++i) {
    const double unit = relative_[i] * scale_;  // length in the texture of 1 in the chart
    const double spacing = std::max(std::min(options_.spacing, outlines[i].radius * unit / 6), 1e-6) / unit;
    Shape& shape = shapes_.emplace_back(
        Shape{SampleOutline(outlines[i], spacing), {}, std::max(outlines[i].radius, 1e-12) / kTurningPart});
    const auto n = static_cast<std::int32_t>(shape.samples.size());
    for (std::int32_t begin = 0; begin < n; begin += kBlock) {
      const std::int32_t end = std::min(begin + kBlock, n);
      Box box;
      for (std::int32_t k = begin; k < end; ++k) box.Add(shape.samples[k]);
      Block& block = shape.blocks.emplace_back(Block{begin, end, (box.low + box.high) / 2, 0});
      for (std::int32_t k = begin; k < end; ++k) {
        block.radius = std::max(block.radius, (shape.samples[k] - block.centre).norm());
      }
    }
  }
}

void Relaxer::FindContacts() {
  contacts_.age = 0;
  contacts_.found.clear();
  std::fill(contacts_.moved.begin(), contacts_.moved.end(), 0);
  const std::size_t n = poses_.size();
  // In the texture: the rotation and scale of each body, the centres of its blocks, and its bounding box.
  std::vector<Rotation> turns(n);
  std::vector<Vec2> centres;
  std::vector<std::size_t> first_centre(n);
  std::vector<Box> boxes(n);
  const double reach = options_.distance + contacts_.skin;
  const auto place = [&](std::int32_t i, const Vec2& u) { return Vec2(poses_[i].centre + turns[i](u)); };
  for (std::int32_t i = 0; i < static_cast<std::int32_t>(n); ++i) {
    const double unit = scale_ * relative_[i];
    turns[i] = Rotation(poses_[i].angle, unit);
    first_centre[i] = centres.size();
    const double low = options_.low + contacts_.skin, high = 1 - low;
    for (const Block& block : shapes_[i].blocks) {
      const Vec2 centre = place(i, block.centre), extent = Vec2::Constant(block.radius * unit);
      centres.push_back(centre);
      boxes[i].Add(centre - extent);
      boxes[i].Add(centre + extent);
      if ((centre - extent).minCoeff() >= low && (centre + extent).maxCoeff() <= high) continue;
      for (std::int32_t k = block.begin; k < block.end; ++k) {
        const Vec2 p = place(i, shapes_[i].samples[k]);
        const auto add = [&](bool near, std::int32_t side) {
          if (near) contacts_.found.push_back({i, k, side});
        };
        add(p.x() < low, -1);
        add(p.x() > high, -2);
        add(p.y() < low, -3);
        add(p.y() > high, -4);
      }
    }
  }
  const auto collect = [&](std::int32_t a, std::int32_t b) {  // collects the samples of a near b
    const double a_unit = scale_ * relative_[a], unit = scale_ * relative_[b];
    const DistanceField& field = fields_[b];
    // The motion from the frame of a to that of b.
    Rotation own = turns[b];
    own.cosine /= unit * unit;
    own.sine /= unit * unit;
    const Vec2 turn = own.Back({turns[a].cosine, turns[a].sine});
    const Vec2 shift = own.Back(poses_[a].centre - poses_[b].centre);
    const auto local = [&](const Vec2& u) {
      return Vec2(shift.x() + turn.x() * u.x() - turn.y() * u.y(), shift.y() + turn.y() * u.x() + turn.x() * u.y());
    };
    const double local_reach = reach / unit;
    for (std::size_t i = 0; i < shapes_[a].blocks.size(); ++i) {
      const Block& block = shapes_[a].blocks[i];
      const double around = reach + block.radius * a_unit;
      const Vec2& centre = centres[first_centre[a] + i];
      if (!boxes[b].Grown(around).Has(centre)) continue;
      spent_.work += kLookWork;
      if (kSureOfDistance * field.DistanceNear(local(block.centre), 0) * unit > around) continue;
      spent_.work += kLookWork * (block.end - block.begin);
      for (std::int32_t k = block.begin; k < block.end; ++k) {
        if (field.DistanceNear(local(shapes_[a].samples[k]), kFar) <= local_reach) contacts_.found.push_back({a, k, b});
      }
    }
  };
  ForEachNearPair(boxes, reach, [&](std::int32_t a, std::int32_t b) {
    if (poses_[a].tile != poses_[b].tile) return;
    collect(a, b);
    collect(b, a);
  });
}

double Relaxer::Step() {
  ++spent_.steps;
  const auto have_moved = [&] {
    return *std::max_element(contacts_.moved.begin(), contacts_.moved.end()) > contacts_.skin;
  };
  if (contacts_.age == 0 || (contacts_.age >= kContactLife && have_moved())) FindContacts();
  ++contacts_.age;
  std::int64_t looked_at = 0;  // contacts evaluated
  // The normal equations for the motion of a body: sums over its contacts of row * row^T (upper half only) and of
  // missing * row. A row (x, y, t) says by how much the body's motion along x, along y and in rotation changes the
  // distance.
  struct Pull {
    double xx = 0, xy = 0, xt = 0, yy = 0, yt = 0, tt = 0;
    double x = 0, y = 0, t = 0;
  };
  const std::size_t n = poses_.size();
  std::vector<Pull> pulls(n);
  std::vector<Rotation> turns;
  for (const Pose& pose : poses_) turns.emplace_back(pose.angle);
  double worst = 0, energy = 0;
  const auto push = [&](std::int32_t body, const Vec2& p, const Vec2& direction, double missing) {
    const Vec2 arm = p - poses_[body].centre;
    const double radius = shapes_[body].turning_radius * scale_ * relative_[body];
    const double x = direction.x(), y = direction.y(), t = (arm.x() * y - arm.y() * x) / radius;
    Pull& pull = pulls[body];
    pull.xx += x * x;
    pull.xy += x * y;
    pull.xt += x * t;
    pull.yy += y * y;
    pull.yt += y * t;
    pull.tt += t * t;
    pull.x += missing * x;
    pull.y += missing * y;
    pull.t += missing * t;
  };
  for (Contact& contact : contacts_.found) {
    const double moved = Moved(contact);
    if (moved < contact.far_until) continue;
    ++looked_at;
    const std::int32_t a = contact.body;
    const double unit = scale_ * relative_[a];
    const Vec2 p = poses_[a].centre + unit * turns[a](shapes_[a].samples[contact.sample]);
    double missing = 0;
    if (contact.other < 0) {
      const int axis = contact.other >= -2 ? 0 : 1;
      const bool is_low = contact.other == -1 || contact.other == -3;
      const double low = options_.low + 2 * margins_[a];
      missing = is_low ? low - p[axis] : p[axis] - (1 - low);
      contact.far_until = static_cast<float>(moved - missing);
      if (missing <= 0) continue;
      Vec2 direction = Vec2::Zero();
      direction[axis] = is_low ? 1 : -1;
      push(a, p, direction, 2 * missing);
    } else {
      const std::int32_t b = contact.other;
      const double other_unit = scale_ * relative_[b];
      const Vec2 local = turns[b].Back((p - poses_[b].centre) / other_unit);
      // Most contacts are far enough and need no gradient.
      missing = options_.distance + margins_[a] + margins_[b] - fields_[b].DistanceNear(local, kFar) * other_unit;
      const double far = std::min(-kSureOfDistance * missing, contacts_.skin);
      contact.far_until = static_cast<float>(moved + far);
      if (missing <= 0) continue;
      const Vec2 direction = turns[b](fields_[b].Gradient(local));
      push(a, p, direction, missing);
      push(b, p, -direction, missing);
    }
    worst = std::max(worst, missing);
    energy += missing * missing;
  }
  spent_.work +=
      kFarContactWork * std::ssize(contacts_.found) + kContactWork * looked_at + kBodyWork * std::ssize(poses_);
  const double momentum = energy > 1.05 * last_energy_ ? 0.3 : kMomentum;
  last_energy_ = energy;
  for (std::size_t i = 0; i < n; ++i) {
    Vec3 step = Vec3::Zero();
    const Pull& pull = pulls[i];
    if (pull.xx + pull.yy > 0) {
      // L D L^T of the damped matrix, which is positive definite.
      const double damping = 0.05 * (pull.xx + pull.yy);
      const double d0 = pull.xx + damping, l10 = pull.xy / d0, l20 = pull.xt / d0;
      const double d1 = pull.yy + damping - l10 * pull.xy, l21 = (pull.yt - l20 * pull.xy) / d1;
      const double d2 = pull.tt + damping - l20 * pull.xt - l21 * (pull.yt - l20 * pull.xy);
      const double z1 = pull.y - l10 * pull.x, z2 = pull.t - l20 * pull.x - l21 * z1;
      const double t = z2 / d2, y = z1 / d1 - l21 * t;
      step = kShare * Vec3(pull.x / d0 - l10 * y - l20 * t, y, t);
      const double most = contacts_.skin;
      const double length = step.norm();
      if (length > most) step *= most / length;
    }
    Vec3& v = velocity_[i];
    v = momentum * v + step;
    poses_[i].centre += v.head<2>();
    poses_[i].angle += v.z() / (shapes_[i].turning_radius * scale_ * relative_[i]);
    contacts_.moved[i] += v.head<2>().norm() + kTurningPart * std::abs(v.z());
  }
  return worst;
}

void Relaxer::set_scale(double scale) {
  for (std::size_t i = 0; i < poses_.size(); ++i) {
    const double radius = kTurningPart * shapes_[i].turning_radius * relative_[i];
    contacts_.moved[i] += std::abs(scale - scale_) * radius;
  }
  scale_ = scale;
}

void Relaxer::Grow(int patience, std::int64_t most_work, double growth) {
  const std::int64_t end = spent_.work + most_work;
  std::vector<Pose> best = poses_;
  double best_scale = scale_;
  const std::int64_t most =
      spent_.steps + std::max<std::int64_t>(40, kMostSteps / static_cast<std::int64_t>(poses_.size()));
  for (int stalled = 0; stalled < patience && spent_.steps < most && spent_.work < end && !execution_.IsCancelled() &&
                        !execution_.IsStopRequested();
       ++stalled) {
    const std::vector<Pose> before = poses_;
    if (Step() > options_.tolerance) continue;
    best = before;
    best_scale = scale_;
    set_scale(growth * scale_);
    stalled = 0;
  }
  poses_ = best;
  scale_ = best_scale;
  contacts_.age = 0;
  velocity_.assign(poses_.size(), Vec3::Zero());
}

bool Relaxer::Separate(int steps, std::int64_t most_work) {
  const std::int64_t end = spent_.work + most_work;
  velocity_.assign(poses_.size(), Vec3::Zero());
  contacts_.age = 0;
  for (int i = 0; i < steps && spent_.work < end && !execution_.IsCancelled(); ++i) {
    const std::vector<Pose> before = poses_;
    if (Step() > options_.tolerance) continue;
    poses_ = before;
    return true;
  }
  return false;
}

}  // namespace planish
