// Joining: after cuts, some charts can be joined again, often with other neighbours than before.
//
// Whether two charts are worth a try is estimated from their maps: one is rotated and moved so that the outlines meet
// where they would be glued. Then both are solved as one chart, and stay joined if its map is sound.
#include <algorithm>
#include <cmath>
#include <map>
#include <numbers>
#include <optional>
#include <unordered_map>
#include <utility>

#include "core/base/status_macros.h"
#include "core/base/timer.h"
#include "core/pack/outline.h"
#include "core/unwrap/steps.h"

namespace planish {
namespace {

// The last round is the one in which fewer than one in this many of the tried pairs stay joined.
constexpr std::ptrdiff_t kTriesPerJoint = 8;

// Figures of a chart that joining uses.
struct Shape {
  std::vector<Vec2> hull;
  double hull_area = 0, area = 0, perimeter = 0;  // area and perimeter on the surface
  int version = 0;                                // grows with each joining into this chart
  bool may_join = false;

  double Compactness() const { return 4 * std::numbers::pi * area / (perimeter * perimeter); }
};

// Moves one map next to another: a rotation by the unit complex number `turn`, then an offset.
struct Motion {
  Vec2 turn = Vec2(1, 0), offset = Vec2::Zero();
  double misfit = 0;  // root mean square distance

  Vec2 operator()(const Vec2& p) const {
    return Vec2(turn.x() * p.x() - turn.y() * p.y(), turn.y() * p.x() + turn.x() * p.y()) + offset;
  }
};

// The best rigid motion from `from` to `to`; nullopt if all points of either coincide.
std::optional<Motion> Fit(const std::vector<Vec2>& from, const std::vector<Vec2>& to) {
  const auto n = static_cast<double>(from.size());
  Vec2 centre_from = Vec2::Zero(), centre_to = Vec2::Zero();
  for (std::size_t i = 0; i < from.size(); ++i) {
    centre_from += from[i] / n;
    centre_to += to[i] / n;
  }
  Vec2 turn = Vec2::Zero();
  for (std::size_t i = 0; i < from.size(); ++i) {
    const Vec2 p = from[i] - centre_from, q = to[i] - centre_to;
    turn += Vec2(p.dot(q), p.x() * q.y() - p.y() * q.x());
  }
  const double length = turn.norm();
  if (!(length > 0) || !std::isfinite(length)) return std::nullopt;
  Motion motion;
  motion.turn = turn / length;
  motion.offset = centre_to - motion(centre_from);
  double squares = 0;
  for (std::size_t i = 0; i < from.size(); ++i) squares += (motion(from[i]) - to[i]).squaredNorm();
  motion.misfit = std::sqrt(squares / n);
  return motion;
}

// The maps of solved charts. Joining accesses maps through this class or EstimatedMaps, which has the same members.
class SolvedMaps {
 public:
  using Kept = MappedChart;  // the state of a chart that PutBack() restores after Take()

  SolvedMaps(Job* job, Charts* charts) : job_(*job), charts_(*charts) {}

  // Calls visit(h, start of h in the map) for every half-edge h of the outline. Without a map, calls nothing.
  template <class Visit>
  void ForEachOnOutline(std::int32_t i, const Visit& visit) const {
    const MappedChart& mapped = charts_.charts[i];
    const Chart& chart = mapped.chart;
    for (std::int32_t c = 0; mapped.status.ok() && c < chart.topology->num_corners(); ++c) {
      if (chart.topology->opposite[c] >= 0) continue;
      visit(HalfEdgeOf(*charts_.surface->mesh, 3 * chart.faces[c / 3] + c % 3),
            mapped.map.positions[Origin(chart.topology->faces, c)]);
    }
  }

  std::vector<HalfedgeHandle> Outline(std::int32_t i) const { return charts_.segmentation->Outline(i); }

  // Whether the chart may be joined, or stay joined.
  bool IsSound(std::int32_t i) const {
    const MappedChart& mapped = charts_.charts[i];
    const std::vector<double>& least = mapped.chart.least_angle;
    const bool is_widened = std::any_of(least.begin(), least.end(), [](double angle) { return angle > 0; });
    return mapped.status.ok() && !mapped.map.flatten->stopped && mapped.chart.enlargement == 1 && !is_widened &&
           !IsToSplit(job_, charts_, mapped);
  }

