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

// Attempts that are made side by side, whatever the number of threads: the share of the step that each takes.
constexpr std::array<double, 2> kLanes = {1, 0.4};

class Tightener {
 public:
  Tightener(const std::vector<Outline>& outlines, const std::vector<double>& relative, const TightenOptions& options,
            const Execution& execution, Arrangement* arrangement)
      : outlines_(outlines),
        relative_(relative),
        options_(options),
        tuning_(options.tuning),
        execution_(execution),
        arrangement_(*arrangement) {
    width_ = std::sqrt(options.tiles / static_cast<double>(outlines.size()));
    relax_.distance = options.distance;
    relax_.low = options.low;
    relax_.spacing = std::clamp(width_ / 40, 1.0 / 1024, 1.0 / 300);
    relax_.tolerance = 0.0015 * width_;
    for (std::size_t i = 0; i < outlines.size(); ++i) {
      const double unit = relative[i] * arrangement->scale;
      const double reach = 1.1 * (relax_.distance + 2 * relax_.spacing);
      const double spacing = std::max(std::min(relax_.spacing, outlines[i].radius * unit / 6), reach / 16);
      fields_.emplace_back(outlines[i], spacing / unit, reach / unit);
    }
  }

  void Run() {
    Relaxer relaxer = MakeRelaxer(arrangement_);
    relaxer.Grow(30, std::llround(tuning_.growing_share * static_cast<double>(options_.work)));
    std::vector<Arrangement> found = {{relaxer.bodies(), relaxer.scale()}};
    Search(relaxer.work(), &found);
    // What grew inside of a ring may be jammed in there at any scale; then what was found before counts.
    while (!found.empty() && !Settle(found.back(), arrangement_.scale)) found.pop_back();
  }

 private:
  Relaxer MakeRelaxer(const Arrangement& arrangement) const {
    Relaxer relaxer(outlines_, fields_, relative_, arrangement.scale, relax_, execution_);
    relaxer.bodies() = arrangement.bodies;
    std::fill(relaxer.margins().begin(), relaxer.margins().end(), relax_.tolerance / 2);
    return relaxer;
  }

  std::vector<double> Scales(double scale) const {
    std::vector<double> scales = relative_;
    for (double& s : scales) s *= scale;
    return scales;
  }

  // Adds to *found, which is not empty, what is better. Settling costs about what growing did.
  void Search(std::int64_t growing, std::vector<Arrangement>* found) {
    const auto n = static_cast<std::int64_t>(outlines_.size());
    const std::int64_t budget = options_.work - growing,
                       at_once = tuning_.moves_at_once + tuning_.moves_at_once_per_chart * n;
    double step = tuning_.first_step;
    std::int64_t used = growing;
    for (std::uint64_t round = 0; used < budget && !execution_.IsCancelled() && !execution_.IsStopRequested();
         ++round) {
      std::array<std::optional<Arrangement>, kLanes.size()> results;
      std::array<std::int64_t, kLanes.size()> work = {};
      const auto run = [&](std::int64_t begin, std::int64_t end) {
        for (std::int64_t lane = begin; lane < end; ++lane) {
          RearrangeOptions rearrange;
          rearrange.side = static_cast<int>(std::clamp(tuning_.pixels_per_chart / width_, 112.0, 600.0));
          rearrange.tiles = options_.tiles;
          rearrange.angles = 24;
          rearrange.tries = 60;
          rearrange.moves = at_once;
          rearrange.work = budget - used;
          rearrange.slack = tuning_.coarse_slack;
          rearrange.distance = options_.distance;
          rearrange.low = options_.low;
          rearrange.shuffle = lane == 1 && round % 2 == 0 && n <= tuning_.most_to_shuffle;
          rearrange.seed = kLanes.size() * round + lane;
          results[lane] =
              Attempt(found->back(), found->back().scale * (1 + step * kLanes[lane]), rearrange, &work[lane]);
        }
      };
      if (execution_.team != nullptr) {
        execution_.team->For(kLanes.size(), 1, run);
      } else {
        run(0, kLanes.size());
      }
      bool better = false;
      for (const std::optional<Arrangement>& result : results) {
        if (!result || result->scale <= found->back().scale) continue;
        found->push_back(*result);
        better = true;
      }
      for (const std::int64_t w : work) used += w;
      if (!better) step = step > tuning_.least_step ? std::max(tuning_.least_step, step * 0.6) : tuning_.step_again;
    }
  }

