// Fewer, shorter and better hidden seams: charts are glued and seams are moved as long as that lowers the cost of all
// seams (core/charts/seam_cost.h), by estimates of maps.
#include <algorithm>
#include <cmath>
#include <map>
#include <memory>
#include <optional>
#include <queue>
#include <utility>

#include "core/base/status_macros.h"
#include "core/mesh/symmetry.h"
#include "core/mesh/visibility.h"
#include "core/unwrap/seam_paths.h"
#include "core/unwrap/steps.h"

namespace planish {
namespace {

constexpr double kWorthIt = 1e-4;  // in units of the cost
constexpr double kGoesOn = 1e-3;   // of the cost, that another round must be worth
constexpr std::size_t kArc = 48;   // half-edges of a path that are moved at once

class SeamSearch {
 public:
  SeamSearch(Job* job, const SeamCost& cost, const Execution& execution, ChartEstimates* estimates, Charts* charts)
      : job_(*job),
        tuning_(job->options.tuning),
        surface_(*charts->surface),
        cost_(cost),
        charts_(*charts),
        segmentation_(*charts->segmentation),
        estimates_(*estimates),
        router_(segmentation_, cost, tuning_),
        execution_(execution),
        area_(segmentation_.charts().size(), 0.0),
        version_(area_.size(), 0) {
    for (std::int32_t i = 0; i < count(); ++i) Measure(i);
  }

  absl::Status Run() {
    for (std::int32_t i = 0; i < count() && GoesOn(); ++i) {
      if (!segmentation_.charts()[i].empty() && !estimates_.has(i)) estimates_.Update(i);
    }
    const double faces = surface_.num_faces() + std::min<double>(surface_.num_faces(), tuning_.thorough_faces);
    glue_left_ = tuning_.glue_estimates * faces;
    move_left_ = tuning_.move_estimates * faces;
    all_left_ = glue_left_ + move_left_;
    for (round_ = 0; round_ < tuning_.seam_rounds && GoesOn(); ++round_) {
      const double gain = Glue() + (charts_.image.empty() ? Move() : 0);
      if (!(gain > kGoesOn)) break;
    }
    if (job_.execution.IsCancelled()) return absl::CancelledError("cancelled");
    charts_.image.clear();
    estimates_.DropEmpty();
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
  void Tell() const { execution_.Report(1 - (std::max(0.0, glue_left_) + std::max(0.0, move_left_)) / all_left_); }
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
      const double most = (ImageOf(i) >= 0 ? 2 : 1) * (cost_.OfPath(border) + tuning_.chart_price);
      if (HasFailed({border.front().idx(), border.size()}, i, other)) continue;
      queue_.push({most, false, pushed_++, {i, other, {border.begin(), border.end()}}, version_[i], version_[other]});
    }
  }

  // A pair of charts that has been glued.
  struct Step {
    Segmentation::Joined joined;
    ChartEstimates::Before before;
    double area, other_area;
  };

  bool Apply(const Segmentation::Joint& joint, std::vector<Step>* steps) {
    std::optional<Segmentation::Joined> joined = segmentation_.Join(joint);
    if (!joined) return false;
    const std::int32_t i = joint.chart, j = joint.other;
    glue_left_ -= static_cast<double>(segmentation_.charts()[i].size());
    steps->push_back({*std::move(joined), estimates_.Replace(i), area_[i], area_[j]});
    area_[i] += std::exchange(area_[j], 0.0);
    return IsSound(i);
  }

  void Undo(std::vector<Step>* steps) {
    for (; !steps->empty(); steps->pop_back()) {
      Step& step = steps->back();
      const std::int32_t i = step.joined.chart;
      area_[i] = step.area;
      area_[step.joined.other] = step.other_area;
      segmentation_.UndoJoin(step.joined);
      estimates_.Restore(i, std::move(step.before));
    }
  }

  std::int32_t ImageOf(std::int32_t i) const { return charts_.image.empty() ? -1 : charts_.image[i]; }

  // The dearest border of two charts, as it is now.
  std::optional<Segmentation::Joint> BorderOf(std::int32_t i, std::int32_t j) const {
    std::vector<HalfedgeHandle> outline = segmentation_.Outline(i);
    std::optional<Segmentation::Joint> dearest;
    double most = 0;
    for (const auto& [border, other] : BordersAlong(segmentation_.gluing(), segmentation_.chart(), &outline)) {
      const double cost = cost_.OfPath(border);
      if (other != j || cost <= most) continue;
      most = cost;
      dearest = {i, j, {border.begin(), border.end()}};
    }
    if (dearest && outline.size() + segmentation_.Outline(j).size() < 2 * dearest->border.size() + 3)
      return std::nullopt;
    return dearest;
  }

