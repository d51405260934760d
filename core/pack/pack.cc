#include "core/pack/pack.h"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <optional>

#include "core/pack/outline.h"
#include "core/pack/shelves.h"
#include "core/pack/tighten.h"
#include "core/pack/trial.h"

namespace planish {
namespace {

// Between charts beside the padding, so that rounding UV to float (in [0, 10]) keeps it.
constexpr double kGap = 4e-6;
constexpr int kTilesInRow = 10;
constexpr double kHuge = 1e300;
// What tightening may cost, in moves of a chart.
constexpr std::int64_t kMoves = 3300, kMovesPerChart = 4;
// Growth that tightening tries first: of the large charts, and again with the small ones between them.
constexpr double kFirstStep = 0.03, kNextStep = 0.015;
// From so many faces on kMoves grows with them, as the work of a solve does, up to kMostShare times.
constexpr double kFaces = 20'000, kMostShare = 20;
constexpr double kFewCharts = 12, kManyCharts = 250;  // fewer and more get a smaller share of kMoves
constexpr std::size_t kMostToMove = 1500;
// Of the area, that small charts may have.
constexpr double kSmallShare = 0.1;
// From so many on, in a hurry, they go on shelves.
constexpr std::size_t kManyInAHurry = 300;
// For a small chart that fills a gap.
constexpr double kSnugEnough = 0.5;

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
      const Box box = BoxAt(outlines_[i], outlines_[i].upright);
      const Vec2 extent = box.high - box.low;
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

  // Beyond which the area, or some chart, is too large for the tiles. 1 if all charts are points.
  double LargestScale() const {
    double largest = total_area_ > 0 ? std::sqrt(options_.tiles / total_area_) : kHuge;
    for (std::size_t i = 0; i < charts_.size(); ++i) {
      if (outlines_[i].radius > 0) largest = std::min(largest, 1.5 / (outlines_[i].radius * charts_[i].density));
    }
    return largest < kHuge ? largest : 1;
  }

  // The scale at which the charts with half of the padding round them would fill `fill` of the tiles.
  double ScaleForFill(double fill) const {
    double low = 0, high = LargestScale();
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
    padding_ = padding;
    margin_ = std::ceil(padding / 2) * texel - distance / 2 + kGap;
    grid_.tiles = options_.tiles;
    grid_.radius = distance / 2;
    SetGrid(order_.size());
    if (charts_.size() == 1 && outlines_[0].radius > 0) {
      FitOne();
      return true;
    }
    // Charts of a texel each; without the padding, anything is better than nothing.
    const double least =
        any_scale || total_area_ == 0 ? 1e-9 * LargestScale() : texel * std::sqrt(charts_.size() / total_area_);
    if (!HasNoTime() && SearchPlaces(least)) return true;
    return HasNoTime() && FitOnShelves(least);
  }

  bool HasNoTime() const { return order_.size() > kManyInAHurry && execution_.IsHurried(); }

  bool SearchPlaces(double least) {
    const double first = ScaleForFill(order_.size() > 300 ? 0.78 : 0.85);
    Split(first);
    SetGrid(large_.size());
    poses_.resize(charts_.size());
    TrialPlan plan;
    plan.order = large_;
    plan.angles = large_.size() <= 200 ? 16 : large_.size() <= 1000 ? 8 : 4;
    plan.hurried = large_.size() > 300 || execution_.IsHurried();
    plan.gives_up = order_.size() > kManyInAHurry;
    if (plan.hurried) plan.enough = kSnugEnough;
    const auto try_scales = [&](double most) {
      for (scale_ = most; scale_ > least && !execution_.IsStopped() && !HasNoTime(); scale_ /= 1.04) {
        if (TryToPlace(outlines_, Scales(scale_), grid_, plan, execution_, &poses_)) return true;
      }
      return false;
    };
    if (!try_scales(first)) return false;
    TightenCharts(large_, Moves(kMoves, large_), kFirstStep);
    if (small_.empty()) return true;
    SetGrid(2 * order_.size());
    if (!AddSmallCharts()) {
      plan.order = order_;
      if (!try_scales(scale_)) return false;
    }
    TightenCharts(order_, Moves(kMoves / 2, order_), kNextStep);
    return true;
  }

