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

// Added to the padding, so that rounding UV to float (in [0, 10]) keeps the padding even if both charts were moved by
// kFreeMove.
constexpr double kGap = 4e-6;
constexpr double kHuge = 1e300;
// Outlines with at most this many edges on average are not simplified.
constexpr std::size_t kFewEdges = 4;

std::vector<std::int32_t> LargestFirst(const std::vector<double>& size) {
  return SortedIndices(size.size(), [&](std::int32_t a, std::int32_t b) { return size[a] > size[b]; });
}

class Packer {
 public:
  Packer(std::size_t count, const std::function<PackChart(std::size_t)>& make_chart, const PackOptions& options,
         const Execution& execution)
      : options_(options), tiles_{options.tiles, options.atlases}, tuning_(options.tuning), execution_(execution) {
    charts_.outlines.reserve(count);
    charts_.density.reserve(count);
    charts_.atlas.reserve(count);
    std::vector<double> areas(options.atlases, 0.0);
    for (std::size_t i = 0; i < count; ++i) {
      const PackChart chart = make_chart(i);
      charts_.outlines.push_back(MakeOutline(chart));
      charts_.density.push_back(chart.density);
      charts_.atlas.push_back(chart.atlas);
      charts_.num_faces += static_cast<double>(chart.faces.size());
      const double area = charts_.outlines.back().area * chart.density * chart.density;
      areas[chart.atlas] += area;
      charts_.total_area += area;
    }
    charts_.largest_area = *std::max_element(areas.begin(), areas.end());
    work_.budget = Budget();
    charts_.size.resize(count);
    for (std::size_t i = 0; i < count; ++i) {
      const Box box = BoxAt(charts_.outlines[i], charts_.outlines[i].upright);
      charts_.size[i] = charts_.density[i] * (box.high - box.low).sum();
    }
    charts_.order = LargestFirst(charts_.size);
  }

  Packing Run() {
    if (charts_.outlines.empty()) return {};
    for (double padding = options_.padding;; padding = padding > 1 ? padding / 2 : 0) {
      const bool found = Search(padding, padding == 0);
      if (!found && padding > 0 && !execution_.IsCancelled()) continue;
      Packing packing;
      packing.charts.resize(charts_.outlines.size());
      if (found) Finish(&packing);
      return packing;
    }
  }

 private:
  double Budget() const {
    const auto charts = static_cast<double>(charts_.outlines.size());
    const double growth = std::sqrt(std::sqrt(charts_.num_faces / tuning_.full_work_faces));
    const double counting = std::min(charts_.num_faces, tuning_.full_work_faces * growth);
    const double faces = options_.effort == PackEffort::kBest ? charts_.num_faces : counting;
    const double rest = tuning_.rest_per_face * faces + tuning_.rest_per_chart * charts;
    const double share = ShareOfRest(options_.effort, tuning_) * rest;
    if (options_.effort == PackEffort::kFast) return share;
    if (options_.effort == PackEffort::kBest) {
      return std::max(share, std::min(tuning_.best_per_few * charts, tuning_.least_best_work));
    }
    const double of_few = std::min(tuning_.least_per_few * charts, tuning_.least_work);
    const double of_charts = std::min(tuning_.normal_per_chart * std::min(charts, tuning_.most_charts_to_count),
                                      tuning_.charts_share * rest);
    return std::max({share + of_charts, of_few, tuning_.least_per_chart * charts});
  }

  std::vector<double> Scales(double scale) const {
    std::vector<double> scales;
    for (std::size_t i = 0; i < charts_.outlines.size(); ++i) {
      scales.push_back(
          DrawnScale(charts_.outlines[i].radius, charts_.density[i], scale, charts_.outlines.size(), options_));
    }
    return scales;
  }

  // An upper bound of the scale: beyond it the area or some chart is too large for the tiles. 1 if all charts are
  // points.
  double LargestScale() const {
    double largest = charts_.largest_area > 0 ? std::sqrt(options_.tiles / charts_.largest_area) : kHuge;
    for (std::size_t i = 0; i < charts_.outlines.size(); ++i) {
      if (charts_.outlines[i].radius > 0)
        largest = std::min(largest, 1.5 / (charts_.outlines[i].radius * charts_.density[i]));
    }
    return largest < kHuge ? largest : 1;
  }

