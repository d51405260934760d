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
double E(const char* n, double d) { return getenv(n) ? atof(getenv(n)) : d; }

// Attempts that are made side by side, whatever the number of threads, and the share of the step that each takes.
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
      const double spacing = std::max(std::min(relax_.spacing, outlines[i].radius * unit / 6), 1e-7);
      fields_.emplace_back(outlines[i], spacing / unit, 1.1 * (relax_.distance + 2 * relax_.spacing) / unit);
    }
  }

  void Run() {
    Layout best = layout_;
    Relaxer relaxer = MakeRelaxer(best);
    relaxer.Grow(30);
    best = {relaxer.bodies(), relaxer.scale()};
    Search(&best);
    Settle(best, layout_.scale);
  }

  void RunLoosen(double factor) { Settle({layout_.bodies, factor * layout_.scale}, 0.5 * factor * layout_.scale); }

 private:
  Relaxer MakeRelaxer(const Layout& layout) const {
    Relaxer relaxer(outlines_, fields_, relative_, layout.scale, relax_, execution_);
    relaxer.bodies() = layout.bodies;
    return relaxer;
  }

  std::vector<double> Scales(double scale) const {
    std::vector<double> scales = relative_;
    for (double& s : scales) s *= scale;
    return scales;
  }

  void Search(Layout* best) {
    const auto n = static_cast<std::int64_t>(outlines_.size());
    const std::int64_t budget = options_.moves, at_once = E("ATONCE", 400) + E("ATONCEN",6) * n;
    const double least_step = E("MINSTEP", 0.003);
    double step = E("STEP", 0.03);
    std::int64_t used = 0;
    for (std::uint64_t round = 0; used < budget && !execution_.IsStopped(); ++round) {
      std::array<std::optional<Layout>, kLanes.size()> results;
      std::array<std::int64_t, kLanes.size()> moves = {};
      const auto run = [&](std::int64_t begin, std::int64_t end) {
        for (std::int64_t lane = begin; lane < end; ++lane) {
          RearrangeOptions rearrange;
          rearrange.side = static_cast<int>(std::clamp(E("SIDE", 26) / width_, 112.0, 512.0));
          rearrange.tiles = options_.tiles;
          rearrange.angles = E("ANGLES", 16);
          rearrange.tries = E("TRIES", 100);
          rearrange.moves = at_once;
          rearrange.distance = options_.distance;
          rearrange.low = options_.low;
          rearrange.seed = kLanes.size() * round + lane;
          results[lane] = Attempt(*best, best->scale * (1 + step * kLanes[lane]), rearrange, &moves[lane]);
        }
      };
      if (execution_.team != nullptr) {
        execution_.team->For(kLanes.size(), 1, run);
      } else {
        run(0, kLanes.size());
      }
      bool better = false;
      double before=best->scale;
      for (const std::optional<Layout>& result : results) {
        if (!result || result->scale <= best->scale) continue;
        *best = *result;
        better = true;
      }
      if (getenv("PACK_DEBUG")) fprintf(stderr, "round %d step %.4f lanes %d %d moves %ld %ld scale^2 %.4f\n", int(round), step, bool(results[0]), bool(results[1]), moves[0],moves[1],best->scale*best->scale/before/before);
      for (const std::int64_t m : moves) used += m + n / 4 + 1;
      if (!better) step = std::max(least_step, step * E("DECAY",0.6));
    }
  }

  std::optional<Layout> Attempt(const Layout& from, double scale, const RearrangeOptions& rearrange,
                                std::int64_t* moves) const {
    Layout layout{from.bodies, scale};
    if (!Rearrange(outlines_, fields_, Scales(scale), rearrange, execution_, &layout.bodies, moves)) return std::nullopt;
    Relaxer relaxer = MakeRelaxer(layout);
    if (!relaxer.Separate(80)) return std::nullopt;
    relaxer.Grow(20);
    return Layout{relaxer.bodies(), relaxer.scale()};
  }

  // Distances were sampled so far: charts move apart, or shrink a little, until they are exactly as demanded.
  void Settle(const Layout& layout, double least_scale) {
    Relaxer relaxer = MakeRelaxer(layout);
    std::fill(relaxer.margins().begin(), relaxer.margins().end(), relax_.tolerance / 2);
    while (relaxer.scale() > least_scale && !execution_.IsStopped()) {
      const std::vector<TooNear> too_near =
          relaxer.Separate(60) ? FindTooNear(outlines_, Scales(relaxer.scale()), relaxer.bodies(), options_.distance,
                                             options_.low, execution_)
                               : std::vector<TooNear>{{0, -1, 0}};
      if (too_near.empty()) {
        layout_ = {relaxer.bodies(), relaxer.scale()};
        return;
      }
      for (const TooNear& pair : too_near) {
        for (const std::int32_t i : {pair.a, pair.b}) {
          if (i >= 0) relaxer.margins()[i] += std::min(0.6 * pair.missing, relax_.tolerance);
        }
      }
      relaxer.set_scale(relaxer.scale() * 0.9995);
    }
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