  Kept Take(std::int32_t i) { return std::exchange(charts_.charts[i], {}); }
  void PutBack(std::int32_t i, Kept kept) { charts_.charts[i] = std::move(kept); }

  // Solves these charts with their present faces in the segmentation.
  absl::Status Map(const std::vector<std::int32_t>& todo) {
    Timer timer;
    for (const std::int32_t i : todo) ExtractChart(i, job_.execution, &charts_);
    job_.seconds.charts += timer.Restart();
    return SolveCharts(&job_, todo, &charts_);
  }

  // See Segmentation::DropEmpty().
  void DropEmpty() {
    std::erase_if(charts_.charts, [](const MappedChart& mapped) { return mapped.chart.faces.empty(); });
  }

 private:
  Job& job_;
  Charts& charts_;
};

// Estimated maps, before any chart is solved.
class EstimatedMaps {
 public:
  using Kept = ChartEstimate;

  EstimatedMaps(const Job& job, const Charts& charts, ChartEstimates* estimates)
      : job_(job), charts_(charts), estimates_(*estimates) {}

  template <class Visit>
  void ForEachOnOutline(std::int32_t i, const Visit& visit) const {
    const ChartEstimate& estimate = estimates_.of(i);
    for (std::size_t k = 0; k < estimate.outline.size(); ++k) visit(estimate.outline[k], estimate.points[k]);
  }

  std::vector<HalfedgeHandle> Outline(std::int32_t i) const { return estimates_.of(i).outline; }

  bool IsSound(std::int32_t i) const {
    return charts_.ReductionOf(charts_.segmentation->charts()[i]) == 1 &&
           !IsToSplit(job_, charts_, i, estimates_.of(i));
  }

  Kept Take(std::int32_t i) { return estimates_.of(i); }
  void PutBack(std::int32_t i, Kept kept) { estimates_.Restore(i, std::move(kept)); }

  absl::Status Map(const std::vector<std::int32_t>& todo) {
    estimates_.Update(todo, job_.execution);
    return job_.execution.IsCancelled() ? absl::CancelledError("cancelled") : absl::OkStatus();
  }

  // The estimates are not used any more.
  void DropEmpty() {}

 private:
  const Job& job_;
  const Charts& charts_;
  ChartEstimates& estimates_;
};

template <class Maps>
class Joining {
 public:
  // `work`: how many faces may be mapped again.
  Joining(Job* job, Charts* charts, Maps maps, double work)
      : job_(*job),
        maps_(std::move(maps)),
        charts_(*charts),
        segmentation_(*charts->segmentation),
        surface_(*charts->surface),
        tuning_(job->options.tuning),
        place_(surface_.mesh->n_halfedges()),
        shapes_(segmentation_.charts().size()),
        left_(work) {
    for (std::int32_t i = 0; i < static_cast<std::int32_t>(shapes_.size()); ++i) Measure(i);
  }

  absl::Status Run() {
    for (int round = 0; round < tuning_.join_rounds; ++round) {
      PLANISH_ASSIGN_OR_RETURN(const bool goes_on, Round());
      if (!goes_on) break;
    }
    segmentation_.DropEmpty();
    maps_.DropEmpty();
    return absl::OkStatus();
  }

 private:
  // For a joint: how much joining would increase the area of the hulls, and the joint's length on the surface.
  struct Look {
    double hull_growth, length;
  };

  // A pair that is being tried.
  struct Attempt {
    typename Maps::Kept chart, other;  // the maps of the two before
    Segmentation::Joined joined;
  };

  void Measure(std::int32_t i) {
    Shape& shape = shapes_[i];
    shape.area = shape.perimeter = 0;
    for (const std::int32_t f : segmentation_.charts()[i]) shape.area += surface_.area[f];
    std::vector<Vec2> points;
    maps_.ForEachOnOutline(i, [&](HalfedgeHandle h, const Vec2& begin) {
      shape.perimeter += surface_.length(h);
      place_[h.idx()] = begin;
      points.push_back(begin);
    });
    shape.hull = ConvexHull(std::move(points));
    shape.hull_area = AreaWithin(shape.hull);
    shape.may_join = maps_.IsSound(i);
  }