  // Each in a box of its own.
  bool FitOnShelves(double least) {
    std::vector<Box> boxes;
    for (const Outline& outline : outlines_) boxes.push_back(BoxAt(outline, outline.upright));
    std::vector<Vec2> extents(charts_.size());
    for (scale_ = LargestScale(); scale_ > least && !execution_.IsStopped(); scale_ /= 1.03) {
      const std::vector<double> scales = Scales(scale_);
      for (std::size_t i = 0; i < charts_.size(); ++i) {
        extents[i] = scales[i] * (boxes[i].high - boxes[i].low) + Vec2::Constant(2 * grid_.radius);
      }
      const std::vector<Shelf> shelves = LayOnShelves(extents, 1 - 2 * margin_, grid_.tiles);
      if (shelves.empty()) continue;
      poses_.resize(charts_.size());
      for (std::size_t i = 0; i < charts_.size(); ++i) {
        const Vec2 centre = shelves[i].low + Vec2::Constant(grid_.radius) - scales[i] * boxes[i].low;
        poses_[i] = {outlines_[i].upright, centre / grid_.cell, shelves[i].tile};
      }
      return true;
    }
    return false;
  }

  std::int64_t Moves(std::int64_t base, const std::vector<std::int32_t>& charts) const {
    if (charts.size() > kMostToMove) return 0;
    const auto n = static_cast<double>(charts.size());
    const double share = std::min({1.0, n / kFewCharts, kManyCharts / n});
    return std::llround(options_.effort * (share * FacesShare() * static_cast<double>(base) +
                                           static_cast<double>(kMovesPerChart * std::ssize(charts))));
  }

  double FacesShare() const {
    std::size_t faces = 0;
    for (const PackChart& chart : charts_) faces += chart.faces.size();
    return std::clamp(static_cast<double>(faces) / kFaces, 1.0, kMostShare);
  }

  // A single chart: as large as it gets.
  void FitOne() {
    const double angle = AngleOfSmallestSquare(outlines_[0]);
    const Box box = BoxAt(outlines_[0], angle);
    const double low = margin_ + grid_.radius;
    scale_ = (1 - 2 * low) / ((box.high - box.low).maxCoeff() * charts_[0].density);
    poses_ = {{angle, (Vec2::Constant(grid_.radius) - scale_ * charts_[0].density * box.low) / grid_.cell, 0}};
  }

  void SetGrid(std::size_t n) {
    const double cell = grid_.cell;
    grid_.side = std::clamp(static_cast<int>((n > 300 ? 18 : 24) * std::sqrt(1.0 * n)), 192, 1024);
    grid_.cell = (1 - 2 * margin_) / grid_.side;
    for (Pose& pose : poses_) pose.centre *= cell / grid_.cell;
  }

  // Charts that will fit into the gaps between the others wait until those have their places.
  void Split(double scale) {
    const std::vector<double> scales = Scales(scale);
    std::vector<double> area(charts_.size());
    double sum = 0, squares = 0;
    for (std::size_t i = 0; i < charts_.size(); ++i) {
      const double radius = outlines_[i].radius * scales[i] + grid_.radius;
      area[i] = outlines_[i].area * scales[i] * scales[i] + 2 * grid_.radius * radius;
      sum += area[i];
      squares += area[i] * area[i];
    }
    large_.clear();
    small_.clear();
    double left = kSmallShare * sum;
    for (auto i = order_.rbegin(); i != order_.rend(); ++i) {
      left -= area[*i];
      (left > 0 && large_.empty() && area[*i] < 0.1 * squares / sum ? small_ : large_).push_back(*i);
    }
    std::reverse(large_.begin(), large_.end());
    std::reverse(small_.begin(), small_.end());
  }