  // Glues two charts, and their mirror images alike, if that lowers the cost by so much at least. Returns by how much
  // it would; nothing if they must stay apart.
  std::optional<double> Try(const Segmentation::Joint& joint, double least) {
    const std::int32_t i = joint.chart, j = joint.other, i_image = ImageOf(i), j_image = ImageOf(j);
    std::vector<Step> steps;
    double gain = CostOf(i) + CostOf(j) + cost_.OfPath(joint.border);
    bool is_sound = Apply(joint, &steps);
    gain -= CostOf(i);
    const bool across = i_image == j || i_image < 0 || j_image < 0;
    if (is_sound && !across && (i_image != i || j_image != j)) {
      // Which of the images are part of chart i now.
      const std::int32_t to = i_image == i || j_image == j ? i : i_image;
      const std::int32_t from = i_image == i ? j_image : j_image == j ? i_image : j_image;
      const std::optional<Segmentation::Joint> other = BorderOf(to, from);
      if (other) {
        gain += CostOf(to) + CostOf(from) + cost_.OfPath(other->border);
        is_sound = Apply(*other, &steps);
        gain -= CostOf(to);
      } else {
        is_sound = false;
      }
    }
    if (!is_sound || gain < least) {
      Undo(&steps);
      return is_sound ? std::optional(gain) : std::nullopt;
    }
    for (const Step& step : steps) {
      ++version_[step.joined.chart];
      ++version_[step.joined.other];
    }
    if (!charts_.image.empty()) {
      std::vector<std::int32_t>& image = charts_.image;
      if (i_image >= 0 && j_image >= 0) {
        if (i_image == j || i_image == i || j_image == j) image[i] = i;
      } else if (i_image < 0 && j_image >= 0 && j_image != j) {
        image[i] = j_image;
        image[j_image] = i;
      } else if (j_image == j) {
        image[i] = i;
      }
    }
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
      Tell();
      Candidate best = queue_.top();
      queue_.pop();
      const std::int32_t i = best.joint.chart, j = best.joint.other;
      if (version_[i] != best.version || version_[j] != best.other_version) continue;
      // One that gains nearly as much as any other is glued as soon as its estimate is there.
      constexpr double kNearly = 0.9;
      const double least = best.is_known || queue_.empty() ? kWorthIt : std::max(kWorthIt, kNearly * queue_.top().gain);
      const std::optional<double> gain = Try(best.joint, least);
      if (!gain || !(*gain >= kWorthIt)) {
        const TriMesh& mesh = segmentation_.gluing().mesh();
        const std::size_t edges = best.joint.border.size();
        Fail({best.joint.border.front().idx(), edges}, i, j);
        Fail({mesh.opposite_halfedge_handle(best.joint.border.back()).idx(), edges}, j, i);
        continue;
      }
      if (*gain < least) {
        best.gain = *gain;
        best.is_known = true;
        queue_.push(std::move(best));
        continue;
      }
      gained += *gain;
      Push(i, true);
      const std::int32_t image = ImageOf(i);
      if (image >= 0 && image != i) Push(image, true);
    }
    return gained;
  }

  // Borders whose charts could not be glued, or moved, for less cost; the key is the first half-edge and the number of
  // half-edges. A border is tried again once one of its charts, or of their mirror images, has changed; on large
  // surfaces not in the same round, since larger charts seldom succeed where smaller ones failed.
  struct Tried {
    int round;
    std::int32_t chart, other;
    std::int64_t versions;
  };
  using BorderKey = std::pair<std::int32_t, std::size_t>;

  std::int64_t Versions(std::int32_t i, std::int32_t j) const {
    std::int64_t versions = 0;
    for (const std::int32_t k : {i, j, ImageOf(i), ImageOf(j)}) versions += k < 0 ? 0 : version_[k];
    return versions;
  }
  void Fail(BorderKey key, std::int32_t i, std::int32_t j) { failed_[key] = {round_, i, j, Versions(i, j)}; }
  bool HasFailed(BorderKey key, std::int32_t i, std::int32_t j) const {
    const auto found = failed_.find(key);
    if (found == failed_.end()) return false;
    const Tried& tried = found->second;
    const bool is_large = surface_.num_faces() > tuning_.thorough_faces;
    return (is_large && tried.round == round_) ||
           (tried.chart == i && tried.other == j && tried.versions == Versions(i, j));
  }

  // Moves one seam, or part of one, if that lowers the cost. Returns by how much.
  double MovePart(std::span<const HalfedgeHandle> path, bool slides) {
    const Gluing& gluing = segmentation_.gluing();
    if (!IsPath(gluing, path)) return 0;
    const std::int32_t i = segmentation_.chart()[gluing.mesh().face_handle(path.front()).idx()];
    const std::int32_t j = segmentation_.chart()[surface_.face_across(path.front())];
    const BorderKey key = {path.front().idx(), path.size()};
    if (HasFailed(key, i, j)) return 0;
    const std::optional<std::vector<HalfedgeHandle>> way = router_.Reroute(path, slides);
    if (!way || !segmentation_.MoveSeam(i, j, path, *way)) {
      Fail(key, i, j);
      return 0;
    }
    Moved moved = {i, j, {path.begin(), path.end()}, *way, {}};
    const double before = cost_.OfPath(path) + CostOf(i) + (i == j ? 0 : CostOf(j));
    EstimateMoved(&moved);
    const double after = cost_.OfPath(*way) + CostOf(i) + (i == j ? 0 : CostOf(j));
    if (IsSound(i) && IsSound(j) && before - after > kWorthIt) {
      ++version_[i];
      ++version_[j];
      return before - after;
    }
    UndoMove(&moved);
    Fail(key, i, j);
    return 0;
  }