  // The scale at which the charts, with half of the padding round each, would fill the share `fill` of the tiles of the
  // fullest atlas.
  double ScaleForFill(double fill) const {
    double low = 0, high = LargestScale();
    const double radius = grid_.radius + grid_.extent / grid_.side / 2;
    for (int step = 0; step < 60; ++step) {
      const double middle = (low + high) / 2;
      const std::vector<double> scales = Scales(middle);
      std::vector<double> areas(options_.atlases, 0.0);
      for (std::size_t i = 0; i < charts_.outlines.size(); ++i) {
        double perimeter = 0;
        const std::vector<Vec2>& hull = charts_.outlines[i].hull;
        for (std::size_t k = 0; k < hull.size(); ++k) perimeter += (hull[(k + 1) % hull.size()] - hull[k]).norm();
        areas[charts_.atlas[i]] +=
            charts_.outlines[i].area * scales[i] * scales[i] + perimeter * scales[i] * radius + 3.14 * radius * radius;
      }
      const double area = *std::max_element(areas.begin(), areas.end());
      (area > fill * options_.tiles * grid_.extent * grid_.extent ? high : low) = middle;
    }
    return low;
  }

  bool Search(double padding, bool any_scale) {
    const double texel = 1.0 / options_.texture_size;
    const double distance = padding * texel + kGap;
    padding_ = padding;
    margin_ = std::ceil(padding / 2) * texel - distance / 2 + kGap;
    const double charts = static_cast<double>(MostCharts(charts_.atlas, options_.atlases)) / options_.tiles;
    const int side = static_cast<int>(tuning_.cells_per_chart * std::sqrt(charts));
    grid_.side = std::clamp(side, tuning_.fewest_cells, tuning_.most_cells) / kCoarsestCell * kCoarsestCell;
    grid_.extent = 1 - 2 * margin_;
    grid_.radius = distance / 2;
    if (charts_.outlines.size() == 1 && charts_.outlines[0].radius > 0) {
      FitOne();
      return true;
    }
    // The least scale: charts of about one texel. If no padding is left to give up, nearly any scale.
    double least = any_scale || charts_.total_area == 0
                       ? 1e-9 * LargestScale()
                       : texel * std::sqrt(charts_.outlines.size() / charts_.total_area);
    least = std::min(least, options_.most_scale / 2);
    if (!HasNoTime() && SearchPlaces(least)) return true;
    return HasNoTime() && FitOnShelves(least);
  }

  // Whether the best scale so far is the largest allowed one, up to rounding.
  bool IsLargeEnough() const { return best_.scale >= (1 - 1e-12) * options_.most_scale; }

  bool HasNoTime() const { return charts_.order.size() > tuning_.many_charts && execution_.IsStopRequested(); }

  const std::vector<Outline>& simple() const { return charts_.simple.empty() ? charts_.outlines : charts_.simple; }

  void Simplify() {
    const std::vector<double> scales = Scales(LargestScale());
    charts_.simple.clear();
    std::size_t edges = 0;
    for (const Outline& outline : charts_.outlines) edges += outline.edges.size();
    if (edges <= kFewEdges * charts_.outlines.size()) return;
    charts_.simple.reserve(charts_.outlines.size());
    for (std::size_t i = 0; i < charts_.outlines.size(); ++i) {
      charts_.simple.push_back(
          Simplified(charts_.outlines[i], tuning_.simple_within * grid_.extent / grid_.side / scales[i]));
    }
  }

