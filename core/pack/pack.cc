#include "core/pack/pack.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <numeric>
#include <optional>

#include "core/pack/clearance.h"
#include "core/pack/outline.h"
#include "core/pack/rearrange.h"
#include "core/pack/relax.h"
#include "core/pack/trial.h"

namespace planish {
namespace {

// Between charts beside the padding, so that rounding UV to float (in [0, 10]) keeps it.
constexpr double kGap = 4e-6;
constexpr int kTilesInRow = 10;

class Packer {
 public:
  Packer(const std::vector<PackChart>& charts, const PackOptions& options, const Execution& execution)
      : charts_(charts), options_(options), execution_(execution) {
    for (const PackChart& chart : charts) outlines_.push_back(MakeOutline(chart));
    for (std::size_t i = 0; i < charts.size(); ++i) {
      const double density = charts[i].density;
      total_area_ += outlines_[i].area * density * density;
    }
    order_.resize(charts.size());
    std::iota(order_.begin(), order_.end(), 0);
    std::vector<double> size(charts.size());
    for (std::size_t i = 0; i < charts.size(); ++i) {
      const Vec2 extent = ExtentAt(outlines_[i], outlines_[i].upright);
      size[i] = charts[i].density * (extent.x() + extent.y());
    }
    std::sort(order_.begin(), order_.end(),
              [&](std::int32_t a, std::int32_t b) { return size[a] != size[b] ? size[a] > size[b] : a < b; });
  }

  Packing Run() {
    Packing packing;
    packing.charts.resize(charts_.size());
    if (charts_.empty()) return packing;
    for (double padding = options_.padding;; padding = padding > 1 ? padding / 2 : 0) {
      if (Search(padding, padding == 0)) {
        Improve();
        Finish(&packing);
        return packing;
      }
      if (padding == 0 || execution_.IsStopped()) return packing;
    }
  }

 private:
  std::vector<double> Scales(double scale) const {
    std::vector<double> scales;
    for (std::size_t i = 0; i < charts_.size(); ++i) {
      const double plain = scale * charts_[i].density;
      const double least = std::min(1.0 / options_.texture_size, 0.25 / std::sqrt(1.0 * charts_.size()));
      const double width = 2 * outlines_[i].radius;
      scales.push_back(width * plain < least && width > 0 ? least / width : plain);
    }
    return scales;
  }

  // The scale at which the charts with half of the padding round them would fill `fill` of the tiles.
  double ScaleForFill(double fill) const {
    double low = 0, high = std::sqrt(options_.tiles / std::max(total_area_, 1e-300));
    const double radius = grid_.radius + grid_.cell / 2;
    for (int step = 0; step < 60; ++step) {
      const double middle = (low + high) / 2;
      const std::vector<double> scales = Scales(middle);
      double area = 0;
      for (std::size_t i = 0; i < charts_.size(); ++i) {
        double perimeter = 0;
        const std::vector<Vec2>& hull = outlines_[i].hull;
        for (std::size_t k = 0; k < hull.size(); ++k) perimeter += (hull[(k + 1) % hull.size()] - hull[k]).norm();
        area += outlines_[i].area * scales[i] * scales[i] + perimeter * scales[i] * radius + 3.14 * radius * radius;
      }
      (area > fill * options_.tiles * grid_.cell * grid_.cell * grid_.side * grid_.side ? high : low) = middle;
    }
    return low;
  }

