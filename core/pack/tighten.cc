#include "core/pack/tighten.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <optional>

#include "core/pack/clearance.h"
#include "core/pack/rearrange.h"
#include "core/pack/relax.h"

namespace planish {
namespace {

// Attempts that are made side by side, whatever the number of threads, and the share of the step that each takes.
// The least growth that is tried, and that after the least was too much: other places may lead farther.
constexpr double kLeastStep = 0.003, kStepAgain = 0.02;
// Distances looked up in relaxation that cost as much as one move of a chart in rearrangement, about.
constexpr std::int64_t kLooksPerMove = 4000;
constexpr std::size_t kMostInAHurry = 300;  // charts that settle in some milliseconds
constexpr int kSettlingRounds = 25, kSeparatingSteps = 60;
constexpr double kBackOff = 0.995;  // of the scale, where charts do not come apart
// Of an attempt: many small ones that fail early lead farther than a few thorough ones.
constexpr std::int64_t kMovesAtOnce = 300, kMovesAtOncePerChart = 3;
constexpr std::int64_t kMostToShuffle = 40;  // charts that find places from a random start in as many moves
// Images for rearranging: pixels along an average chart, and by how many charts may overlap.
constexpr double kPixelsPerChart = 20, kCoarseSlack = 1, kFineSlack = 0.4;
constexpr int kFinestSide = 1200;
constexpr std::array<double, 2> kLanes = {1, 0.4};

class Tightener {
 public:
  Tightener(const std::vector<Outline>& outlines, const std::vector<double>& relative, const TightenOptions& options,
            const Execution& execution, Layout* layout)
      : outlines_(outlines), relative_(relative), options_(options), execution_(execution), layout_(*layout) {
    width_ = std::sqrt(options.tiles / static_cast<double>(outlines.size()));
    relax_.distance = options.distance;
    relax_.low = options.low;
    relax_.spacing = std::clamp(width_ / 40, 1.0 / 1024, 1.0 / 300);
    relax_.tolerance = 0.0015 * width_;
    for (std::size_t i = 0; i < outlines.size(); ++i) {
      const double unit = relative[i] * layout->scale;
      const double reach = 1.1 * (relax_.distance + 2 * relax_.spacing);
      const double spacing = std::max(std::min(relax_.spacing, outlines[i].radius * unit / 6), reach / 16);
      fields_.emplace_back(outlines[i], spacing / unit, reach / unit);
    }
  }

  void Run() {
    Relaxer relaxer = MakeRelaxer(layout_);
    relaxer.Grow(30);
    std::vector<Layout> found = {{relaxer.bodies(), relaxer.scale()}};
    Search(&found);
    // What grew inside of a ring may be jammed in there at any scale; then what was found before counts.
    while (!found.empty() && !Settle(found.back(), layout_.scale)) found.pop_back();
  }

  void RunLoosen(double factor) { Settle({layout_.bodies, factor * layout_.scale}, 0.5 * factor * layout_.scale); }

 private:
  Relaxer MakeRelaxer(const Layout& layout) const {
    Relaxer relaxer(outlines_, fields_, relative_, layout.scale, relax_, execution_);
    relaxer.bodies() = layout.bodies;
    std::fill(relaxer.margins().begin(), relaxer.margins().end(), relax_.tolerance / 2);
    return relaxer;
  }

  std::vector<double> Scales(double scale) const {
    std::vector<double> scales = relative_;
    for (double& s : scales) s *= scale;
    return scales;
  }

  // Adds to *found, which is not empty, what is better.
  void Search(std::vector<Layout>* found) {
    const auto n = static_cast<std::int64_t>(outlines_.size());
    const std::int64_t budget = options_.moves, at_once = kMovesAtOnce + kMovesAtOncePerChart * n;
    double step = options_.first_step;
    std::int64_t used = 0;
    for (std::uint64_t round = 0; used < budget && !execution_.IsStopped() && !execution_.IsHurried(); ++round) {
      std::array<std::optional<Layout>, kLanes.size()> results;
      std::array<std::int64_t, kLanes.size()> moves = {};
      const auto run = [&](std::int64_t begin, std::int64_t end) {
        for (std::int64_t lane = begin; lane < end; ++lane) {
          RearrangeOptions rearrange;
          rearrange.side = static_cast<int>(std::clamp(kPixelsPerChart / width_, 112.0, 600.0));
          rearrange.tiles = options_.tiles;
          rearrange.angles = 24;
          rearrange.tries = 60;
          rearrange.moves = at_once;
          rearrange.slack = kCoarseSlack;
          rearrange.distance = options_.distance;
          rearrange.low = options_.low;
          rearrange.shuffle = lane == 1 && round % 2 == 0 && n <= kMostToShuffle;
          rearrange.seed = kLanes.size() * round + lane;
          results[lane] =
              Attempt(found->back(), found->back().scale * (1 + step * kLanes[lane]), rearrange, &moves[lane]);
        }
      };
      if (execution_.team != nullptr) {
        execution_.team->For(kLanes.size(), 1, run);
      } else {
        run(0, kLanes.size());
      }
      bool better = false;
      for (const std::optional<Layout>& result : results) {
        if (!result || result->scale <= found->back().scale) continue;
        found->push_back(*result);
        better = true;
      }
      for (const std::int64_t m : moves) used += m + n / 4 + 1;
      if (!better) step = step > kLeastStep ? std::max(kLeastStep, step * 0.6) : kStepAgain;
    }
  }

