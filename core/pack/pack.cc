#include "core/pack/pack.h"

#include <algorithm>
#include <cmath>
#include <memory>
#include <random>
#include <utility>

#include "core/base/radix_sort.h"
#include "core/pack/outline.h"
#include "core/pack/tighten.h"
#include "core/pack/trial.h"

namespace planish {
namespace {

// Between charts beside the padding, so that rounding UV to float (in [0, 10]) keeps it.
constexpr double kGap = 4e-6;
constexpr double kHuge = 1e300;
// Outlines of so many edges in the mean are not worth a second, simpler one.
constexpr std::size_t kFewEdges = 4;

std::vector<std::int32_t> LargestFirst(const std::vector<double>& size) {
  return SortedIndices(size.size(), [&](std::int32_t a, std::int32_t b) { return size[a] > size[b]; });
}

class Packer {
 public:
  Packer(std::vector<PackChart> charts, const PackOptions& options, const Execution& execution)
      : options_(options), tiles_{options.tiles, options.atlases}, tuning_(options.tuning), execution_(execution) {
    outlines_.reserve(charts.size());
    density_.reserve(charts.size());
    atlas_.reserve(charts.size());
    std::vector<double> areas(options.atlases, 0.0);
    for (PackChart& chart : charts) {
      outlines_.push_back(MakeOutline(chart));
      density_.push_back(chart.density);
      atlas_.push_back(chart.atlas);
      num_faces_ += static_cast<double>(chart.faces.size());
      const double area = outlines_.back().area * chart.density * chart.density;
      areas[chart.atlas] += area;
      total_area_ += area;
      chart = {};
    }
    largest_area_ = *std::max_element(areas.begin(), areas.end());
    budget_ = Budget();
    size_.resize(charts.size());
    for (std::size_t i = 0; i < charts.size(); ++i) {
      const Box box = BoxAt(outlines_[i], outlines_[i].upright);
      size_[i] = density_[i] * (box.high - box.low).sum();
    }
    order_ = LargestFirst(size_);
  }

  Packing Run() {
    Packing packing;
    packing.charts.resize(outlines_.size());
    if (outlines_.empty()) return packing;
    for (double padding = options_.padding;; padding = padding > 1 ? padding / 2 : 0) {
      if (Search(padding, padding == 0)) {
        Finish(&packing);
        return packing;
      }
      if (padding == 0 || execution_.IsCancelled()) return packing;
    }
  }

 private:
  double Budget() const {
    const auto charts = static_cast<double>(outlines_.size());
    const double growth = std::sqrt(std::sqrt(num_faces_ / tuning_.full_work_faces));
    const double counting = std::min(num_faces_, tuning_.full_work_faces * growth);
    const double faces = options_.effort == PackEffort::kBest ? num_faces_ : counting;
    const double rest = tuning_.rest_per_face * faces + tuning_.rest_per_chart * charts;
    const double share = ShareOfRest(options_.effort, tuning_) * rest;
    if (options_.effort != PackEffort::kNormal) return share;
    const double of_few = std::min(tuning_.least_per_few * charts, tuning_.least_work);
    return std::max({share, of_few, tuning_.least_per_chart * charts});
  }

  std::vector<double> Scales(double scale) const {
    std::vector<double> scales;
    for (std::size_t i = 0; i < outlines_.size(); ++i) {
      const double plain = scale * density_[i];
      const double least = std::min(1.0 / options_.texture_size, 0.25 / std::sqrt(1.0 * outlines_.size()));
      const double width = 2 * outlines_[i].radius;
      scales.push_back(width * plain < least && width > 0 ? least / width : plain);
    }
    return scales;
  }

  // Beyond which the area, or some chart, is too large for the tiles. 1 if all charts are points.
  double LargestScale() const {
    double largest = largest_area_ > 0 ? std::sqrt(options_.tiles / largest_area_) : kHuge;
    for (std::size_t i = 0; i < outlines_.size(); ++i) {
      if (outlines_[i].radius > 0) largest = std::min(largest, 1.5 / (outlines_[i].radius * density_[i]));
    }
    return largest < kHuge ? largest : 1;
  }