  bool Search(double padding, bool any_scale) {
    const double texel = 1.0 / options_.texture_size;
    const double distance = padding * texel + kGap;
    margin_ = std::ceil(padding / 2) * texel - distance / 2 + kGap;
    grid_.side = std::clamp(static_cast<int>(24 * std::sqrt(1.0 * charts_.size())), 192, 1024);
    grid_.tiles = options_.tiles;
    grid_.cell = (1 - 2 * margin_) / grid_.side;
    grid_.radius = distance / 2;
    padding_ = padding;
    TrialPlan plan;
    plan.order = order_;
    plan.angles = charts_.size() <= 40 ? 32 : charts_.size() <= 200 ? 16 : 8;
    const auto attempt = [&](double scale) {
      auto poses = TryToPlace(outlines_, Scales(scale), grid_, plan, execution_);
      if (!poses) return false;
      best_ = std::move(*poses);
      best_scale_ = scale;
      return true;
    };
    double low = 0, high = 0;
    double scale = ScaleForFill(0.85);
    const double least = any_scale ? 0 : texel * std::sqrt(charts_.size() / std::max(total_area_, 1e-300));
    for (double step = 1.03;;) {
      if (execution_.IsStopped()) return false;
      if (attempt(scale)) {
        low = scale;
        if (high > 0) break;
        scale *= step;
      } else {
        high = scale;
        if (low > 0) break;
        if (scale < least || scale < 1e-12) return false;
        scale /= step;
      }
      step *= step;
    }
    while (high > 1.004 * low) {
      if (execution_.IsStopped()) return false;
      const double middle = std::sqrt(low * high);
      (attempt(middle) ? low : high) = middle;
    }
    return true;
  }

  void Improve() {
    RelaxOptions options;
    options.distance = 2 * grid_.radius;
    options.low = margin_ + grid_.radius;
    const double width = 1 / std::sqrt(1.0 * charts_.size());
    options.spacing = std::clamp(width / 40, 1.0 / 1024, 1.0 / 300);
    options.tolerance = 0.0015 * width;
    std::vector<double> relative = Scales(best_scale_);
    for (double& r : relative) r /= best_scale_;
    std::vector<DistanceField> fields;
    for (std::size_t i = 0; i < charts_.size(); ++i) {
      const double unit = relative[i] * best_scale_;
      const double spacing = std::max(std::min(options.spacing, outlines_[i].radius * unit / 6), 1e-7);
      fields.emplace_back(outlines_[i], spacing / unit, (options.distance + 2 * options.spacing) / unit * 1.1);
    }
    Relaxer relaxer(outlines_, fields, relative, best_scale_, options, execution_);
    std::vector<Body> bodies(charts_.size());
    for (std::size_t i = 0; i < charts_.size(); ++i) {
      bodies[i] = {Vec2::Constant(margin_) + grid_.cell * best_[i].centre, best_[i].angle, best_[i].tile};
    }
    relaxer.bodies() = bodies;
    auto now = [] { return std::chrono::duration<double>(std::chrono::steady_clock::now().time_since_epoch()).count(); };
    double t0 = now();
    relaxer.Grow(30);
    if (getenv("PACK_DEBUG")) fprintf(stderr, "raster %.4f grown %.4f %.3f s\n", best_scale_*best_scale_*total_area_, relaxer.scale()*relaxer.scale()*total_area_, now()-t0);
    double scale = relaxer.scale();
    bodies = relaxer.bodies();
    auto E = [](const char* n, double d) { return getenv(n) ? atof(getenv(n)) : d; };
    const double n = charts_.size();
    const std::int64_t budget = E("BUDGET", 6000 + 30 * n);
    const std::int64_t at_once = E("ATONCE", 600 + 8 * n);
    std::int64_t used = 0;
    double step = E("STEP", 0.025);
    double t_re = 0, t_sep = 0;
    int fails = 0;
    for (int round = 0; used < budget && round < 100; ++round) {
      RearrangeOptions rearrange;
      rearrange.side = static_cast<int>(std::clamp(E("SIDE", 26) * std::sqrt(1.0 * charts_.size()), 112.0, 512.0));
      rearrange.tiles = grid_.tiles;
      rearrange.distance = options.distance;
      rearrange.low = options.low;
      rearrange.angles = E("ANGLES", 16);
      rearrange.tries = E("TRIES", 100);
      rearrange.moves = std::min(at_once, budget - used);
      rearrange.seed = round;
      std::vector<double> scales = relative;
      for (double& s : scales) s *= scale * (1 + step);
      std::vector<Body> moved = bodies;
      t0 = now();
      std::int64_t moves = 0;
      const bool apart = Rearrange(outlines_, fields, scales, rearrange, execution_, &moved, &moves);
      used += moves + charts_.size() / 4;
      double t1 = now();
      bool sep = false;
      double target = scale * (1 + step);
      if (apart) {
        relaxer.bodies() = moved;
        relaxer.set_scale(target);
        sep = relaxer.Separate(E("SEP", 80));
        if (sep) {
          relaxer.Grow(E("GROW", 20));
          scale = relaxer.scale();
          bodies = relaxer.bodies();
        }
      }
      double t2 = now();
      t_re += t1 - t0; t_sep += t2 - t1;
      if (getenv("PACK_DEBUG")) fprintf(stderr, "round %d target %.4f apart %d (%ld moves %.3f s) separated %d (%.3f s) -> %.4f\n", round, target*target*total_area_, apart, moves, t1-t0, sep, t2-t1, scale*scale*total_area_);
      if (sep) fails = 0;
      else {
        ++fails;
        step = std::max(E("MINSTEP", 0.003), step * 0.6);
      }
    }
    if (getenv("PACK_DEBUG")) fprintf(stderr, "rearrange %.3f separate %.3f s, used %ld\n", t_re, t_sep, used);
    relaxer.bodies() = bodies;
    relaxer.set_scale(scale);
    std::fill(relaxer.margins().begin(), relaxer.margins().end(), options.tolerance / 2);
    for (int round = 0; round < 40 && relaxer.scale() > best_scale_; ++round) {
      if (!relaxer.Separate(60)) {
        relaxer.set_scale(relaxer.scale() * 0.998);
        continue;
      }
      std::vector<double> scales = relative;
      for (double& s : scales) s *= relaxer.scale();
      const auto near = FindTooNear(outlines_, scales, relaxer.bodies(), options.distance, options.low, execution_);
    if (getenv("PACK_DEBUG")) fprintf(stderr, "round %d near %zu scale %.4f\n", round, near.size(), relaxer.scale()*relaxer.scale()*total_area_);
      if (near.empty()) {
        best_scale_ = relaxer.scale();
        for (std::size_t i = 0; i < charts_.size(); ++i) {
          const Body& body = relaxer.bodies()[i];
          best_[i] = {body.angle, (body.centre - Vec2::Constant(margin_)) / grid_.cell, body.tile};
        }
        return;
      }
      std::vector<double> more(charts_.size(), 0);
      for (const TooNear& pair : near) {
        more[pair.a] = std::max(more[pair.a], 0.6 * pair.missing);
        if (pair.b >= 0) more[pair.b] = std::max(more[pair.b], 0.6 * pair.missing);
      }
      for (std::size_t i = 0; i < charts_.size(); ++i) relaxer.margins()[i] += std::min(more[i], options.tolerance);
    }
  }