  // The number of faces of the two charts; nullopt if the joint is not worth a try.
  std::optional<std::size_t> Consider(const Segmentation::Joint& joint) {
    const Shape &one = shapes_[joint.chart], &other = shapes_[joint.other];
    if (!one.may_join || !other.may_join) return std::nullopt;
    const std::pair versions(one.version, other.version);
    const auto failed = failed_.find({joint.chart, joint.other});
    if (failed != failed_.end() && failed->second == versions) return std::nullopt;
    auto [known, is_new] = looks_.try_emplace(joint.border.front().idx());
    if (is_new || known->second.versions != versions) known->second = {versions, LookAt(joint)};
    const std::optional<Look>& look = known->second.look;
    if (!look || (job_.options.IsForPacker() && look->hull_growth > MostCost(look->length))) return std::nullopt;
    return segmentation_.charts()[joint.chart].size() + segmentation_.charts()[joint.other].size();
  }

  // Figures of the joined chart, estimated from the two maps; nullopt if the joint must not be tried.
  std::optional<Look> LookAt(const Segmentation::Joint& joint) const {
    const Shape &one = shapes_[joint.chart], &other = shapes_[joint.other];
    double length = 0, mapped_length = 0;
    for (const HalfedgeHandle h : joint.border) length += surface_.length(h);
    const double area = one.area + other.area, perimeter = one.perimeter + other.perimeter - 2 * length;
    const double compactness = perimeter > 0 ? 4 * std::numbers::pi * area / (perimeter * perimeter) : 0;
    const Shape& larger = one.area < other.area ? other : one;
    if (compactness < tuning_.compactness && compactness < larger.Compactness()) return std::nullopt;
    std::vector<Vec2> from, to;
    for (const HalfedgeHandle h : joint.border) {
      const Gluing& gluing = segmentation_.gluing();
      const HalfedgeHandle across = surface_.mesh->opposite_halfedge_handle(h);
      from.insert(from.end(), {place_[gluing.After(across).idx()], place_[across.idx()]});
      to.insert(to.end(), {place_[h.idx()], place_[gluing.After(h).idx()]});
      mapped_length += (to[to.size() - 1] - to[to.size() - 2]).norm();
    }
    const std::optional<Motion> motion = Fit(from, to);
    if (!motion || !(motion->misfit <= tuning_.join_misfit * mapped_length)) return std::nullopt;
    std::vector<Vec2> points = one.hull;
    for (const Vec2& p : other.hull) points.push_back((*motion)(p));
    const double hull = AreaWithin(ConvexHull(std::move(points)));
    if (hull < area) return std::nullopt;  // they would overlap
    return Look{hull - one.hull_area - other.hull_area, length};
  }

  // The increase of convex hulls that joining may cost the packer.
  double MostCost(double length) const {
    return PackerCutsFor(job_.options).join_gain * (necks_.least_gain + necks_.width * length);
  }

  absl::StatusOr<bool> Round() {
    if (job_.execution.IsStopRequested()) return false;
    Timer timer;
    PLANISH_RETURN_IF_ERROR(job_.Enter(UnwrapStage::kCharts));
    necks_ = NecksOf(charts_, job_.options);
    std::vector<std::vector<HalfedgeHandle>> outlines;
    for (std::int32_t i = 0; i < std::ssize(shapes_); ++i) outlines.push_back(maps_.Outline(i));
    const std::vector<Segmentation::Joint> joints = segmentation_.Joints(std::move(outlines));
    // Faces of both charts, and the index of the joint. The smallest are tried first, since work is counted in faces.
    std::vector<std::pair<std::size_t, std::size_t>> candidates;
    for (std::size_t i = 0; i < joints.size() && !job_.execution.IsCancelledAt(static_cast<std::int64_t>(i)); ++i) {
      if (const std::optional<std::size_t> faces = Consider(joints[i])) candidates.emplace_back(*faces, i);
    }
    std::sort(candidates.begin(), candidates.end());
    std::vector<Attempt> attempts;
    std::vector<char> taken(shapes_.size(), 0);
    for (const auto& [faces, number] : candidates) {
      const Segmentation::Joint& joint = joints[number];
      if (taken[joint.chart] || taken[joint.other] || static_cast<double>(faces) > left_) continue;
      std::optional<Segmentation::Joined> joined = segmentation_.Join(joint);
      if (!joined) {
        NoteFailed(joint.chart, joint.other);
        continue;
      }
      taken[joint.chart] = taken[joint.other] = 1;
      left_ -= static_cast<double>(faces);
      attempts.push_back({maps_.Take(joined->chart), maps_.Take(joined->other), *std::move(joined)});
    }
    job_.seconds.charts += timer.Restart();
    std::vector<std::int32_t> todo;
    for (const Attempt& attempt : attempts) todo.push_back(attempt.joined.chart);
    PLANISH_RETURN_IF_ERROR(maps_.Map(todo));
    std::ptrdiff_t joined = 0;
    for (Attempt& attempt : attempts) joined += Settle(&attempt) ? 1 : 0;
    return joined > 0 && kTriesPerJoint * joined >= std::ssize(attempts);
  }