  // The scale at which the charts with half of the padding round them would fill `fill` of the tiles of some atlas.
  double ScaleForFill(double fill) const {
    double low = 0, high = LargestScale();
    const double radius = radius_ + grid_extent_ / grid_side_ / 2;
    for (int step = 0; step < 60; ++step) {
      const double middle = (low + high) / 2;
      const std::vector<double> scales = Scales(middle);
      std::vector<double> areas(options_.atlases, 0.0);
      for (std::size_t i = 0; i < outlines_.size(); ++i) {
        double perimeter = 0;
        const std::vector<Vec2>& hull = outlines_[i].hull;
        for (std::size_t k = 0; k < hull.size(); ++k) perimeter += (hull[(k + 1) % hull.size()] - hull[k]).norm();
        areas[atlas_[i]] +=
            outlines_[i].area * scales[i] * scales[i] + perimeter * scales[i] * radius + 3.14 * radius * radius;
      }
      const double area = *std::max_element(areas.begin(), areas.end());
      (area > fill * options_.tiles * grid_extent_ * grid_extent_ ? high : low) = middle;
    }
    return low;
  }

  bool Search(double padding, bool any_scale) {
    const double texel = 1.0 / options_.texture_size;
    const double distance = padding * texel + kGap;
    padding_ = padding;
    margin_ = std::ceil(padding / 2) * texel - distance / 2 + kGap;
    const double charts = static_cast<double>(MostCharts(atlas_, options_.atlases)) / options_.tiles;
    const int side = static_cast<int>(tuning_.cells_per_chart * std::sqrt(charts));
    grid_side_ = std::clamp(side, tuning_.fewest_cells, tuning_.most_cells) / kCoarsestCell * kCoarsestCell;
    grid_extent_ = 1 - 2 * margin_;
    radius_ = distance / 2;
    if (outlines_.size() == 1 && outlines_[0].radius > 0) {
      FitOne();
      return true;
    }
    // Charts of a texel each; without the padding, anything is better than nothing.
    const double least =
        any_scale || total_area_ == 0 ? 1e-9 * LargestScale() : texel * std::sqrt(outlines_.size() / total_area_);
    if (!HasNoTime() && SearchPlaces(least)) return true;
    return HasNoTime() && FitOnShelves(least);
  }

  bool HasNoTime() const { return order_.size() > tuning_.many_charts && execution_.IsStopRequested(); }

  const std::vector<Outline>& simple() const { return simple_.empty() ? outlines_ : simple_; }

  void Simplify() {
    const std::vector<double> scales = Scales(LargestScale());
    simple_.clear();
    std::size_t edges = 0;
    for (const Outline& outline : outlines_) edges += outline.edges.size();
    if (edges <= kFewEdges * outlines_.size()) return;
    simple_.reserve(outlines_.size());
    for (std::size_t i = 0; i < outlines_.size(); ++i) {
      simple_.push_back(Simplified(outlines_[i], tuning_.simple_within * grid_extent_ / grid_side_ / scales[i]));
    }
  }

  bool SearchPlaces(double least) {
    Simplify();
    if (!TryScales(least)) return false;
    if (HasNoTime()) return true;
    const double left = budget_ - static_cast<double>(work_done_);
    const bool tightens = left > tuning_.tighten_per_chart * static_cast<double>(outlines_.size());
    if (order_.size() >= tuning_.charts_for_orders &&
        left > tuning_.fewest_orders * static_cast<double>(work_of_trial_)) {
      TryOrders(static_cast<double>(work_done_) + (tightens ? tuning_.orders_share : 1) * left);
    }
    series_.reset();
    if (tightens) TightenAll(std::llround(budget_ - static_cast<double>(work_done_)));
    return true;
  }

