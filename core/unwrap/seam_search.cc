// Fewer, shorter and better hidden seams: charts are glued and seams are moved as long as that lowers the cost of all
// seams (core/charts/seam_cost.h), by estimates of maps.
#include <algorithm>
#include <array>
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
constexpr double kGoesOn = 1e-3;   // in units of the cost: gain of a round that is worth another round
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

  // Improves the seams. Returns the cost of all seams and charts at the end.
  absl::StatusOr<double> Run() {
    for (std::int32_t i = 0; i < count() && GoesOn(); ++i) {
      if (!segmentation_.charts()[i].empty() && !estimates_.has(i)) estimates_.Update(i);
    }
    const double faces = surface_.num_faces() + std::min<double>(surface_.num_faces(), tuning_.thorough_faces);
    glue_left_ = tuning_.glue_estimates * faces;
    move_left_ = tuning_.move_estimates * faces;
    all_left_ = glue_left_ + move_left_;
    for (round_ = 0; round_ < tuning_.seam_rounds && GoesOn(); ++round_) {
      const double gain = Glue() + Move();
      if (!(gain > kGoesOn)) break;
    }
    if (job_.execution.IsCancelled()) return absl::CancelledError("cancelled");
    charts_.image.clear();
    charts_.mirror.reset();
    estimates_.DropEmpty();
    segmentation_.DropEmpty();
    for (std::int32_t i = 0; i < count(); ++i) Measure(i);
    double cost = 0;
    for (std::int32_t i = 0; i < count() && estimates_.has(i); ++i) cost += CostOf(i);
    for (const SeamPath& path : SeamPaths(segmentation_)) cost += cost_.OfPath(path.half_edges);
    return cost;
  }

 private:
  struct Candidate {
    double gain;  // an upper bound unless `is_known`
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

  // Whether these two charts are the mirror images of two charts with lower numbers, and are glued together with those.
  bool IsImage(std::int32_t i, std::int32_t j) const {
    const std::int32_t i_image = ImageOf(i), j_image = ImageOf(j);
    return i_image >= 0 && j_image >= 0 && std::minmax(i_image, j_image) < std::minmax(i, j);
  }

  // Queues the borders of a chart; unless `all`, those with charts of higher numbers.
  void Push(std::int32_t i, bool all) {
    std::vector<HalfedgeHandle> outline = segmentation_.Outline(i);
    const std::size_t edges = outline.size();
    for (const auto& [border, other] : BordersAlong(segmentation_.gluing(), segmentation_.chart(), &outline)) {
      if (!all && other < i) continue;
      if (IsImage(i, other)) continue;
      if (edges + estimates_.of(other).outline.size() < 2 * border.size() + 3) continue;
      const double most = (ImageOf(i) >= 0 ? 2 : 1) * (cost_.OfPath(border) + tuning_.chart_price);
      if (HasFailed({border.front().idx(), border.size()}, i, other)) continue;
      queue_.push({most, false, pushed_++, {i, other, {border.begin(), border.end()}}, version_[i], version_[other]});
    }
  }

  // Charts that are glued together, and their state before.
  struct Glued {
    std::vector<Segmentation::Joined> joined;
    std::vector<std::array<double, 2>> areas;
    std::vector<std::pair<std::int32_t, ChartEstimates::Before>> estimates;
  };

  bool Join(const Segmentation::Joint& joint, Glued* glued) {
    std::optional<Segmentation::Joined> joined = segmentation_.Join(joint);
    if (!joined) return false;
    const std::int32_t i = joint.chart, j = joint.other;
    glued->joined.push_back(*std::move(joined));
    glued->areas.push_back({area_[i], area_[j]});
    area_[i] += std::exchange(area_[j], 0.0);
    return true;
  }

  // Estimates the chart in its present shape. Returns its cost; nullopt if its map is not sound.
  std::optional<double> Estimate(std::int32_t i, Glued* glued) {
    glue_left_ -= static_cast<double>(segmentation_.charts()[i].size());
    glued->estimates.emplace_back(i, estimates_.Replace(i));
    return IsSound(i) ? std::optional(CostOf(i)) : std::nullopt;
  }

  void Undo(Glued* glued) {
    for (std::size_t k = glued->joined.size(); k-- > 0;) {
      const Segmentation::Joined& joined = glued->joined[k];
      area_[joined.chart] = glued->areas[k][0];
      area_[joined.other] = glued->areas[k][1];
      segmentation_.UndoJoin(joined);
    }
    for (std::size_t k = glued->estimates.size(); k-- > 0;) {
      estimates_.Restore(glued->estimates[k].first, std::move(glued->estimates[k].second));
    }
  }

  std::int32_t ImageOf(std::int32_t i) const { return charts_.image.empty() ? -1 : charts_.image[i]; }

  // The mirror image of a half-edge, on the side of the image of its face; invalid if there is none.
  HalfedgeHandle ImageOf(HalfedgeHandle h) const {
    const TriMesh& mesh = *surface_.mesh;
    const HalfedgeHandle o = mesh.opposite_halfedge_handle(h);
    if (const std::int32_t c = charts_.mirror->corner[CornerOf(mesh, h)]; c >= 0) return HalfEdgeOf(mesh, c);
    const std::int32_t c = mesh.is_boundary(o) ? -1 : charts_.mirror->corner[CornerOf(mesh, o)];
    const HalfedgeHandle image = c < 0 ? HalfedgeHandle() : mesh.opposite_halfedge_handle(HalfEdgeOf(mesh, c));
    return image.is_valid() && mesh.is_boundary(image) ? HalfedgeHandle() : image;
  }

  // The mirror image of consecutive half-edges, which runs the other way; empty if an edge has no image.
  std::vector<HalfedgeHandle> ImageOf(std::span<const HalfedgeHandle> path) const {
    std::vector<HalfedgeHandle> image;
    for (std::size_t i = path.size(); i-- > 0;) {
      image.push_back(charts_.mirror ? ImageOf(path[i]) : HalfedgeHandle());
      if (!image.back().is_valid()) return {};
    }
    return image;
  }

  // Whether two paths have an edge in common.
  static bool Meet(std::span<const HalfedgeHandle> path, std::span<const HalfedgeHandle> other) {
    std::vector<int> edges;
    for (const HalfedgeHandle h : path) edges.push_back(h.idx() / 2);
    std::sort(edges.begin(), edges.end());
    return std::any_of(other.begin(), other.end(),
                       [&](HalfedgeHandle h) { return std::binary_search(edges.begin(), edges.end(), h.idx() / 2); });
  }

  std::int32_t ChartOf(HalfedgeHandle h) const {
    return segmentation_.chart()[segmentation_.gluing().mesh().face_handle(h).idx()];
  }
  std::int32_t ChartAcross(HalfedgeHandle h) const { return segmentation_.chart()[surface_.face_across(h)]; }

  // These half-edges as a border of charts i and j; nullopt if they do not lie between the two.
  std::optional<Segmentation::Joint> BorderOf(std::int32_t i, std::int32_t j,
                                              std::vector<HalfedgeHandle> border) const {
    if (border.empty() || surface_.face_across(border.front()) < 0) return std::nullopt;
    if (ChartOf(border.front()) != i) {
      std::reverse(border.begin(), border.end());
      for (HalfedgeHandle& h : border) h = surface_.mesh->opposite_halfedge_handle(h);
    }
    for (const HalfedgeHandle h : border) {
      const bool is_border =
          segmentation_.gluing().IsOutline(h) && surface_.face_across(h) >= 0 && ChartOf(h) == i && ChartAcross(h) == j;
      if (!is_border) return std::nullopt;
    }
    if (segmentation_.Outline(i).size() + segmentation_.Outline(j).size() < 2 * border.size() + 3) return std::nullopt;
    return Segmentation::Joint{i, j, std::move(border)};
  }

  // Glues two charts, and their mirror images alike, if that lowers the cost by at least `least`. Returns by how much
  // gluing lowers the cost, done or not; nullopt if the charts must stay apart.
  std::optional<double> Try(const Segmentation::Joint& joint, double least) {
    const std::int32_t i = joint.chart, j = joint.other, i_image = ImageOf(i), j_image = ImageOf(j);
    const bool is_own = i_image == j || (i_image == i && j_image == j);
    std::vector<HalfedgeHandle> border;
    if (i_image >= 0 && j_image >= 0) {
      border = ImageOf(joint.border);
      if (is_own && !border.empty() && !Meet(joint.border, border)) return std::nullopt;
    }
    // Image charts are estimated only where this chart gains enough.
    const bool has_image = !is_own && i_image >= 0 && j_image >= 0;
    const std::int32_t to = !has_image ? -1 : i_image == i || j_image == j ? i : i_image;
    const std::int32_t from = !has_image ? -1 : i_image == i ? j_image : j_image == j ? i_image : j_image;
    double gain = CostOf(i) + CostOf(j) + cost_.OfPath(joint.border), other_gain = 0;
    Glued glued;
    bool is_sound = Join(joint, &glued);
    if (is_sound && has_image) {
      const std::optional<Segmentation::Joint> other = BorderOf(to, from, std::move(border));
      is_sound = other && Join(*other, &glued);
      if (is_sound) {
        double& its_gain = to == i ? gain : other_gain;
        its_gain += (to == i ? 0 : CostOf(to)) + CostOf(from) + cost_.OfPath(other->border);
      }
    }
    const bool is_pair = has_image && to != i;
    const auto estimate = [&](std::int32_t chart, double* its_gain) {
      const std::optional<double> cost = Estimate(chart, &glued);
      *its_gain -= cost.value_or(0);
      is_sound = is_sound && cost.has_value();
    };
    if (is_sound) estimate(i, &gain);
    if (is_sound && is_pair && 2 * gain >= least) {
      estimate(to, &other_gain);
      gain += other_gain;
    } else if (is_pair) {
      gain *= 2;
    }
    if (!is_sound || gain < least) {
      Undo(&glued);
      return is_sound ? std::optional(gain) : std::nullopt;
    }
    for (const Segmentation::Joined& joined : glued.joined) {
      ++version_[joined.chart];
      ++version_[joined.other];
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

  // Glues charts, those with the largest gain first. Returns the total gain.
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
      // A candidate that gains nearly as much as the next one may gain at most is glued at once.
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

  // A seam that is moved, together with its mirror image. `charts` are the charts beside them; `before` are their
  // estimates before the move.
  struct Moved {
    struct Part {
      std::int32_t chart, other;
      std::vector<HalfedgeHandle> from, to;
    };
    std::vector<Part> parts;
    std::vector<std::int32_t> charts;
    std::vector<ChartEstimates::Before> before;
  };

  // Moves one seam, or part of one, and its mirror image alike, if that lowers the cost. Returns the gain; 0 if it was
  // not moved.
  double MovePart(std::span<const HalfedgeHandle> path, bool slides) {
    if (!IsPath(segmentation_.gluing(), path)) return 0;
    const std::vector<HalfedgeHandle> image = ImageOf(path);
    if (Meet(path, image)) return 0;  // the seam lies on the mirror plane, or crosses it
    const std::int32_t i = ChartOf(path.front()), j = ChartAcross(path.front());
    const BorderKey key = {path.front().idx(), path.size()};
    if (HasFailed(key, i, j)) return 0;
    const std::optional<std::vector<HalfedgeHandle>> way = router_.Reroute(path, slides);
    Moved moved;
    if (!way || !MoveTo(path, *way, &moved) || (!image.empty() && !MoveTo(image, ImageOf(*way), &moved))) {
      UndoMove(&moved);
      Fail(key, i, j);
      return 0;
    }
    double of_paths = 0;
    for (const typename Moved::Part& part : moved.parts) of_paths += cost_.OfPath(part.from) - cost_.OfPath(part.to);
    double gain = of_paths;
    bool is_sound = true;
    for (std::size_t k = 0; k < moved.charts.size() && is_sound; ++k) {
      // Looks at the image charts only if twice the gain is enough, since they gain about as much.
      is_sound = k != 2 || moved.charts.size() < 4 || 2 * gain - of_paths > kWorthIt;
      if (!is_sound) break;
      const std::int32_t chart = moved.charts[k];
      gain += CostOf(chart);
      moved.before.push_back(estimates_.Replace(chart));
      move_left_ -= static_cast<double>(segmentation_.charts()[chart].size());
      Measure(chart);
      gain -= CostOf(chart);
      is_sound = IsSound(chart);
    }
    if (is_sound && gain > kWorthIt) {
      for (const std::int32_t k : moved.charts) ++version_[k];
      return gain;
    }
    UndoMove(&moved);
    Fail(key, i, j);
    return 0;
  }

  // Whether a way runs inside the two charts beside a path, from outline to outline. The ways of SeamRouter do; the
  // mirror image of such a way may not, once the way has become a seam.
  bool CanLeadTo(std::span<const HalfedgeHandle> path, const std::vector<HalfedgeHandle>& way) const {
    const Gluing& gluing = segmentation_.gluing();
    const TriMesh& mesh = gluing.mesh();
    const auto is_on_path = [&](VertexHandle v) {
      return std::any_of(path.begin() + 1, path.end(),
                         [&](HalfedgeHandle h) { return mesh.from_vertex_handle(h) == v; });
    };
    const std::int32_t i = ChartOf(path.front()), j = ChartAcross(path.front());
    for (const HalfedgeHandle h : way) {
      if (surface_.face_across(h) < 0 || surface_.is_uncut(h)) return false;
      if (gluing.IsOutline(h) && !Meet({&h, 1}, path)) return false;
      if ((ChartOf(h) != i && ChartOf(h) != j) || (ChartAcross(h) != i && ChartAcross(h) != j)) return false;
      const VertexHandle v = mesh.to_vertex_handle(h);
      const bool is_free = gluing.IsInside(v) || is_on_path(v);
      if (is_free == (h == way.back())) return false;
    }
    const VertexHandle start = mesh.from_vertex_handle(way.front());
    return !gluing.IsInside(start) && !is_on_path(start);
  }

  // Moves the seam `path` to `way`, and records that in `moved`. Returns false if the seam cannot go there.
  bool MoveTo(std::span<const HalfedgeHandle> path, const std::vector<HalfedgeHandle>& way, Moved* moved) {
    if (way.empty() || !IsPath(segmentation_.gluing(), path)) return false;
    const std::int32_t i = ChartOf(path.front()), j = ChartAcross(path.front());
    if (!CanLeadTo(path, way)) return false;
    if (!segmentation_.MoveSeam(i, j, path, way)) return false;
    moved->parts.push_back({i, j, {path.begin(), path.end()}, way});
    for (const std::int32_t k : {i, j}) {
      if (std::find(moved->charts.begin(), moved->charts.end(), k) == moved->charts.end()) moved->charts.push_back(k);
    }
    return true;
  }

  void UndoMove(Moved* moved) {
    for (std::size_t k = moved->parts.size(); k-- > 0;) {
      const typename Moved::Part& part = moved->parts[k];
      segmentation_.MoveSeam(part.chart, part.other, part.to, part.from);
    }
    for (std::size_t k = moved->before.size(); k-- > 0;) {
      estimates_.Restore(moved->charts[k], std::move(moved->before[k]));
    }
    for (std::size_t k = 0; k < moved->before.size(); ++k) Measure(moved->charts[k]);
  }

  // Whether the vertex where a half-edge ends is its own mirror image.
  bool EndsOnPlane(HalfedgeHandle h) const {
    const TriMesh& mesh = *surface_.mesh;
    const HalfedgeHandle image = ImageOf(h);
    return image.is_valid() && mesh.from_vertex_handle(image) == mesh.to_vertex_handle(h);
  }

  // Moves all seams, the most expensive first. Returns the total gain.
  double Move() {
    double gained = 0;
    std::vector<SeamPath> paths = SeamPaths(segmentation_);
    if (charts_.mirror) paths = OfOneSide(paths);
    std::vector<double> cost;
    for (const SeamPath& path : paths) cost.push_back(cost_.OfPath(path.half_edges));
    for (const std::int32_t p :
         SortedIndices(paths.size(), [&](std::int32_t a, std::int32_t b) { return cost[a] > cost[b]; })) {
      if (!GoesOn() || move_left_ <= 0) break;
      Tell();
      const std::span<const HalfedgeHandle> path = paths[p].half_edges;
      if (!paths[p].is_loop && path.size() <= kArc) {
        gained += MovePart(path, paths[p].slides);
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

  // Cuts paths where they cross the mirror plane. Leaves out parts on the second side that have a mirror image.
  std::vector<SeamPath> OfOneSide(const std::vector<SeamPath>& paths) const {
    const TriMesh& mesh = *surface_.mesh;
    const auto is_second = [&](std::int32_t f) { return charts_.mirror->side[f] == Mirror::Side::kSecond; };
    std::vector<SeamPath> parts;
    for (const SeamPath& path : paths) {
      std::vector<HalfedgeHandle> all = path.half_edges;
      bool is_whole = true;
      if (path.is_loop) {
        const auto crossing = std::find_if(all.begin(), all.end(), [&](HalfedgeHandle h) { return EndsOnPlane(h); });
        if (crossing != all.end()) {
          is_whole = false;
          std::rotate(all.begin(), crossing + 1, all.end());
        }
      }
      SeamPath part;
      for (std::size_t i = 0; i < all.size(); ++i) {
        part.half_edges.push_back(all[i]);
        const bool is_last = i + 1 == all.size();
        if (!is_last && !EndsOnPlane(all[i])) continue;
        is_whole = is_whole && is_last;
        const HalfedgeHandle h = part.half_edges.front();
        part.slides = is_whole;
        part.is_loop = path.is_loop && is_whole;
        const bool is_image = is_second(mesh.face_handle(h).idx()) && is_second(surface_.face_across(h)) &&
                              !ImageOf(part.half_edges).empty();
        if (!is_image) parts.push_back(part);
        part = {};
      }
    }
    return parts;
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
  std::vector<int> version_;  // per chart: grows whenever the chart changes
  std::priority_queue<Candidate> queue_;
  std::map<BorderKey, Tried> failed_;
  std::int64_t pushed_ = 0;
  int round_ = 0;
  double glue_left_ = 0, move_left_ = 0, all_left_ = 0;  // faces that may still be estimated again; all_left_: at first
};

}  // namespace

absl::StatusOr<double> ImproveSeams(Job* job, const Execution& execution, ChartEstimates* estimates, Charts* charts) {
  if (job->execution.IsStopRequested() || charts->segmentation->charts().empty()) return 0;
  const std::vector<float> visibility = FaceVisibility(job->mesh, job->execution);
  const SeamCost cost(*charts->surface, visibility, job->options.tuning, job->execution);
  if (job->execution.IsCancelled()) return absl::CancelledError("cancelled");
  return SeamSearch(job, cost, execution, estimates, charts).Run();
}

}  // namespace planish
