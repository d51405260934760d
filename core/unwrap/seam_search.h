// The search for fewer, shorter and better hidden seams: ImproveSeams() (steps.h).
#pragma once

#include <array>
#include <cstdint>
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

// Charts are glued (seam_gluing.cc) and seams are moved (seam_moving.cc) as long as that lowers the cost of all seams
// (core/charts/seam_cost.h), by estimates of maps. The order is that of one thread. Several threads estimate ahead what
// is about other charts than all decisions that have not been made yet.
class SeamSearch {
 public:
  // All must outlive this.
  SeamSearch(Job* job, const SeamCost& cost, const Execution& execution, ChartEstimates* estimates, Charts* charts);

  // Returns what all seams and charts cost then.
  absl::StatusOr<double> Run();

 private:
  static constexpr double kWorthIt = 1e-4;  // in units of the cost
  // With several threads, how many joints or paths are looked at ahead, for estimates that are made side by side. The
  // result is the same for any number.
  static constexpr int kAheadPerThread = 4;

  bool GoesOn() const { return !job_.execution.IsCancelled() && !job_.execution.IsStopRequested(); }
  void Tell() const { execution_.Report(1 - (std::max(0.0, glue_left_) + std::max(0.0, move_left_)) / all_left_); }
  std::int32_t count() const { return static_cast<std::int32_t>(segmentation_.charts().size()); }

  void Measure(std::int32_t i);
  double CostOf(std::int32_t i) const { return cost_.OfChart(estimates_.of(i).stretch, area_[i]); }
  // Whether the stretch of its map does not rule out that it is sound.
  bool MayBeSound(std::int32_t i) const;
  bool IsSound(std::int32_t i) const {
    return charts_.ReductionOf(segmentation_.charts()[i]) == 1 && !IsToSplit(job_, charts_, i, estimates_.of(i));
  }

  // ---- Mirror images.

  std::int32_t ImageOf(std::int32_t i) const { return charts_.image.empty() ? -1 : charts_.image[i]; }
  // The mirror image of a half-edge, whose face is the image of its face; maybe invalid.
  HalfedgeHandle ImageOf(HalfedgeHandle h) const;
  // The mirror image of consecutive half-edges, which runs the other way; empty if an edge has no image.
  std::vector<HalfedgeHandle> ImageOf(std::span<const HalfedgeHandle> path) const;
  // Whether two paths have an edge in common.
  static bool Meet(std::span<const HalfedgeHandle> path, std::span<const HalfedgeHandle> other);
  std::int32_t ChartOf(HalfedgeHandle h) const;
  std::int32_t ChartAcross(HalfedgeHandle h) const { return segmentation_.chart()[surface_.face_across(h)]; }

  // Borders whose charts could not be glued, or moved, for less cost; the key is the first half-edge and the number of
  // half-edges. A border is tried again once one of its charts, or of their mirror images, has changed; on large
  // surfaces not in the same round, since larger charts seldom succeed where smaller ones failed.
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
    double gain;  // at most, as long as it is not known
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

  // The estimate of what gluing a candidate makes, before that is decided.
  struct Draft {
    std::int32_t chart, other;
    int version, other_version;
    ChartEstimates::Other estimate;
  };