  // Trials at one scale after the other, each nearer to the largest scale at which all charts fit.
  bool TryScales(double least) {
    double per_turn = 0;
    for (const Outline& outline : simple()) {
      per_turn += tuning_.trial_work + tuning_.trial_work_per_edge * static_cast<double>(outline.edges.size());
    }
    plan_.order = order_;
    plan_.angles = tuning_.least_angles;
    while (plan_.angles < tuning_.most_angles && 2 * plan_.angles * tuning_.typical_trials * per_turn < budget_)
      plan_.angles *= 2;
    plan_.thorough = order_.size() <= tuning_.many_charts;
    const auto kept =
        static_cast<std::size_t>(std::clamp(num_faces_, tuning_.fewest_silhouettes, tuning_.most_silhouettes));
    series_ = MakeTrialSeries(simple(), atlas_, tiles_, kept);
    starts_.clear();
    double good = 0, bad = 0, expected = 0;  // scales at which all charts fit, and at which they do not
    std::vector<Pose> poses(outlines_.size());
    SetUnit(ScaleForFill(tuning_.first_fill));
    for (int trial = 1, side = grid_side_; ScaleOf(side) > least && !execution_.IsCancelled() && !HasNoTime();
         ++trial) {
      const double scale = ScaleOf(side);
      const TrialResult result = RunTrial(side, plan_, 0, &poses);
      work_of_trial_ = std::max(work_of_trial_, result.work);
      if (result.placed == order_.size()) {
        good = scale;
        // Charts would fill all rows at this scale.
        expected = scale / std::sqrt(result.filled);
        Keep(side, poses);
      } else {
        bad = scale;
      }
      if (good > 0 && (execution_.IsStopRequested() || (bad > 0 && bad < tuning_.known_within * good))) break;
      // A wide bracket is worth more than what comes after.
      const double share = bad > tuning_.wide_bracket * good ? 1 : 0.5;
      const bool is_dear =
          !plan_.thorough && static_cast<double>(work_done_) > budget_ && bad < tuning_.too_wide * good;
      const bool may_go_on = (trial < tuning_.least_trials && !is_dear) ||
                             (trial < tuning_.most_trials && static_cast<double>(work_done_) < share * budget_);
      if (good > 0 && !may_go_on) break;
      double next = 0;
      if (good > 0) {
        const double least_change = plan_.thorough ? tuning_.upwards : tuning_.known_within;
        next = std::clamp(expected, least_change * good, tuning_.farthest_change * good);
        if (bad > 0) next = std::min(next, std::sqrt(good * bad));
      } else {
        const double ratio = std::sqrt(AreaRatio(scale, result.placed));
        // Among many charts small ones do not find much room that large ones have left.
        next = scale /
               std::clamp(plan_.thorough ? std::sqrt(ratio) : ratio, tuning_.known_within, tuning_.farthest_change);
      }
      side = GridFor(next);
      if (plan_.thorough) continue;
      if (bad > 0) side = std::max(side, SideOf(bad) + 1);
      if (good > 0 && side >= SideOf(good)) {
        if (bad > 0 && SideOf(bad) + 1 >= SideOf(good)) break;  // there is nothing between
        side = SideOf(good) - 1;
      }
    }
    return good > 0;
  }

  // ---- Scales. A tile is a grid. Among many charts a cell has one size on the surface: at another scale the charts
  // keep their silhouettes, and the grid has another side. Few charts get new silhouettes for each scale, and the grid
  // keeps its side, a multiple of kCoarsestCell: on any other, large charts could not use the last cells.

  // The side of the grid for a trial at this scale.
  int GridFor(double scale) {
    const int side = SideOf(scale);
    if (!plan_.thorough && side <= 2 * grid_side_ && 2 * side >= grid_side_) return side;
    SetUnit(scale);
    return grid_side_;
  }
  // From now on a grid of the usual side is one at this scale.
  void SetUnit(double scale) {
    unit_ = scale * grid_side_ / grid_extent_;
    most_made_ = -1;
  }
  double ScaleOf(int side) const { return unit_ * grid_extent_ / side; }
  int SideOf(double scale) const { return static_cast<int>(std::lround(unit_ * grid_extent_ / scale)); }

  TrialResult RunTrial(int side, const TrialPlan& plan, double most_missing, std::vector<Pose>* poses) {
    if (side < least_made_ || side > most_made_) MakeFor(side);
    const TrialResult result = series_->Run(side, plan, most_missing, execution_, poses);
    work_done_ += result.work;
    return result;
  }

  // Silhouettes for a grid of this side and some smaller ones, on which the padding has fewer cells. Charts that are
  // drawn larger than others have silhouettes for one side only.
  void MakeFor(int side) {
    const double scale = ScaleOf(side), cells = side / grid_extent_;
    std::vector<double> scales = Scales(scale);
    bool all_alike = true;
    for (std::size_t i = 0; i < scales.size(); ++i) {
      all_alike = all_alike && scales[i] == scale * density_[i];
      scales[i] *= cells;
    }
    const double radius = radius_ * cells;
    const double smaller = all_alike ? std::min(tuning_.most_smaller, tuning_.wider_padding / radius) : 0;
    least_made_ = static_cast<int>(std::ceil((1 - smaller) * side));
    most_made_ = side;
    series_->Resize(std::move(scales), radius);
  }

  // What was found on a grid of this side is the best so far.
  void Keep(int side, const std::vector<Pose>& poses) {
    best_ = {poses, ScaleOf(side)};
    for (Pose& pose : best_.poses) pose.centre *= grid_extent_ / side;
  }