  bool SearchPlaces(double least) {
    Simplify();
    if (!TryScales(least)) return false;
    if (HasNoTime() || IsLargeEnough()) return true;
    const double left = work_.budget - static_cast<double>(work_.done);
    const bool tightens = left > tuning_.tighten_per_chart * static_cast<double>(charts_.outlines.size());
    if (charts_.order.size() >= tuning_.charts_for_orders &&
        left > tuning_.fewest_orders * static_cast<double>(work_.of_trial)) {
      const double share = options_.effort == PackEffort::kBest ? tuning_.best_orders_share : tuning_.orders_share;
      TryOrders(static_cast<double>(work_.done) + (tightens ? share : 1) * left);
    }
    series_.reset();
    if (tightens && !IsLargeEnough()) TightenAll(std::llround(work_.budget - static_cast<double>(work_.done)));
    return true;
  }

  // Runs trials at different scales, ever closer to the largest scale at which all charts fit.
  bool TryScales(double least) {
    double per_turn = 0;
    for (const Outline& outline : simple()) {
      per_turn += tuning_.trial_work + tuning_.trial_work_per_edge * static_cast<double>(outline.edges.size());
    }
    plan_.order = charts_.order;
    plan_.angles = tuning_.least_angles;
    while (plan_.angles < tuning_.most_angles && 2 * plan_.angles * tuning_.typical_trials * per_turn < work_.budget)
      plan_.angles *= 2;
    plan_.thorough = charts_.order.size() <= tuning_.many_charts;
    const auto kept =
        static_cast<std::size_t>(std::clamp(charts_.num_faces, tuning_.fewest_silhouettes, tuning_.most_silhouettes));
    series_ = MakeTrialSeries(simple(), charts_.atlas, tiles_, kept);
    starts_.clear();
    double good = 0, bad = 0, expected = 0;  // scales: all charts fit, do not fit, might fit
    int since_good = 0;                      // trials since all charts first fitted
    std::vector<Pose> poses(charts_.outlines.size());
    SetUnit(std::min(ScaleForFill(tuning_.first_fill), options_.most_scale));
    for (int trial = 1, side = grid_.side; ScaleOf(side) > least && !execution_.IsCancelled() && !HasNoTime();
         ++trial) {
      const double scale = ScaleOf(side);
      const TrialResult result = RunTrial(side, plan_, 0, &poses);
      work_.of_trial = std::max(work_.of_trial, result.work);
      if (result.placed == charts_.order.size()) {
        good = scale;
        // At this scale the charts would fill all rows.
        expected = scale / std::sqrt(result.filled);
        Keep(side, poses);
        if (IsLargeEnough()) break;
      } else {
        bad = scale;
      }
      if (good > 0) ++since_good;
      if (good > 0 && (execution_.IsStopRequested() || (bad > 0 && bad < tuning_.known_within * good))) break;
      // While the bracket is wide, trials may take all of the work; later steps gain less.
      const double share = bad > tuning_.wide_bracket * good ? 1 : 0.5;
      const auto with_next = static_cast<double>(work_.done + work_.of_trial);
      const bool is_too_wide = bad >= tuning_.too_wide * good;
      const bool is_dear = !plan_.thorough && with_next > work_.budget && !is_too_wide;
      const bool are_few = trial < tuning_.least_trials || (is_too_wide && since_good < tuning_.least_trials);
      const bool may_go_on =
          !is_dear &&
          (are_few || (since_good < tuning_.most_trials && static_cast<double>(work_.done) < share * work_.budget));
      if (good > 0 && !may_go_on) break;
      double next = 0;
      if (good > 0) {
        const double least_change = plan_.thorough ? tuning_.upwards : tuning_.known_within;
        next = std::clamp(expected, least_change * good, tuning_.farthest_change * good);
        if (bad > 0) next = std::min(next, std::sqrt(good * bad));
      } else {
        const double ratio = std::sqrt(AreaRatio(scale, result.placed));
        // With many charts the scale falls faster, since small charts find little room between large ones.
        next = scale /
               std::clamp(plan_.thorough ? std::sqrt(ratio) : ratio, tuning_.known_within, tuning_.farthest_change);
      }
      side = GridUpTo(next);
      if (plan_.thorough) continue;
      if (bad > 0) side = std::max(side, SideOf(bad) + 1);
      if (good > 0 && side >= SideOf(good)) {
        if (bad > 0 && SideOf(bad) + 1 >= SideOf(good)) break;  // no side in between
        side = SideOf(good) - 1;
      }
    }
    return good > 0;
  }