  void Finish(Packing* packing) const {
    const std::vector<double> scales = Scales(best_scale_);
    packing->scale = best_scale_;
    packing->padding = padding_;
    double area = 0;
    for (std::size_t i = 0; i < charts_.size(); ++i) {
      ChartPlacement& chart = packing->charts[i];
      chart.angle = best_[i].angle;
      chart.scale = scales[i];
      chart.tile = best_[i].tile;
      const Vec2 corner(chart.tile % kTilesInRow + margin_, chart.tile / kTilesInRow + margin_);
      chart.offset = Vec2::Zero();
      chart.offset = corner + grid_.cell * best_[i].centre - chart(outlines_[i].centre);
      packing->tiles = std::max(packing->tiles, chart.tile + 1);
      area += outlines_[i].area * scales[i] * scales[i];
    }
    packing->efficiency = area / packing->tiles;
  }

  const std::vector<PackChart>& charts_;
  const PackOptions& options_;
  const Execution& execution_;
  std::vector<Outline> outlines_;
  std::vector<std::int32_t> order_;  // large to small
  double total_area_ = 0;
  TrialGrid grid_;
  double margin_ = 0;   // of the grid, on every side of the tile
  double padding_ = 0;  // texels
  std::vector<Pose> best_;
  double best_scale_ = 0;
};

}  // namespace

Vec2 ChartPlacement::operator()(const Vec2& p) const {
  const double c = std::cos(angle), s = std::sin(angle);
  return scale * Vec2(c * p.x() - s * p.y(), s * p.x() + c * p.y()) + offset;
}

Packing Pack(const std::vector<PackChart>& charts, const PackOptions& options, const Execution& execution) {
  return Packer(charts, options, execution).Run();
}

}  // namespace planish
