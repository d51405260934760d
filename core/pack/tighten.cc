#include "core/pack/tighten.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <optional>

#include "core/mesh/box_tree.h"
#include "core/mesh/predicates.h"
#include "core/pack/rearrange.h"

namespace planish {
namespace {

// The outline of a chart at its position in the texture.
struct Placed {
  std::vector<Vec2> points;
  Box box;
  std::optional<BoxTree> edges;  // of the outline
};

bool IsInside(const Vec2& p, const Outline& outline, const Placed& placed) {
  int winding = 0;
  for (const auto& [from, to] : outline.edges) {
    const Vec2 &a = placed.points[from], &b = placed.points[to];
    if ((a.y() <= p.y()) == (b.y() <= p.y())) continue;
    const double x = a.x() + (p.y() - a.y()) / (b.y() - a.y()) * (b.x() - a.x());
    if (x > p.x()) winding += b.y() > a.y() ? 1 : -1;
  }
  return winding != 0;
}

// The square of the least distance between edges of two charts, at most distance^2.
double SquareOfLeastDistance(const Outline& outline_a, const Placed& a, const Outline& outline_b, const Placed& b,
                             double distance) {
  double nearest = distance * distance;
  for (const auto& [from, to] : outline_a.edges) {
    const Box near_edge = Box::Around(a.points[from], a.points[to]).Grown(distance);
    if (!b.box.Meets(near_edge)) continue;
    b.edges->ForEachMeeting(near_edge, [&, from = from, to = to](std::int32_t e) {
      const auto& [c, d] = outline_b.edges[e];
      nearest = std::min(nearest, SquaredDistance(a.points[from], a.points[to], b.points[c], b.points[d]));
      return true;
    });
  }
  return nearest;
}

struct TooNear {
  std::int32_t a, b;  // charts; b is -1 for the rim of the tile
  double missing;     // by how much the distance falls short; the whole distance if charts overlap
};

// The final check of a packing, by exact distances instead of raster or samples: finds charts, scaled by `scales`, that
// are nearer to each other than `distance`, or outside [low, 1 - low]^2.
std::vector<TooNear> FindTooNear(const std::vector<Outline>& outlines, const std::vector<double>& scales,
                                 const std::vector<Pose>& poses, double distance, double low,
                                 const Execution& execution) {
  std::vector<TooNear> found;
  const std::size_t n = outlines.size();
  std::vector<Placed> placed(n);
  std::vector<Box> boxes(n);
  for (std::size_t i = 0; i < n; ++i) {
    const Rotation rotate(poses[i].angle, scales[i]);
    placed[i].points.reserve(outlines[i].points.size());
    for (const Vec2& p : outlines[i].points) {
      placed[i].points.push_back(poses[i].centre + rotate(p));
      placed[i].box.Add(placed[i].points.back());
    }
    boxes[i] = placed[i].box;
    std::vector<Box> edges;
    for (const auto& [from, to] : outlines[i].edges) {
      edges.push_back(Box::Around(placed[i].points[from], placed[i].points[to]));
    }
    placed[i].edges.emplace(std::move(edges));
    const double out = std::max((Vec2::Constant(low) - placed[i].box.low).maxCoeff(),
                                (placed[i].box.high - Vec2::Constant(1 - low)).maxCoeff());
    if (out > 0) found.push_back({static_cast<std::int32_t>(i), -1, out});
  }
  ForEachNearPair(boxes, distance, [&](std::int32_t a, std::int32_t b) {
    if (poses[a].tile != poses[b].tile || execution.IsCancelled()) return;
    double nearest = SquareOfLeastDistance(outlines[a], placed[a], outlines[b], placed[b], distance);
    if (nearest == distance * distance && (IsInside(placed[a].points[0], outlines[b], placed[b]) ||
                                           IsInside(placed[b].points[0], outlines[a], placed[a]))) {
      nearest = 0;
    }
    if (nearest < distance * distance) found.push_back({a, b, distance - std::sqrt(nearest)});
  });
  return found;
}

// Hops that run in parallel, whatever the number of threads, if there is enough work for them.
constexpr std::size_t kLanes = 2;

class Tightener {
 public:
  Tightener(const TightenCharts& charts, const TightenOptions& options, const Execution& execution,
            const std::vector<Arrangement>& starts)
      : charts_(charts),
        options_(options),
        tuning_(options.tuning),
        execution_(execution),
        starts_(starts),
        arrangement_(starts.back()) {
    width_ = std::sqrt(options.tiles / static_cast<double>(MostCharts(charts.atlas, options.atlases)));
    relax_ = {options, std::clamp(width_ / 40, 1.0 / 1024, 1.0 / 300), 0.0015 * width_};
    double area = 0, length = 0;
    for (std::size_t i = 0; i < charts.outlines.size(); ++i) {
      const double unit = charts.relative_scales[i] * arrangement_.scale;
      area += unit * unit * charts.outlines[i].area;
      for (const auto& [from, to] : charts.simple[i].edges) {
        length += unit * (charts.simple[i].points[to] - charts.simple[i].points[from]).norm();
      }
      const double reach = 1.1 * (relax_.distance + 2 * relax_.spacing);
      const double spacing = std::max(std::min(relax_.spacing, charts.outlines[i].radius * unit / 6), reach / 16);
      fields_.emplace_back(charts.simple[i], spacing / unit, reach / unit);
    }
    thickness_ = 2 * area / length;
  }