  // Trials with the charts in other orders, until so much work is done, each at a scale a little beyond that of the
  // best so far. Where the small charts go decides nothing as long as the large ones do not fit: those are tried
  // first, and all charts only once they do. An order is changed by one chart, and by the turn it must have, and stays
  // changed if no more of the area finds no place; after some changes in vain, another order is taken.
  void TryOrders(double until) {
    const auto n = static_cast<std::int32_t>(order_.size()), large = CountLarge();
    std::linear_congruential_engine<std::uint64_t, 6364136223846793005u, 1442695040888963407u, 0> knuth(1);
    const auto random = [&] { return static_cast<double>(knuth() >> 33) * 0x1p-31; };  // in [0, 1)
    std::vector<double> key(n);
    TrialPlan plan = plan_;
    plan.turn.assign(n, -1);
    std::vector<Pose> poses(n);
    double missing = kHuge;
    const auto next_side = [&] {
      const int next = GridFor(tuning_.order_step * best_.scale);
      return std::min(next, SideOf(best_.scale) - 1);
    };
    int side = next_side();
    int in_vain = 0;
    std::int32_t first_missing = 0;
    while (static_cast<double>(work_done_) < until && !execution_.IsCancelled() && !execution_.IsStopRequested()) {
      TrialPlan other = plan;
      if (in_vain >= tuning_.orders_in_vain) {
        for (const std::int32_t i : order_) key[i] = size_[i] * (1 + tuning_.order_spread * (random() - 0.5));
        other.order = LargestFirst(key);
        other.turn.assign(n, -1);
        missing = kHuge;
        in_vain = 0;
      } else if (missing < kHuge) {
        // The first charts matter most, and the first that found no place should come earlier.
        auto from = static_cast<std::int32_t>(large * random() * random());
        auto to = std::clamp(from + static_cast<std::int32_t>((random() - 0.5) * (6 + 0.3 * large)), 0, large - 1);
        if (random() < tuning_.missing_chance) {
          from = first_missing;
          to = static_cast<std::int32_t>(from * random());
        }
        const std::int32_t chart = other.order[from];
        if (random() < tuning_.turn_chance) {
          other.turn[chart] = other.turn[chart] < 0 ? static_cast<int>(random() * plan.angles) : -1;
        } else {
          other.order.erase(other.order.begin() + from);
          other.order.insert(other.order.begin() + to, chart);
        }
      }
      other.count = large;
      TrialResult result = RunTrial(side, other, missing, &poses);
      ++in_vain;
      if (result.missing > missing) continue;
      if (result.missing < missing) in_vain = 0;
      missing = result.missing;
      plan = other;
      if (missing == 0 && large < n) {
        other.count = n;
        result = RunTrial(side, other, 0, &poses);
      }
      first_missing = std::min(static_cast<std::int32_t>(result.placed), n - 1);
      if (result.missing > 0) continue;
      Remember();
      Keep(side, poses);
      side = next_side();
      missing = kHuge;
    }
  }

  // The charts at the head of order_ that have nearly all of the area.
  std::int32_t CountLarge() const {
    double area = 0;
    std::int32_t count = 0;
    while (count < std::ssize(order_) && area < tuning_.large_area * total_area_) {
      const std::int32_t i = order_[count++];
      area += outlines_[i].area * density_[i] * density_[i];
    }
    return std::max(count, 1);
  }

  // Keeps what was found so far as a place to tighten from.
  void Remember() {
    starts_.push_back(best_);
    if (starts_.size() > static_cast<std::size_t>(tuning_.starts)) starts_.erase(starts_.begin());
  }

  // The area of all charts with half of the padding round them over that of the first `count`, about.
  double AreaRatio(double scale, std::size_t count) const {
    const std::vector<double> scales = Scales(scale);
    double placed = 0, all = 0;
    for (std::size_t k = 0; k < order_.size(); ++k) {
      const Outline& outline = outlines_[order_[k]];
      const double unit = scales[order_[k]], radius = outline.radius * unit + radius_;
      const double area = outline.area * unit * unit + 4 * radius_ * radius;
      all += area;
      if (k < count) placed += area;
    }
    return placed > 0 ? all / placed : kHuge;
  }

  // Each in a box of its own.
  bool FitOnShelves(double least) {
    std::vector<Box> boxes;
    for (const Outline& outline : outlines_) boxes.push_back(BoxAt(outline, outline.upright));
    std::vector<Vec2> extents(outlines_.size());
    for (best_.scale = LargestScale(); best_.scale > least && !execution_.IsCancelled(); best_.scale /= 1.03) {
      const std::vector<double> scales = Scales(best_.scale);
      for (std::size_t i = 0; i < outlines_.size(); ++i) {
        extents[i] = scales[i] * (boxes[i].high - boxes[i].low) + Vec2::Constant(2 * radius_);
      }
      const std::vector<Shelf> shelves = LayOnShelves(extents, atlas_, tiles_, grid_extent_);
      if (shelves.empty()) continue;
      best_.poses.resize(outlines_.size());
      for (std::size_t i = 0; i < outlines_.size(); ++i) {
        const Vec2 centre = shelves[i].low + Vec2::Constant(radius_) - scales[i] * boxes[i].low;
        best_.poses[i] = {centre, outlines_[i].upright, shelves[i].tile};
      }
      return true;
    }
    return false;
  }

