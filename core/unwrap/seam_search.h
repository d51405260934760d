// The search for fewer, shorter and better hidden seams: ImproveSeams() (steps.h).
#pragma once

#include <array>
#include <cstdint>
#include <limits>
#include <map>
#include <optional>
#include <queue>
#include <span>
#include <utility>
#include <vector>

#include "absl/status/statusor.h"
#include "core/charts/seam_cost.h"
#include "core/unwrap/seam_paths.h"
#include "core/unwrap/steps.h"

namespace planish {

// Charts are glued (seam_gluing.cc, seam_darts.cc) and seams are moved (seam_moving.cc) as long as that lowers the cost
// of all seams (core/charts/seam_cost.h), by estimates of maps. Joints and seams are decided in the order of one
// thread. Several threads estimate ahead the charts that no undecided joint or seam before can change.
class SeamSearch {
 public:
  // All must outlive this.
  SeamSearch(Job* job, const SeamCost& cost, const Execution& execution, ChartEstimates* estimates, Charts* charts);

  // Improves the seams. Returns the cost of all seams and charts at the end.
  absl::StatusOr<double> Run();

 private:
  static constexpr double kWorthIt = 1e-4;  // in units of the cost
  // With several threads, how many joints or paths are looked at ahead, for estimates that are made side by side. The
  // result is the same for any number.
  static constexpr int kAheadPerThread = 4;

  bool GoesOn() const { return !job_.execution.IsCancelled() && !job_.execution.IsStopRequested(); }
  void Tell() const {
    const double left =
        std::max(0.0, glue_left_) + std::max(0.0, dart_left_) + std::max(0.0, move_left_) + std::max(0.0, crumb_left_);
    execution_.Report(1 - left / all_left_);
  }
  std::int32_t count() const { return static_cast<std::int32_t>(segmentation_.charts().size()); }

  void Measure(std::int32_t i);
  // Before ChartEstimates::Trace(), a lower limit.
  double CostOf(std::int32_t i) const {
    return cost_.OfChart(estimates_.of(i).stretch, area_[i], estimates_.of(i).waste);
  }
  // Whether the stretch of its map does not rule out that it is sound.
  bool MayBeSound(std::int32_t i) const;
  bool IsSound(std::int32_t i) const {
    return charts_.ReductionOf(segmentation_.charts()[i]) == 1 && !IsToSplit(job_, charts_, i, estimates_.of(i));
  }

  // ---- Mirror images.

  std::int32_t ImageOf(std::int32_t i) const { return charts_.image.empty() ? -1 : charts_.image[i]; }
  // The mirror image of a half-edge, on the side of the image of its face; invalid if there is none.
  HalfedgeHandle ImageOf(HalfedgeHandle h) const;
  // The mirror image of consecutive half-edges, which runs the other way; empty if an edge has no image.
  std::vector<HalfedgeHandle> ImageOf(std::span<const HalfedgeHandle> path) const;
  // Whether two paths have an edge in common.
  static bool Meet(std::span<const HalfedgeHandle> path, std::span<const HalfedgeHandle> other);
  std::int32_t ChartOf(HalfedgeHandle h) const;
  std::int32_t ChartAcross(HalfedgeHandle h) const { return segmentation_.chart()[surface_.face_across(h)]; }

  // A failed attempt to lower the cost by gluing two charts at a border, or by moving it. failed_ holds these by the
  // first half-edge and the number of half-edges of the border. A border is tried again once one of its charts, or of
  // their mirror images, has changed; on large surfaces not in the same round, since larger charts seldom succeed where
  // smaller ones failed.
  struct Tried {
    int round;
    std::int32_t chart, other;
    std::int64_t versions;
  };
  using BorderKey = std::pair<std::int32_t, std::size_t>;
  std::int64_t Versions(std::int32_t i, std::int32_t j) const;
  void Fail(BorderKey key, std::int32_t i, std::int32_t j) { failed_[key] = {round_, i, j, Versions(i, j)}; }
  bool HasFailed(BorderKey key, std::int32_t i, std::int32_t j) const;