  Arrangement Run() {
    std::vector<Arrangement> found;
    std::int64_t growing = 0;
    const auto share = [&](double part) { return std::llround(part * static_cast<double>(options_.work)); };
    const std::int64_t most = share(tuning_.growing_share), most_before_others = share(tuning_.others_share);
    // Grows the start with the largest scale first, and the others only while nearly all of the work is left.
    for (auto start = starts_.rbegin(); start != starts_.rend() && (found.empty() || growing < most_before_others);
         ++start) {
      Relaxer relaxer = MakeRelaxer(*start);
      relaxer.Grow(30, most - growing);
      growing += relaxer.work();
      found.push_back({relaxer.poses(), relaxer.scale()});
    }
    std::stable_sort(found.begin(), found.end(),
                     [](const Arrangement& a, const Arrangement& b) { return a.scale < b.scale; });
    if (charts_.outlines.size() <= tuning_.most_to_rearrange) Search(growing, &found);
    // A chart that grew inside of a ring may be jammed there at any scale. Then the arrangement before it is used.
    while (!found.empty() && !Settle(found.back(), arrangement_.scale)) found.pop_back();
    return arrangement_;
  }

 private:
  Relaxer MakeRelaxer(const Arrangement& arrangement) const {
    Relaxer relaxer(charts_.simple, fields_, charts_.relative_scales, arrangement.scale, relax_, execution_);
    relaxer.poses() = arrangement.poses;
    std::fill(relaxer.margins().begin(), relaxer.margins().end(), relax_.tolerance / 2);
    return relaxer;
  }

  std::vector<double> Scales(double scale) const {
    std::vector<double> scales = charts_.relative_scales;
    for (double& s : scales) s *= scale;
    return scales;
  }

  // The options for rearranging in a hop that may take `work`.
  RearrangeOptions OfHop(std::int64_t work) const {
    RearrangeOptions options = {options_};
    options.side = static_cast<int>(std::clamp(tuning_.pixels_per_chart / width_, 112.0, 600.0));
    options.moves = tuning_.moves_at_once + tuning_.moves_at_once_per_chart * std::ssize(charts_.outlines);
    options.work = work;
    options.slack = std::min(tuning_.rearranging_slack, tuning_.slack_of_thickness * thickness_ * options.side);
    return options;
  }

  // Appends better arrangements to *found, which must not be empty. Each lane hops from one jammed arrangement to
  // another, and accepts results at most slightly worse than its record (record-to-record travel, Dueck 1993). The
  // first lane always adopts the best of all. The second may go farther from it, and returns to the best after
  // hops_away hops without a record. With little work there is one lane.
  void Search(std::int64_t growing, std::vector<Arrangement>* found) {
    struct Lane {
      Arrangement here;
      double record;  // the lane's largest scale since it left the best
      double step;
      int in_vain = 0;  // hops since the record
    };
    const double crowd = static_cast<double>(charts_.outlines.size()) / tuning_.first_step_charts;
    const double first_step = tuning_.first_step / std::sqrt(std::max(1.0, crowd));
    std::vector<Lane> lanes(options_.work < tuning_.one_lane_work ? 1 : kLanes);
    const auto begin_at_best = [&](Lane* lane) { *lane = {found->back(), found->back().scale, first_step}; };
    for (Lane& lane : lanes) begin_at_best(&lane);
    std::int64_t used = growing;
    for (std::uint64_t round = 0; used < options_.work && found->back().scale < options_.most_scale &&
                                  !execution_.IsCancelled() && !execution_.IsStopRequested();
         ++round) {
      std::array<std::optional<Arrangement>, kLanes> results;
      std::array<std::int64_t, kLanes> work = {};
      const auto run = [&](std::int64_t k, std::int64_t) {
        const Lane& lane = lanes[k];
        RearrangeOptions rearrange = OfHop((options_.work - used) / std::ssize(lanes));
        rearrange.seed = kLanes * round + k;
        results[k] = Hop(lane.here, lane.record * (1 - tuning_.hop_down[k]), 1 + lane.step, rearrange, &work[k]);
      };
      execution_.For(std::ssize(lanes), run, 1);
      for (std::size_t k = 0; k < lanes.size(); ++k) {
        Lane& lane = lanes[k];
        used += work[k];
        if (results[k]) lane.here = std::move(*results[k]);
        if (results[k] && lane.here.scale > lane.record) {
          lane.record = lane.here.scale;
          lane.in_vain = 0;
        } else {
          ++lane.in_vain;
          lane.step =
              lane.step > tuning_.least_step ? std::max(tuning_.least_step, lane.step * 0.6) : tuning_.step_again;
        }
        if (lane.here.scale > found->back().scale) found->push_back(lane.here);
      }
      if (found->back().scale > lanes[0].record) {
        lanes[0].here = found->back();
        lanes[0].record = found->back().scale;
        lanes[0].in_vain = 0;
      }
      if (lanes.size() > 1 && lanes[1].in_vain >= tuning_.hops_away) begin_at_best(&lanes[1]);
    }
  }