  // ---- Scales. A tile is a grid. With many charts, a cell keeps its size on the surface: at another scale the charts
  // keep their silhouettes, and the grid gets another side. With few charts, each scale gets new silhouettes, and the
  // grid keeps its side, a multiple of kCoarsestCell: with any other side, large charts could not use the last cells.

  // The side of the grid for a trial at this scale.
  int GridFor(double scale) {
    const int side = SideOf(scale);
    if (!plan_.thorough && side <= 2 * grid_.side && 2 * side >= grid_.side) return side;
    SetUnit(scale);
    return grid_.side;
  }
  // GridFor() of this scale, or of the largest that is allowed if that is smaller.
  int GridUpTo(double scale) {
    if (scale < options_.most_scale) return GridFor(scale);
    SetUnit(options_.most_scale);
    return grid_.side;
  }
  // Sets the size of cells: from now on, a grid of the usual side has this scale.
  void SetUnit(double scale) {
    grid_.unit = scale * grid_.side / grid_.extent;
    made_.most_side = -1;
  }
  double ScaleOf(int side) const { return grid_.unit * grid_.extent / side; }
  int SideOf(double scale) const { return static_cast<int>(std::lround(grid_.unit * grid_.extent / scale)); }

  TrialResult RunTrial(int side, const TrialPlan& plan, double most_missing, std::vector<Pose>* poses) {
    if (side < made_.least_side || side > made_.most_side) MakeFor(side);
    const TrialResult result = series_->Run(side, plan, most_missing, execution_, poses);
    work_.done += result.work;
    return result;
  }

  // Makes silhouettes for a grid of this side and somewhat smaller ones, on which the padding has fewer cells. With
  // charts that are enlarged, silhouettes are valid for one side only.
  void MakeFor(int side) {
    const double scale = ScaleOf(side), cells = side / grid_.extent;
    std::vector<double> scales = Scales(scale);
    bool all_alike = true;
    for (std::size_t i = 0; i < scales.size(); ++i) {
      all_alike = all_alike && scales[i] == scale * charts_.density[i];
      scales[i] *= cells;
    }
    const double radius = grid_.radius * cells;
    const double smaller = all_alike ? std::min(tuning_.most_smaller, tuning_.wider_padding / radius) : 0;
    made_.least_side = static_cast<int>(std::ceil((1 - smaller) * side));
    made_.most_side = side;
    series_->Resize(std::move(scales), radius);
  }

  // Keeps the poses found on a grid of this side as the best so far.
  void Keep(int side, const std::vector<Pose>& poses) {
    best_ = {poses, ScaleOf(side)};
    for (Pose& pose : best_.poses) pose.centre *= grid_.extent / side;
  }