  // Keeps the joined chart if its map is sound; otherwise restores the two charts.
  bool Settle(Attempt* attempt) {
    const std::int32_t i = attempt->joined.chart, j = attempt->joined.other;
    const double hulls = shapes_[i].hull_area + shapes_[j].hull_area;
    const int version = std::max(shapes_[i].version, shapes_[j].version) + 1;
    Measure(i);
    double length = 0;
    for (const HalfedgeHandle h : attempt->joined.border.glued) length += surface_.length(h);
    const bool packs_well = !job_.options.IsForPacker() || shapes_[i].hull_area - hulls <= MostCost(length);
    if (shapes_[i].may_join && packs_well) {
      shapes_[i].version = version;
      shapes_[j] = {};
      return true;
    }
    if (!charts_.least_angle.empty()) {
      for (const std::int32_t f : segmentation_.charts()[i]) charts_.least_angle[f] = 0;
    }
    segmentation_.UndoJoin(attempt->joined);
    maps_.PutBack(i, std::move(attempt->chart));
    maps_.PutBack(j, std::move(attempt->other));
    Measure(i);
    Measure(j);
    NoteFailed(i, j);
    return false;
  }

  void NoteFailed(std::int32_t i, std::int32_t j) { failed_[{i, j}] = {shapes_[i].version, shapes_[j].version}; }

  Job& job_;
  Maps maps_;
  Charts& charts_;
  Segmentation& segmentation_;
  const Surface& surface_;
  const AtlasTuning& tuning_;
  std::vector<Vec2> place_;    // per half-edge on the outline: its start in its chart's map
  std::vector<Shape> shapes_;  // per chart
  NeckOptions necks_;
  double left_;  // faces that may still be solved again
  // The last Look at each joint, by the first half-edge of its border, with the versions of the charts. A chart with
  // hundreds of neighbours has a long outline, and computing its hull in every round took most of the time of such
  // meshes.
  struct VersionedLook {
    std::pair<int, int> versions;
    std::optional<Look> look;
  };
  std::unordered_map<int, VersionedLook> looks_;
  // Charts that could not be joined, by their numbers, with their versions at that time.
  std::map<std::pair<std::int32_t, std::int32_t>, std::pair<int, int>> failed_;
};

}  // namespace

absl::Status JoinCharts(Job* job, Charts* charts) {
  const bool may_join = job->options.seams.policy == SeamPolicy::kAuto && charts->count() > 1;
  if (!may_join || job->execution.IsStopRequested()) return absl::OkStatus();
  const AtlasTuning& tuning = job->options.tuning;
  const double work = std::min(tuning.join_faces * charts->surface->num_faces(), tuning.most_join_faces);
  return Joining(job, charts, SolvedMaps(job, charts), work).Run();
}

absl::Status JoinEstimated(Job* job, ChartEstimates* estimates, Charts* charts) {
  if (job->execution.IsStopRequested()) return absl::OkStatus();
  const double work = job->options.tuning.join_estimates * charts->surface->num_faces();
  return Joining(job, charts, EstimatedMaps(*job, *charts, estimates), work).Run();
}

}  // namespace planish