  // Whether gluing these two charts is what gluing the images of two of lower numbers does.
  bool IsImage(std::int32_t i, std::int32_t j) const;
  // Queues the borders of a chart; unless `all`, those with charts of higher numbers.
  void Push(std::int32_t i, bool all);
  bool Join(const Segmentation::Joint& joint, Glued* glued);
  // The cost of the chart now; nothing if its map is not sound. Maps of a cost that is no use are not looked at.
  template <class IsOfUse>
  std::optional<double> Estimate(std::int32_t i, const IsOfUse& is_of_use, std::optional<Draft> draft, Glued* glued);
  void Undo(Glued* glued);
  // These half-edges as a border of charts i and j; nothing if they do not lie between the two.
  std::optional<Segmentation::Joint> BorderOf(std::int32_t i, std::int32_t j, std::vector<HalfedgeHandle> border) const;
  // Glues two charts, and their mirror images alike, if that lowers the cost by so much at least. Returns by how much
  // it would; nothing if they must stay apart.
  std::optional<double> Try(const Candidate& candidate, double least);
  bool IsCurrent(std::int32_t i, int version, std::int32_t j, int other_version) const {
    return version_[i] == version && version_[j] == other_version;
  }
  // Whether gluing the two makes one chart of these two alone, which is estimated first.
  bool MayBeDrafted(const Segmentation::Joint& joint) const;
  std::optional<Draft> TakeDraft(const Candidate& candidate);
  // Makes drafts of this candidate and of some of the next, which have no chart in common.
  void MakeDrafts(const Candidate& best);
  // Glues charts, where most is gained first. Returns what has been gained.
  double Glue();

  // ---- Moving.

  // A seam that is moved, together with its mirror image. `charts` are the charts beside them; the first of these have
  // new estimates. `before` are those before the move, and `costs` what they cost then.
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
    bool is_ahead = false;                  // it has been looked at
    std::vector<std::int32_t> charts = {};  // then: ChartsOf() its path before
    std::optional<Moved> moved = {};        // then: what Reroute() did
  };

  // Moves one seam, or part of one, and its mirror image alike, where there is a cheaper way. Keep() decides. Nothing
  // if the path is not to be moved.
  std::optional<Moved> Reroute(std::span<const HalfedgeHandle> path, bool slides);
  // Replaces the estimate of the next of the charts; `at` is its place in `before` and `costs`.
  void EstimateMoved(std::size_t at, Moved* moved);
  static void MakeRoom(std::size_t estimates, Moved* moved) {
    moved->before.resize(estimates);
    moved->costs.resize(estimates);
  }
  // Keeps the move if that lowers the cost, and puts everything back otherwise. Returns by how much it does.
  double Keep(Moved* moved);
  // Whether a way runs inside the two charts beside a path, from outline to outline. The ways of SeamRouter do; the
  // mirror image of such a way may not, once the way has become a seam.
  bool CanLeadTo(std::span<const HalfedgeHandle> path, const std::vector<HalfedgeHandle>& way) const;
  // Leads a seam another way; returns whether it can go there.
  bool MoveTo(std::span<const HalfedgeHandle> path, const std::vector<HalfedgeHandle>& way, Moved* moved);
  void UndoMove(Moved* moved);
  // Whether the vertex where a half-edge ends is its own mirror image.
  bool EndsOnPlane(HalfedgeHandle h) const;
  // All seams, the dearest first. `paths` must outlive them.
  std::vector<Step> StepsOf(const std::vector<SeamPath>& paths) const;
  // The charts beside a path and beside its mirror image, and the mirror images of these charts.
  std::vector<std::int32_t> ChartsOf(std::span<const HalfedgeHandle> path) const;
  // Moves the seam of the first of these steps, and those of some of the next ones that have no chart in common with a
  // step before them. A step depends on nothing, and changes nothing, but ChartsOf() its path, so that all is as if it
  // had waited for its turn. Estimates the first two charts of each.
  void MoveAhead(std::span<Step> steps);
  // Moves all seams, the dearest first. Returns what has been gained.
  double Move();
  // Paths that end where they cross the plane, without those whose images are among the others.
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
  std::vector<int> version_;  // per chart: grows whenever it changes
  std::priority_queue<Candidate> queue_;
  std::map<std::int64_t, Draft> drafts_;  // by Candidate::number
  std::map<BorderKey, Tried> failed_;
  std::vector<int> stamps_;  // per chart: stamp_ if it is taken
  int stamp_ = 0;
  std::int64_t pushed_ = 0;
  int round_ = 0;
  double glue_left_ = 0, move_left_ = 0, all_left_ = 0;  // faces that may be estimated again; at first
};

}  // namespace planish