  // Goes from `here` to another jammed arrangement, at least_scale or a larger scale. Charts are rearranged at `growth`
  // times the scale. Overlaps may remain, since most vanish when the charts shrink again; nullopt if some do not.
  // Rearranging may take `options.work`, and separating and growing together as much again.
  std::optional<Arrangement> Hop(Arrangement here, double least_scale, double growth, const RearrangeOptions& options,
                                 std::int64_t* work) const {
    const double scale = here.scale * growth;
    Rearrange(charts_.simple, charts_.atlas, fields_, Scales(scale), options, execution_, &here.poses, work);
    here.scale = std::min(scale, (1 + tuning_.finest_growth) * least_scale);
    Relaxer relaxer = MakeRelaxer(here);
    const auto left = [&] { return options.work - relaxer.work(); };
    const bool apart = relaxer.Separate(tuning_.separating_steps, left());
    if (apart) {
      relaxer.Grow(20, left());
      relaxer.Grow(tuning_.finest_patience, left(), 1 + tuning_.finest_growth);
    }
    *work += relaxer.work();
    if (!apart) return std::nullopt;
    return Arrangement{relaxer.poses(), relaxer.scale()};
  }

  // Until here, distances were only sampled. Moves charts apart, or shrinks them slightly, until exact distances are
  // kept, and stores the result in arrangement_. Returns whether it succeeded.
  bool Settle(const Arrangement& arrangement, double least_scale) {
    Relaxer relaxer = MakeRelaxer(arrangement);
    if (relaxer.scale() > options_.most_scale) relaxer.set_scale(options_.most_scale);
    const auto left = [&] {
      return tuning_.settling_share * static_cast<double>(options_.work) - static_cast<double>(relaxer.work());
    };
    for (int round = 0;
         round < tuning_.settling_rounds && relaxer.scale() > least_scale && left() > 0 && !execution_.IsCancelled();
         ++round) {
      if (charts_.outlines.size() > tuning_.many_charts && execution_.IsStopRequested()) return false;
      const bool apart = relaxer.Separate(tuning_.separating_steps, std::llround(left()));
      if (apart) {
        const std::vector<TooNear> too_near = FindTooNear(charts_.outlines, Scales(relaxer.scale()), relaxer.poses(),
                                                          options_.distance, options_.low, execution_);
        if (too_near.empty()) {
          arrangement_ = {relaxer.poses(), relaxer.scale()};
          return true;
        }
        // Asks for more than is missing. Otherwise settling takes many more rounds (PackTuning::settling_margin).
        const double more = tuning_.settling_margin * relax_.tolerance;
        for (const TooNear& pair : too_near) {
          for (const std::int32_t i : {pair.a, pair.b}) {
            if (i >= 0) relaxer.margins()[i] += std::min(0.6 * pair.missing + more, relax_.tolerance);
          }
        }
      }
      if (!apart || round > 0) relaxer.set_scale(relaxer.scale() * tuning_.settling_shrink);
    }
    return false;
  }

  const TightenCharts& charts_;
  const TightenOptions& options_;
  const PackTuning& tuning_;
  const Execution& execution_;
  const std::vector<Arrangement>& starts_;
  Arrangement arrangement_;  // the best that keeps the exact distances
  double width_;             // of an average chart, in the atlas with the most charts
  double thickness_;         // mean thickness of charts: the width of a strip, half the side of a square
  RelaxOptions relax_;
  std::vector<DistanceField> fields_;
};

}  // namespace

std::int64_t MostCharts(const std::vector<int>& atlas, int atlases) {
  std::vector<std::int64_t> count(atlases, 0);
  for (const int a : atlas) ++count[a];
  return *std::max_element(count.begin(), count.end());
}

Arrangement Tighten(const TightenCharts& charts, const TightenOptions& options, const Execution& execution,
                    const std::vector<Arrangement>& starts) {
  return Tightener(charts, options, execution, starts).Run();
}

}  // namespace planish
