// Fewer, shorter and better hidden seams: charts are glued and seams are moved as long as that lowers the cost of all
// seams (core/charts/seam_cost.h), by estimates of maps.
#include <algorithm>
#include <cmath>
#include <map>
#include <queue>
#include <utility>

#include "core/mesh/visibility.h"
#include "core/unwrap/seam_paths.h"
#include "core/unwrap/steps.h"

namespace planish {
namespace {

constexpr double kWorthIt = 1e-6;  // in units of the cost
constexpr double kGoesOn = 1e-3;   // of the cost, that another round must be worth
constexpr std::size_t kArc = 48;   // half-edges of a path that are moved at once

class SeamSearch {
 public:
  SeamSearch(Job* job, const SeamCost& cost, ChartEstimates* estimates, Charts* charts)
      : job_(*job),
        tuning_(job->options.tuning),
        surface_(*charts->surface),
        cost_(cost),
        charts_(*charts),
        segmentation_(*charts->segmentation),
        estimates_(*estimates),
        router_(segmentation_, cost, tuning_),
        area_(segmentation_.charts().size(), 0.0),
        version_(area_.size(), 0) {
    for (std::int32_t i = 0; i < count(); ++i) Measure(i);
  }

  absl::Status Run(const Execution& execution) {
    for (std::int32_t i = 0; i < count() && GoesOn(); ++i) estimates_.Update(i);
    glue_left_ = tuning_.glue_estimates * surface_.num_faces();
    move_left_ = tuning_.move_estimates * surface_.num_faces();
    for (int round = 0; round < tuning_.seam_rounds && GoesOn(); ++round) {
      execution.Report(static_cast<double>(round) / tuning_.seam_rounds);
      const double gain = Glue() + Move();
      if (!(gain > kGoesOn)) break;
    }
    if (job_.execution.IsCancelled()) return absl::CancelledError("cancelled");
    segmentation_.DropEmpty();
    return absl::OkStatus();
  }

 private:
  struct Candidate {
    double gain;  // at most, as long as it is not known
    bool is_known;
    std::int64_t number;
    Segmentation::Joint joint;
    int version, other_version;

    bool operator<(const Candidate& o) const { return gain != o.gain ? gain < o.gain : number > o.number; }
  };

  bool GoesOn() const { return !job_.execution.IsCancelled() && !job_.execution.IsStopRequested(); }
  std::int32_t count() const { return static_cast<std::int32_t>(segmentation_.charts().size()); }

  void Measure(std::int32_t i) {
    area_[i] = 0;
    for (const std::int32_t f : segmentation_.charts()[i]) area_[i] += surface_.area[f];
  }
  double CostOf(std::int32_t i) const { return cost_.OfChart(estimates_.of(i).stretch, area_[i]); }
  bool IsSound(std::int32_t i) const {
    return charts_.ReductionOf(segmentation_.charts()[i]) == 1 && !IsToSplit(job_, charts_, i, estimates_.of(i));
  }

  // Queues the borders of a chart; unless `all`, those with charts of higher numbers.
  void Push(std::int32_t i, bool all) {
    std::vector<HalfedgeHandle> outline = segmentation_.Outline(i);
    const std::size_t edges = outline.size();
    for (const auto& [border, other] : BordersAlong(segmentation_.gluing(), segmentation_.chart(), &outline)) {
      if (!all && other < i) continue;
      if (edges + estimates_.of(other).outline.size() < 2 * border.size() + 3) continue;
      const double most = cost_.OfPath(border) + tuning_.chart_price;
      queue_.push({most, false, pushed_++, {i, other, {border.begin(), border.end()}}, version_[i], version_[other]});
    }
  }

  // What gluing there lowers the cost by; nothing if the two must stay apart. Leaves them glued if `keep`.
  std::optional<double> Try(const Segmentation::Joint& joint, bool keep) {
    const std::optional<Segmentation::Joined> joined = segmentation_.Join(joint);
    if (!joined) return std::nullopt;
    const std::int32_t i = joint.chart, j = joint.other;
    const double before = CostOf(i) + CostOf(j) + cost_.OfPath(joint.border), area = area_[i];
    ChartEstimate kept = estimates_.of(i);
    glue_left_ -= static_cast<double>(segmentation_.charts()[i].size());
    estimates_.Update(i);
    area_[i] += area_[j];
    std::optional<double> gain;
    if (IsSound(i)) gain = before - CostOf(i);
    if (gain && keep) {
      ++version_[i];
      ++version_[j];
      area_[j] = 0;
      return gain;
    }
    area_[i] = area;
    segmentation_.UndoJoin(*joined);
    estimates_.Restore(i, std::move(kept));
    return gain;
  }