  // Nothing if charts cannot be brought apart at this scale.
  std::optional<Arrangement> Attempt(const Arrangement& from, double scale, const RearrangeOptions& coarse,
                                     std::int64_t* work) const {
    Arrangement arrangement{from.bodies, scale};
    if (!Rearrange(outlines_, fields_, Scales(scale), coarse, execution_, &arrangement.bodies, work))
      return std::nullopt;
    if (std::optional<Arrangement> grown = SeparateAndGrow(arrangement, from.scale, coarse.work, work)) return grown;
    // Where thin parts of charts cross, which coarse pixels do not show, pushing does not help.
    RearrangeOptions fine = coarse;
    fine.side = std::min(2 * coarse.side, tuning_.finest_side);
    fine.slack = tuning_.fine_slack;
    fine.shuffle = false;
    fine.moves = coarse.moves / 2;
    if (!Rearrange(outlines_, fields_, Scales(scale), fine, execution_, &arrangement.bodies, work)) return std::nullopt;
    return SeparateAndGrow(arrangement, from.scale, coarse.work, work);
  }

  // At the scale of `arrangement`, or a smaller one above least_scale. Nothing if that fails; arrangement.bodies then
  // are as far apart as they got at its scale. Adds to *work what it took, about `most_work` at most.
  std::optional<Arrangement> SeparateAndGrow(Arrangement& arrangement, double least_scale, std::int64_t most_work,
                                             std::int64_t* work) const {
    Relaxer relaxer = MakeRelaxer(arrangement);
    const auto left = [&] { return most_work - relaxer.work(); };
    bool apart = relaxer.Separate(tuning_.separating_steps, left());
    arrangement.bodies = relaxer.bodies();
    for (double scale = arrangement.scale; !apart && left() > 0 && (scale *= tuning_.back_off) > least_scale;) {
      relaxer.set_scale(scale);
      apart = relaxer.Separate(tuning_.separating_steps, left());
    }
    if (apart) relaxer.Grow(20, left());
    *work += relaxer.work();
    if (!apart) return std::nullopt;
    return Arrangement{relaxer.bodies(), relaxer.scale()};
  }

  // Distances were sampled so far. Puts an arrangement that keeps them exactly into arrangement_, if it finds one:
  // charts move apart, or shrink a little, until they are exactly as demanded.
  bool Settle(const Arrangement& arrangement, double least_scale) {
    Relaxer relaxer = MakeRelaxer(arrangement);
    const auto left = [&] {
      return tuning_.settling_share * static_cast<double>(options_.work) - static_cast<double>(relaxer.work());
    };
    for (int round = 0;
         round < tuning_.settling_rounds && relaxer.scale() > least_scale && left() > 0 && !execution_.IsCancelled();
         ++round) {
      if (outlines_.size() > tuning_.many_charts && execution_.IsStopRequested()) return false;
      const std::vector<TooNear> too_near = relaxer.Separate(tuning_.separating_steps, std::llround(left()))
                                                ? FindTooNear(outlines_, Scales(relaxer.scale()), relaxer.bodies(),
                                                              options_.distance, options_.low, execution_)
                                                : std::vector<TooNear>{{0, -1, 0}};
      if (too_near.empty()) {
        arrangement_ = {relaxer.bodies(), relaxer.scale()};
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
  const PackTuning& tuning_;
  const Execution& execution_;
  Arrangement& arrangement_;
  double width_;  // of an average chart
  RelaxOptions relax_;
  std::vector<DistanceField> fields_;
};

}  // namespace

void Tighten(const std::vector<Outline>& outlines, const std::vector<double>& relative_scales,
             const TightenOptions& options, const Execution& execution, Arrangement* arrangement) {
  Tightener(outlines, relative_scales, options, execution, arrangement).Run();
}

}  // namespace planish