  // Nothing if charts cannot be brought apart at this scale.
  std::optional<Layout> Attempt(const Layout& from, double scale, const RearrangeOptions& coarse,
                                std::int64_t* moves) const {
    Layout layout{from.bodies, scale};
    if (!Rearrange(outlines_, fields_, Scales(scale), coarse, execution_, &layout.bodies, moves)) return std::nullopt;
    if (std::optional<Layout> grown = SeparateAndGrow(layout, from.scale, moves)) return grown;
    // Where thin parts of charts cross, which coarse pixels do not show, pushing does not help.
    RearrangeOptions fine = coarse;
    fine.side = std::min(2 * coarse.side, kFinestSide);
    fine.slack = kFineSlack;
    fine.shuffle = false;
    fine.moves = coarse.moves / 2;
    if (!Rearrange(outlines_, fields_, Scales(scale), fine, execution_, &layout.bodies, moves)) return std::nullopt;
    return SeparateAndGrow(layout, from.scale, moves);
  }

  // At the scale of `layout`, or a smaller one above least_scale. Nothing if that fails; layout.bodies then are as far
  // apart as they got at its scale.
  std::optional<Layout> SeparateAndGrow(Layout& layout, double least_scale, std::int64_t* moves) const {
    Relaxer relaxer = MakeRelaxer(layout);
    bool apart = relaxer.Separate(kSeparatingSteps);
    layout.bodies = relaxer.bodies();
    for (double scale = layout.scale; !apart && (scale *= kBackOff) > least_scale;) {
      relaxer.set_scale(scale);
      apart = relaxer.Separate(kSeparatingSteps);
    }
    if (apart) relaxer.Grow(20);
    *moves += relaxer.looks() / kLooksPerMove;
    if (!apart) return std::nullopt;
    return Layout{relaxer.bodies(), relaxer.scale()};
  }

  // Distances were sampled so far. Puts a layout that keeps them exactly into layout_, if it finds one: charts move
  // apart, or shrink a little, until they are exactly as demanded.
  bool Settle(const Layout& layout, double least_scale) {
    Relaxer relaxer = MakeRelaxer(layout);
    for (int round = 0; round < kSettlingRounds && relaxer.scale() > least_scale && !execution_.IsStopped(); ++round) {
      if (outlines_.size() > kMostInAHurry && execution_.IsHurried()) return false;
      const std::vector<TooNear> too_near = relaxer.Separate(60)
                                                ? FindTooNear(outlines_, Scales(relaxer.scale()), relaxer.bodies(),
                                                              options_.distance, options_.low, execution_)
                                                : std::vector<TooNear>{{0, -1, 0}};
      if (too_near.empty()) {
        layout_ = {relaxer.bodies(), relaxer.scale()};
        return true;
      }
      for (const TooNear& pair : too_near) {
        for (const std::int32_t i : {pair.a, pair.b}) {
          if (i >= 0) relaxer.margins()[i] += std::min(0.6 * pair.missing, relax_.tolerance);
        }
      }
      relaxer.set_scale(relaxer.scale() * 0.9995);
    }
    return false;
  }

  const std::vector<Outline>& outlines_;
  const std::vector<double>& relative_;
  const TightenOptions& options_;
  const Execution& execution_;
  Layout& layout_;
  double width_;  // of an average chart
  RelaxOptions relax_;
  std::vector<DistanceField> fields_;
};

}  // namespace

void Tighten(const std::vector<Outline>& outlines, const std::vector<double>& relative_scales,
             const TightenOptions& options, const Execution& execution, Layout* layout) {
  Tightener(outlines, relative_scales, options, execution, layout).Run();
}

void Loosen(const std::vector<Outline>& outlines, const std::vector<double>& relative_scales,
            const TightenOptions& options, double factor, const Execution& execution, Layout* layout) {
  Tightener(outlines, relative_scales, options, execution, layout).RunLoosen(factor);
}

}  // namespace planish