  // ---- Gluing.

  struct Candidate {
    double gain;  // an upper bound unless `is_known`
    bool is_known;
    std::int64_t number;
    Segmentation::Joint joint;
    int version, other_version;

    bool operator<(const Candidate& o) const { return gain != o.gain ? gain < o.gain : number > o.number; }
  };

  // Charts that are glued together, and their state before.
  struct Glued {
    std::vector<Segmentation::Joined> joined;
    std::vector<std::array<double, 2>> areas;
    std::vector<std::pair<std::int32_t, ChartEstimates::Other>> estimates;
  };

  // The estimate of the chart that gluing a candidate would make.
  struct Draft {
    std::int32_t chart, other;
    int version, other_version;
    ChartEstimates::Other estimate;
  };

  // Whether these two charts are the mirror images of two charts with lower numbers, and are glued together with those.
  bool IsImage(std::int32_t i, std::int32_t j) const;
  // Queues the borders between this chart and others; unless `all`, only others with higher numbers. Leaves out pairs
  // of charts that are both larger than `most_area`.
  void Push(std::int32_t i, bool all, double most_area);
  bool Join(const Segmentation::Joint& joint, Glued* glued);
  // Estimates the chart in its present shape, or takes the estimate of `draft`. Returns its cost; nullopt if its map is
  // not sound. If is_of_use(cost) is false, the map is not examined.
  template <class IsOfUse>
  std::optional<double> Estimate(std::int32_t i, const IsOfUse& is_of_use, std::optional<Draft> draft, Glued* glued);
  void Undo(Glued* glued);
  // These half-edges as a border of charts i and j; nullopt if they do not lie between the two, or not one after the
  // other on both outlines.
  std::optional<Segmentation::Joint> BorderOf(std::int32_t i, std::int32_t j, std::vector<HalfedgeHandle> border) const;
  // Glues two charts, and their mirror images alike, if that lowers the cost by at least `least`. Returns by how much
  // gluing lowers the cost, done or not; nullopt if the charts must stay apart.
  std::optional<double> Try(const Segmentation::Joint& joint, double least, std::optional<Draft> draft = {});
  bool IsCurrent(std::int32_t i, int version, std::int32_t j, int other_version) const {
    return version_[i] == version && version_[j] == other_version;
  }
  // Whether Try() first estimates the chart that consists of these two alone.
  bool MayBeDrafted(const Segmentation::Joint& joint) const;
  std::optional<Draft> TakeDraft(const Candidate& candidate);
  // With several threads: makes drafts of this candidate and of some of the next ones, no two with a chart in common.
  void MakeDrafts(const Candidate& best);
  // Glues pairs of charts, the pair with the largest gain first. Leaves out pairs that are both larger than
  // `most_area`. Returns the total gain.
  double Glue(double most_area = std::numeric_limits<double>::infinity());
  // Glues small charts. They gain little and come last, so glue_left_ may be used up before.
  void GlueCrumbs();

  // ---- Darts (seam_darts.cc).

  // The part of a border that lowers the cost most, of some parts, if it is glued and the rest becomes a dart; nullopt
  // if none does.
  std::optional<Segmentation::Joint> BestPart(const Segmentation::Joint& joint);
  // Glues parts of the dearest borders. Returns the total gain.
  double SewDarts();

  // ---- Moving.

  // A seam that is moved, together with its mirror image. `charts` are the charts beside them. The first of these have
  // new estimates; `before` has their estimates before the move, and `costs` their costs then.
  struct Moved {
    struct Part {
      std::int32_t chart, other;
      std::vector<HalfedgeHandle> from, to;
    };
    BorderKey key;
    std::int32_t chart, other;  // beside the path
    std::vector<Part> parts;    // empty if there was no cheaper way
    std::vector<std::int32_t> charts;
    std::vector<ChartEstimates::Other> before;
    std::vector<double> costs;
  };