  // Runs trials with the charts in other orders, until `until` work is done, each at a scale slightly above the best so
  // far. Small charts are placed only once the large ones fit, as they decide nothing before. A change moves one chart
  // in the order, or fixes the turn of one. It is kept if the area without a place does not grow. After orders_in_vain
  // changes without progress a new order is taken.
  void TryOrders(double until) {
    const auto n = static_cast<std::int32_t>(charts_.order.size()), large = CountLarge();
    std::linear_congruential_engine<std::uint64_t, 6364136223846793005u, 1442695040888963407u, 0> knuth(1);
    const auto random = [&] { return static_cast<double>(knuth() >> 33) * 0x1p-31; };  // in [0, 1)
    std::vector<double> key(n);
    TrialPlan plan = plan_;
    plan.turn.assign(n, -1);
    std::vector<Pose> poses(n);
    double missing = kHuge;
    const auto next_side = [&] {
      if (tuning_.order_step * best_.scale >= options_.most_scale) return GridUpTo(options_.most_scale);
      const int next = GridFor(tuning_.order_step * best_.scale);
      return std::min(next, SideOf(best_.scale) - 1);
    };
    int side = next_side();
    int in_vain = 0;
    std::int32_t first_missing = 0;
    while (static_cast<double>(work_.done) < until && !IsLargeEnough() && !execution_.IsCancelled() &&
           !execution_.IsStopRequested()) {
      TrialPlan other = plan;
      if (in_vain >= tuning_.orders_in_vain) {
        for (const std::int32_t i : charts_.order)
          key[i] = charts_.size[i] * (1 + tuning_.order_spread * (random() - 0.5));
        other.order = LargestFirst(key);
        other.turn.assign(n, -1);
        missing = kHuge;
        in_vain = 0;
      } else if (missing < kHuge) {
        // Charts early in the order matter most, and the first one without a place should come earlier.
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

  // The number of charts at the head of charts_.order that have most of the area (large_area).
  std::int32_t CountLarge() const {
    double area = 0;
    std::int32_t count = 0;
    while (count < std::ssize(charts_.order) && area < tuning_.large_area * charts_.total_area) {
      const std::int32_t i = charts_.order[count++];
      area += charts_.outlines[i].area * charts_.density[i] * charts_.density[i];
    }
    return std::max(count, 1);
  }

  // Keeps the best so far as a start for tightening.
  void Remember() {
    starts_.push_back(best_);
    if (starts_.size() > static_cast<std::size_t>(tuning_.starts)) starts_.erase(starts_.begin());
  }

  // The approximate area of all charts, with half of the padding round each, divided by that of the first `count`.
  double AreaRatio(double scale, std::size_t count) const {
    const std::vector<double> scales = Scales(scale);
    double placed = 0, all = 0;
    for (std::size_t k = 0; k < charts_.order.size(); ++k) {
      const Outline& outline = charts_.outlines[charts_.order[k]];
      const double unit = scales[charts_.order[k]], radius = outline.radius * unit + grid_.radius;
      const double area = outline.area * unit * unit + 4 * grid_.radius * radius;
      all += area;
      if (k < count) placed += area;
    }
    return placed > 0 ? all / placed : kHuge;
  }

  // Places the bounding boxes of the charts in rows, trying smaller and smaller scales. False if none above `least`
  // fits.
  bool FitOnShelves(double least) {
    std::vector<Box> boxes;
    for (const Outline& outline : charts_.outlines) boxes.push_back(BoxAt(outline, outline.upright));
    std::vector<Vec2> extents(charts_.outlines.size());
    for (best_.scale = std::min(LargestScale(), options_.most_scale); best_.scale > least && !execution_.IsCancelled();
         best_.scale /= 1.03) {
      const std::vector<double> scales = Scales(best_.scale);
      for (std::size_t i = 0; i < charts_.outlines.size(); ++i) {
        extents[i] = scales[i] * (boxes[i].high - boxes[i].low) + Vec2::Constant(2 * grid_.radius);
      }
      const std::vector<Shelf> shelves = LayOnShelves(extents, charts_.atlas, tiles_, grid_.extent);
      if (shelves.empty()) continue;
      best_.poses.resize(charts_.outlines.size());
      for (std::size_t i = 0; i < charts_.outlines.size(); ++i) {
        const Vec2 centre = shelves[i].low + Vec2::Constant(grid_.radius) - scales[i] * boxes[i].low;
        best_.poses[i] = {centre, charts_.outlines[i].upright, shelves[i].tile};
      }
      return true;
    }
    return false;
  }

  // Makes a single chart as large as possible.
  void FitOne() {
    const double angle = AngleOfSmallestSquare(charts_.outlines[0]);
    const Box box = BoxAt(charts_.outlines[0], angle);
    const double low = margin_ + grid_.radius;
    best_.scale = std::min((1 - 2 * low) / ((box.high - box.low).maxCoeff() * charts_.density[0]), options_.most_scale);
    best_.poses = {{Vec2::Constant(grid_.radius) - best_.scale * charts_.density[0] * box.low, angle,
                    charts_.atlas[0] * options_.tiles}};
  }

  void TightenAll(std::int64_t work) {
    const bool points =
        std::all_of(charts_.outlines.begin(), charts_.outlines.end(), [](const Outline& o) { return o.radius == 0; });
    if (points) return;  // points have no scale
    TightenOptions options;
    options.distance = 2 * grid_.radius;
    options.low = margin_ + grid_.radius;
    options.tiles = options_.tiles;
    options.atlases = options_.atlases;
    options.work = work;
    options.most_scale = options_.most_scale;
    options.tuning = tuning_;
    std::vector<double> relative = Scales(best_.scale);
    for (double& r : relative) r /= best_.scale;
    Remember();
    const Vec2 corner = Vec2::Constant(margin_);  // of the grid, in its tile
    for (Arrangement& start : starts_) {
      for (Pose& pose : start.poses) pose.centre += corner;
    }
    best_ = Tighten({charts_.outlines, simple(), charts_.atlas, relative}, options, execution_, starts_);
    for (Pose& pose : best_.poses) pose.centre -= corner;
  }

  void Finish(Packing* packing) const {
    const std::vector<double> scales = Scales(best_.scale);
    packing->scale = best_.scale;
    packing->padding = padding_;
    double area = 0;
    for (std::size_t i = 0; i < charts_.outlines.size(); ++i) {
      const auto& [centre, angle, tile] = best_.poses[i];
      ChartPlacement& chart = packing->charts[i] = {angle, scales[i], Vec2::Zero(), tile};
      const Vec2 corner = CornerOfTile(tile) + Vec2::Constant(margin_);
      chart.offset = corner + centre - chart(charts_.outlines[i].centre);
      packing->tiles = std::max(packing->tiles, tile + 1);
      area += charts_.outlines[i].area * scales[i] * scales[i];
    }
    packing->efficiency = area / packing->tiles;
  }

  const PackOptions& options_;
  const TrialTiles tiles_;
  const PackTuning& tuning_;
  const Execution& execution_;
  struct {
    std::vector<Outline> outlines;
    std::vector<Outline> simple;        // simplified; empty if they have few edges anyway
    std::vector<double> density, size;  // of each chart
    std::vector<std::int32_t> order;    // large to small
    std::vector<int> atlas;             // of each chart
    double num_faces = 0;
    double total_area = 0, largest_area = 0;  // of all charts; of the fullest atlas
  } charts_;
  struct {
    int side = 256;     // usual number of cells
    double extent = 1;  // of the grid, in the texture
    double radius = 0;  // half of the padding, in the texture
    double unit = 1;    // cells along a length of 1 on the surface, at density 1
  } grid_;
  double margin_ = 0;           // between the grid and each side of the tile
  double padding_ = 0;          // texels
  Arrangement best_ = {{}, 0};  // poses are relative to the corner of the grid, in the texture
  struct {                      // in nanoseconds
    double budget = 0;
    std::int64_t done = 0;
    std::int64_t of_trial = 0;  // of the most expensive trial
  } work_;
  struct {
    int least_side = 0, most_side = -1;
  } made_;  // range of grid sides that the silhouettes are valid for
  TrialPlan plan_;
  std::unique_ptr<TrialSeries> series_;
  std::vector<Arrangement> starts_;  // the last few that fitted, by ascending scale
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

double DrawnScale(double radius, double density, double scale, std::size_t charts, const PackOptions& options) {
  const double least = std::min(1.0 / options.texture_size, 0.25 / std::sqrt(static_cast<double>(charts)));
  const double width = 2 * radius, plain = scale * density;
  return width * plain < least && width > 0 ? least / width : plain;
}

Packing Pack(std::vector<PackChart> charts, const PackOptions& options, const Execution& execution) {
  return Pack(
      charts.size(), [&](std::size_t i) { return std::exchange(charts[i], {}); }, options, execution);
}

Packing Pack(std::size_t count, const std::function<PackChart(std::size_t)>& make_chart, const PackOptions& options,
             const Execution& execution) {
  return Packer(count, make_chart, options, execution).Run();
}

}  // namespace planish