  // Glues charts, where most is gained first. Returns what has been gained.
  double Glue() {
    double gained = 0;
    queue_ = {};
    for (std::int32_t i = 0; i < count(); ++i) {
      if (!segmentation_.charts()[i].empty()) Push(i, false);
    }
    while (!queue_.empty() && glue_left_ > 0 && GoesOn()) {
      Candidate best = queue_.top();
      queue_.pop();
      const auto [i, j, border] = best.joint;
      if (version_[i] != best.version || version_[j] != best.other_version) continue;
      if (!best.is_known) {
        const std::optional<double> gain = Try(best.joint, /*keep=*/false);
        if (!gain || !(*gain > kWorthIt)) continue;
        best.gain = *gain;
        best.is_known = true;
        queue_.push(std::move(best));
        continue;
      }
      const std::optional<double> gain = Try(best.joint, /*keep=*/true);
      if (!gain) continue;
      gained += *gain;
      Push(i, true);
    }
    return gained;
  }

  // Moves one seam, or part of one, if that lowers the cost. Returns by how much.
  double MovePart(std::span<const HalfedgeHandle> path, bool slides) {
    const Gluing& gluing = segmentation_.gluing();
    if (!IsPath(gluing, path)) return 0;
    const std::int32_t i = segmentation_.chart()[gluing.mesh().face_handle(path.front()).idx()];
    const std::int32_t j = segmentation_.chart()[surface_.face_across(path.front())];
    const std::optional<std::vector<HalfedgeHandle>> way = router_.Reroute(path, slides);
    if (!way || !segmentation_.MoveSeam(i, j, path, *way)) return 0;
    const std::vector<std::int32_t> both = i == j ? std::vector{i} : std::vector{i, j};
    std::vector<ChartEstimate> kept;
    double before = cost_.OfPath(path), after = cost_.OfPath(*way);
    bool is_sound = true;
    for (const std::int32_t k : both) {
      before += CostOf(k);
      kept.push_back(estimates_.of(k));
      estimates_.Update(k);
      Measure(k);
      move_left_ -= static_cast<double>(segmentation_.charts()[k].size());
      after += CostOf(k);
      is_sound = is_sound && IsSound(k);
    }
    if (is_sound && before - after > kWorthIt) {
      for (const std::int32_t k : both) ++version_[k];
      return before - after;
    }
    segmentation_.MoveSeam(i, j, *way, path);
    for (std::size_t k = 0; k < both.size(); ++k) {
      estimates_.Restore(both[k], std::move(kept[k]));
      Measure(both[k]);
    }
    return 0;
  }

  // Moves all seams, the dearest first. Returns what has been gained.
  double Move() {
    double gained = 0;
    const std::vector<SeamPath> paths = SeamPaths(segmentation_);
    std::vector<double> cost;
    for (const SeamPath& path : paths) cost.push_back(cost_.OfPath(path.half_edges));
    for (const std::int32_t p :
         SortedIndices(paths.size(), [&](std::int32_t a, std::int32_t b) { return cost[a] > cost[b]; })) {
      if (!GoesOn() || move_left_ <= 0) break;
      const std::span<const HalfedgeHandle> path = paths[p].half_edges;
      if (!paths[p].is_loop && path.size() <= kArc) {
        gained += MovePart(path, /*slides=*/true);
        continue;
      }
      const std::size_t arcs = std::max<std::size_t>(2, (path.size() + kArc - 1) / kArc);
      if (path.size() < 2 * arcs) continue;
      for (std::size_t k = 0; k < arcs && GoesOn(); ++k) {
        const std::size_t begin = k * path.size() / arcs, end = (k + 1) * path.size() / arcs;
        gained += MovePart(path.subspan(begin, end - begin), /*slides=*/false);
      }
    }
    return gained;
  }

  Job& job_;
  const AtlasTuning& tuning_;
  const Surface& surface_;
  const SeamCost& cost_;
  Charts& charts_;
  Segmentation& segmentation_;
  ChartEstimates& estimates_;
  SeamRouter router_;
  std::vector<double> area_;  // per chart
  std::vector<int> version_;  // per chart: grows whenever it changes
  std::priority_queue<Candidate> queue_;
  std::int64_t pushed_ = 0;
  double glue_left_ = 0, move_left_ = 0;  // faces that may be estimated again
};

}  // namespace

absl::Status ImproveSeams(Job* job, const Execution& execution, ChartEstimates* estimates, Charts* charts) {
  if (job->execution.IsStopRequested() || charts->segmentation->charts().empty()) return absl::OkStatus();
  const std::vector<float> visibility = FaceVisibility(job->mesh, job->execution);
  const SeamCost cost(*charts->surface, visibility, job->options.tuning, job->execution);
  if (job->execution.IsCancelled()) return absl::CancelledError("cancelled");
  return SeamSearch(job, cost, estimates, charts).Run(execution);
}

}  // namespace planish