  bool AddSmallCharts() {
    TrialPlan plan;
    plan.order = small_;
    plan.fixed = large_;
    plan.angles = 8;
    plan.enough = kSnugEnough;
    plan.hurried = small_.size() > 300 || execution_.IsHurried();
    plan.gives_up = order_.size() > kManyInAHurry;
    for (int attempt = 0; attempt < 20 && !execution_.IsStopped() && !HasNoTime(); ++attempt) {
      if (TryToPlace(outlines_, Scales(scale_), grid_, plan, execution_, &poses_)) return true;
      ForLayout(large_, [&](const auto& outlines, const auto& relative, TightenOptions options, Layout* layout) {
        Loosen(outlines, relative, options, 0.99, execution_, layout);
      });
    }
    return false;
  }

  void TightenCharts(const std::vector<std::int32_t>& charts, std::int64_t moves, double first_step) {
    const bool points = std::all_of(outlines_.begin(), outlines_.end(), [](const Outline& o) { return o.radius == 0; });
    if (points) return;  // of any scale
    if (HasNoTime()) return;
    ForLayout(charts, [&](const auto& outlines, const auto& relative, TightenOptions options, Layout* layout) {
      options.moves = moves;
      options.first_step = first_step;
      Tighten(outlines, relative, options, execution_, layout);
    });
  }

  // Hands some of the charts over to change(outlines, relative scales, options, &layout) and takes what came out.
  template <typename Change>
  void ForLayout(const std::vector<std::int32_t>& charts, const Change& change) {
    TightenOptions options;
    options.distance = 2 * grid_.radius;
    options.low = margin_ + grid_.radius;
    options.tiles = grid_.tiles;
    const std::vector<double> scales = Scales(scale_);
    std::vector<double> relative;
    std::vector<Outline> outlines;
    Layout layout;
    layout.scale = scale_;
    for (const std::int32_t i : charts) {
      outlines.push_back(outlines_[i]);
      relative.push_back(scales[i] / scale_);
      layout.bodies.push_back(
          {Vec2::Constant(margin_) + grid_.cell * poses_[i].centre, poses_[i].angle, poses_[i].tile});
    }
    change(outlines, relative, options, &layout);
    scale_ = layout.scale;
    for (std::size_t k = 0; k < charts.size(); ++k) {
      const Body& body = layout.bodies[k];
      poses_[charts[k]] = {body.angle, (body.centre - Vec2::Constant(margin_)) / grid_.cell, body.tile};
    }
  }

  void Finish(Packing* packing) const {
    const std::vector<double> scales = Scales(scale_);
    packing->scale = scale_;
    packing->padding = padding_;
    double area = 0;
    for (std::size_t i = 0; i < charts_.size(); ++i) {
      ChartPlacement& chart = packing->charts[i];
      chart.angle = poses_[i].angle;
      chart.scale = scales[i];
      chart.tile = poses_[i].tile;
      const Vec2 corner(chart.tile % kTilesInRow + margin_, chart.tile / kTilesInRow + margin_);
      chart.offset = Vec2::Zero();
      chart.offset = corner + grid_.cell * poses_[i].centre - chart(outlines_[i].centre);
      packing->tiles = std::max(packing->tiles, chart.tile + 1);
      area += outlines_[i].area * scales[i] * scales[i];
    }
    packing->efficiency = area / packing->tiles;
  }

  const std::vector<PackChart>& charts_;
  const PackOptions& options_;
  const Execution& execution_;
  std::vector<Outline> outlines_;
  std::vector<std::int32_t> order_;          // large to small
  std::vector<std::int32_t> large_, small_;  // its two parts
  double total_area_ = 0;
  TrialGrid grid_;
  double margin_ = 0;   // of the grid, on every side of the tile
  double padding_ = 0;  // texels
  std::vector<Pose> poses_;
  double scale_ = 0;
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