  // A single chart: as large as it gets.
  void FitOne() {
    const double angle = AngleOfSmallestSquare(outlines_[0]);
    const Box box = BoxAt(outlines_[0], angle);
    const double low = margin_ + radius_;
    best_.scale = (1 - 2 * low) / ((box.high - box.low).maxCoeff() * density_[0]);
    best_.poses = {{Vec2::Constant(radius_) - best_.scale * density_[0] * box.low, angle, atlas_[0] * options_.tiles}};
  }

  void TightenAll(std::int64_t work) {
    const bool points = std::all_of(outlines_.begin(), outlines_.end(), [](const Outline& o) { return o.radius == 0; });
    if (points) return;  // points are of any scale
    TightenOptions options;
    options.distance = 2 * radius_;
    options.low = margin_ + radius_;
    options.tiles = options_.tiles;
    options.atlases = options_.atlases;
    options.work = work;
    options.tuning = tuning_;
    std::vector<double> relative = Scales(best_.scale);
    for (double& r : relative) r /= best_.scale;
    Remember();
    const Vec2 corner = Vec2::Constant(margin_);  // of the grid, in its tile
    for (Arrangement& start : starts_) {
      for (Pose& pose : start.poses) pose.centre += corner;
    }
    best_ = Tighten({outlines_, simple(), atlas_, relative}, options, execution_, starts_);
    for (Pose& pose : best_.poses) pose.centre -= corner;
  }

  void Finish(Packing* packing) const {
    const std::vector<double> scales = Scales(best_.scale);
    packing->scale = best_.scale;
    packing->padding = padding_;
    double area = 0;
    for (std::size_t i = 0; i < outlines_.size(); ++i) {
      const auto& [centre, angle, tile] = best_.poses[i];
      ChartPlacement& chart = packing->charts[i] = {angle, scales[i], Vec2::Zero(), tile};
      const Vec2 corner = CornerOfTile(tile) + Vec2::Constant(margin_);
      chart.offset = corner + centre - chart(outlines_[i].centre);
      packing->tiles = std::max(packing->tiles, tile + 1);
      area += outlines_[i].area * scales[i] * scales[i];
    }
    packing->efficiency = area / packing->tiles;
  }

  const PackOptions& options_;
  const TrialTiles tiles_;
  const PackTuning& tuning_;
  const Execution& execution_;
  std::vector<Outline> outlines_;
  std::vector<Outline> simple_;         // with fewer edges; empty where they have few anyway
  std::vector<double> density_, size_;  // of each chart
  std::vector<std::int32_t> order_;     // large to small
  std::vector<int> atlas_;              // of each chart
  double num_faces_ = 0;
  double total_area_ = 0, largest_area_ = 0;  // of all charts, of those of one atlas
  int grid_side_ = 256;                       // cells, usually
  double grid_extent_ = 1;                    // in the texture
  double radius_ = 0;                         // half of the padding, in the texture
  double unit_ = 1;                           // cells along a length of 1 on the surface, at weight 1
  double margin_ = 0;                         // of the grid, on every side of the tile
  double padding_ = 0;                        // texels
  Arrangement best_ = {{}, 0};                // poses are from the corner of the grid, in the texture
  // In nanoseconds.
  double budget_ = 0;
  std::int64_t work_done_ = 0;
  std::int64_t work_of_trial_ = 0;       // of the dearest one: those that end where a chart has no room take less
  int least_made_ = 0, most_made_ = -1;  // sides of the grids that the silhouettes are for
  TrialPlan plan_;
  std::unique_ptr<TrialSeries> series_;
  std::vector<Arrangement> starts_;  // the last few that fitted, each at a larger scale
};

}  // namespace

Vec2 ChartPlacement::operator()(const Vec2& p) const {
  return scale * Rotation(angle)(p) + offset;
}

double ShareOfRest(PackEffort effort, const PackTuning& tuning) {
  if (effort == PackEffort::kFast) return tuning.fast_share;
  return effort == PackEffort::kNormal ? tuning.normal_share : tuning.best_share;
}

Vec2 CornerOfTile(int tile) {
  return {tile % PackOptions::kTilesInRow, tile / PackOptions::kTilesInRow};
}

Packing Pack(std::vector<PackChart> charts, const PackOptions& options, const Execution& execution) {
  return Packer(std::move(charts), options, execution).Run();
}

}  // namespace planish
