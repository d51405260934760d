#include "core/pack/pack.h"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <optional>

#include "core/pack/outline.h"
#include "core/pack/tighten.h"
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
    plan.angles = charts_.size() <= 200 ? 16 : 8;
    const auto attempt = [&](double scale) {
      auto poses = TryToPlace(outlines_, Scales(scale), grid_, plan, execution_);
      if (!poses) return false;
      best_ = std::move(*poses);
      best_scale_ = scale;
      return true;
    };
    const double least = any_scale ? 1e-12 : texel * std::sqrt(charts_.size() / std::max(total_area_, 1e-300));
    for (double scale = ScaleForFill(0.85); scale > least; scale /= 1.04) {
      if (execution_.IsStopped()) return false;
      if (attempt(scale)) return true;
    }
    return false;
  }

  void Improve() {
    TightenOptions options;
    options.distance = 2 * grid_.radius;
    options.low = margin_ + grid_.radius;
    options.tiles = grid_.tiles;
    std::vector<double> relative = Scales(best_scale_);
    for (double& r : relative) r /= best_scale_;
    Layout layout;
    layout.scale = best_scale_;
    for (const Pose& pose : best_) {
      layout.bodies.push_back({Vec2::Constant(margin_) + grid_.cell * pose.centre, pose.angle, pose.tile});
    }
    Tighten(outlines_, relative, options, execution_, &layout);
    best_scale_ = layout.scale;
    for (std::size_t i = 0; i < best_.size(); ++i) {
      const Body& body = layout.bodies[i];
      best_[i] = {body.angle, (body.centre - Vec2::Constant(margin_)) / grid_.cell, body.tile};
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