  // A seam, or a part of one, to be moved.
  struct Step {
    std::span<const HalfedgeHandle> path;
    bool slides;
    bool is_first;                          // of the parts of its seam
    bool is_ahead = false;                  // whether Reroute() has been called
    std::vector<std::int32_t> charts = {};  // ChartsOf() the path before Reroute()
    std::optional<Moved> moved = {};        // the result of Reroute()
  };

  // Moves one seam, or part of one, and its mirror image alike, where there is a cheaper way within `band` edges.
  // Keep() decides. Nothing if the path is not to be moved.
  std::optional<Moved> Reroute(std::span<const HalfedgeHandle> path, bool slides, int band);
  // Estimates moved->charts[at] as it is after the move.
  void EstimateMoved(std::size_t at, Moved* moved);
  // Whether chart i was not sound before a move, and is not stretched more after it, unless within the limit.
  bool IsNoWorse(const ChartEstimate& before, const ChartEstimate& after, std::int32_t i) const;
  static void MakeRoom(std::size_t estimates, Moved* moved) {
    moved->before.resize(estimates);
    moved->costs.resize(estimates);
  }
  // Keeps the move if that lowers the cost, and undoes it otherwise. Returns the gain; 0 if it was undone.
  double Keep(Moved* moved);
  // Whether a way runs inside the two charts beside a path, from outline to outline. The ways of SeamRouter do; the
  // mirror image of such a way may not, once the way has become a seam.
  bool CanLeadTo(std::span<const HalfedgeHandle> path, const std::vector<HalfedgeHandle>& way) const;
  // Moves the seam `path` to `way`, and records that in `moved`. Returns false if the seam cannot go there.
  bool MoveTo(std::span<const HalfedgeHandle> path, const std::vector<HalfedgeHandle>& way, Moved* moved);
  void UndoMove(Moved* moved);
  // Whether the vertex where a half-edge ends is its own mirror image.
  bool EndsOnPlane(HalfedgeHandle h) const;
  // All seams, the most expensive first. `paths` must outlive them.
  std::vector<Step> StepsOf(const std::vector<SeamPath>& paths) const;
  // The charts beside a path and beside its mirror image, and the mirror images of these charts.
  std::vector<std::int32_t> ChartsOf(std::span<const HalfedgeHandle> path) const;
  // Moves the seam of the first of these steps. With several threads also moves the seams of those among the next steps
  // that have no chart in common with an earlier step, and estimates the first two charts of each. A step depends on
  // nothing, and changes nothing, but the charts of ChartsOf(), so the result is that of steps in their order.
  void MoveAhead(std::span<Step> steps);
  // Moves all seams, the most expensive first. Returns the total gain.
  double Move();
  // Cuts paths where they cross the mirror plane. Leaves out parts on the second side that have a mirror image.
  std::vector<SeamPath> OfOneSide(const std::vector<SeamPath>& paths) const;

  Job& job_;
  const AtlasTuning& tuning_;
  const Surface& surface_;
  const SeamCost& cost_;
  Charts& charts_;
  Segmentation& segmentation_;
  ChartEstimates& estimates_;
  SeamRouter router_;
  const Execution& execution_;
  std::vector<double> area_;  // per chart
  std::vector<int> version_;  // per chart: grows whenever the chart changes
  std::priority_queue<Candidate> queue_;
  std::map<std::int64_t, Draft> drafts_;  // by Candidate::number
  std::map<BorderKey, Tried> failed_;
  std::vector<int> stamps_;  // per chart: stamp_ if it is taken
  int stamp_ = 0;
  std::int64_t pushed_ = 0;
  int round_ = 0;
  // Faces that may still be estimated again; all_left_: in all, at first.
  double glue_left_ = 0, dart_left_ = 0, move_left_ = 0, crumb_left_ = 0, all_left_ = 0;
};

}  // namespace planish