  // A seam that has been moved, and the estimates of its charts before that.
  struct Moved {
    std::int32_t chart, other;
    std::vector<HalfedgeHandle> from, to;
    std::vector<ChartEstimates::Before> before;
  };

  void EstimateMoved(Moved* moved) {
    const std::int32_t i = moved->chart, j = moved->other;
    moved->before.push_back(estimates_.Replace(i));
    if (i != j) moved->before.push_back(estimates_.Replace(j));
    for (const std::int32_t k : {i, j}) {
      move_left_ -= static_cast<double>(segmentation_.charts()[k].size());
      Measure(k);
    }
  }

  void UndoMove(Moved* moved) {
    const std::int32_t i = moved->chart, j = moved->other;
    segmentation_.MoveSeam(i, j, moved->to, moved->from);
    for (std::size_t k = moved->before.size(); k-- > 0;) {
      estimates_.Restore(k == 0 ? i : j, std::move(moved->before[k]));
    }
    Measure(i);
    Measure(j);
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
      Tell();
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
  const Execution& execution_;
  std::vector<double> area_;  // per chart
  std::vector<int> version_;  // per chart: grows whenever it changes
  std::priority_queue<Candidate> queue_;
  std::map<BorderKey, Tried> failed_;
  std::int64_t pushed_ = 0;
  int round_ = 0;
  double glue_left_ = 0, move_left_ = 0, all_left_ = 0;  // faces that may be estimated again; at first
};

}  // namespace

absl::Status ImproveSeams(Job* job, const Execution& execution, ChartEstimates* estimates, Charts* charts) {
  if (job->execution.IsStopRequested() || charts->segmentation->charts().empty()) return absl::OkStatus();
  const std::vector<float> visibility = FaceVisibility(job->mesh, job->execution);
  const SeamCost cost(*charts->surface, visibility, job->options.tuning, job->execution);
  if (job->execution.IsCancelled()) return absl::CancelledError("cancelled");
  return SeamSearch(job, cost, execution, estimates, charts).Run();
}

absl::StatusOr<bool> SegmentMirrored(Job* job, GivenSeams seams, const Execution& execution, Charts* charts) {
  if (!seams.corners.empty() || !seams.uncut_corners.empty() || seams.hard_edge_degrees > 0 || !seams.kind.empty()) {
    return false;
  }
  const std::optional<Mirror> mirror = FindMirror(job->mesh, seams.polygon, job->execution);
  if (!mirror || job->execution.IsStopRequested()) return false;
  seams.part.resize(job->mesh.faces.size(), 0);
  for (std::int32_t f = 0; f < std::ssize(seams.part); ++f) {
    constexpr std::int32_t kKinds = 3;
    seams.part[f] = kKinds * seams.part[f] + (!mirror->has_image(f) ? 2 : mirror->is_second[f] != 0 ? 1 : 0);
  }
  PLANISH_ASSIGN_OR_RETURN(Surface surface, MakeSurface(job->mesh, seams, job->execution));
  for (std::int32_t f = 0; f < surface.num_faces(); ++f) {
    if (mirror->is_second[f] != 0) surface.takes_part[f] = 0;
  }
  Charts half;
  half.surface = std::make_unique<const Surface>(std::move(surface));
  MeasureAtlases(*job, &half);
  half.segmentation.emplace(*half.surface, Segmentation::Kind::kStretch, FirstStretch(job->options),
                            execution.Part(0, 0.5), MergingOf(job->options));
  if (job->execution.IsCancelled()) return absl::CancelledError("cancelled");
  ChartEstimates estimates(*half.segmentation, job->options.tuning);
  PLANISH_RETURN_IF_ERROR(RefineEstimated(*job, execution.Part(0.5, 0.5), &estimates, &half));
  PLANISH_RETURN_IF_ERROR(ImproveSeams(job, execution.Part(0.5, 1), &estimates, &half));
  const auto count = static_cast<std::int32_t>(half.segmentation->charts().size());
  std::optional<Segmentation> whole = Segmentation::Mirrored(*charts->surface, *half.segmentation, *mirror);
  if (!whole) return false;
  charts->segmentation.emplace(*std::move(whole));
  for (std::int32_t i = 0; i < 2 * count; ++i) {
    const std::int32_t other = i < count ? i + count : i - count;
    charts->image.push_back(charts->segmentation->charts()[other].empty() ? -1 : other);
  }
  return true;
}

}  // namespace planish
