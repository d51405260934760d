#include <algorithm>
#include <cmath>
#include <map>
#include <numbers>
#include <optional>
#include <queue>
#include <span>
#include <unordered_set>
#include <utility>

#include "core/charts/gluing.h"
#include "core/charts/steps.h"
#include "core/charts/stretch_estimate.h"

namespace planish {
namespace {

constexpr double kScoreUnit = 1e-6;
constexpr std::int32_t kReportStride = 512;  // discs or joints
constexpr double kFirstEstimates = 0.2;      // of the time of Run()
constexpr double kNearLimit = 0.999;         // a step of the limit above this part of the last limit is skipped

struct Disc {
  std::vector<std::int32_t> faces;     // empty: merged into another disc
  std::vector<std::int32_t> interior;  // vertices inside the disc
  double perimeter = 0;
  StretchEstimate::Sums sums;
  std::size_t estimated = 0;  // number of faces at its last full estimate
  std::size_t walked = 0;     // number of faces when joints along the whole outline were last queued
  HalfedgeHandle outline;     // one half-edge of it
  std::int32_t outline_edges = 0;
  std::int32_t version = 0;  // queued joints of an older version are obsolete

  double Compactness() const { return 4 * std::numbers::pi * sums.area / (perimeter * perimeter); }
};

// A border at which two discs may be glued.
struct Joint {
  std::int64_t score;
  std::int32_t corner;   // the corner that faces `first`
  HalfedgeHandle first;  // of `disc`, followed by `edges` - 1 more
  std::int32_t edges;
  std::int32_t disc, other;
  std::int32_t version, other_version;

  bool operator<(const Joint& o) const {
    return score != o.score ? score < o.score : corner != o.corner ? corner > o.corner : disc > o.disc;
  }
};

class Merging {
 public:
  Merging(std::int32_t count, double max_stretch, const AtlasTuning& tuning, Gluing* gluing,
          std::vector<std::int32_t>* disc_of, std::vector<float> kept, const Execution& execution)
      : max_stretch_(max_stretch),
        tuning_(tuning),
        surface_(gluing->surface()),
        mesh_(*surface_.mesh),
        gluing_(*gluing),
        disc_of_(*disc_of),
        estimate_(*gluing, tuning, std::move(kept), execution),
        discs_(count) {}

  void Run(const Execution& execution) {
    const auto count = static_cast<std::int32_t>(discs_.size());
    for (std::int32_t f = 0; f < surface_.num_faces(); ++f) {
      if (disc_of_[f] < 0) continue;
      discs_[disc_of_[f]].faces.push_back(f);
    }
    for (std::int32_t first = 0; first < count; first += kReportStride) {
      execution.Report(kFirstEstimates * first / count);
      constexpr std::int64_t kDiscs = 16;  // of a chunk
      execution.For(
          std::min(count - first, kReportStride),
          [&](std::int64_t begin, std::int64_t end) {
            StretchEstimate::Work work;
            for (std::int64_t d = first + begin; d < first + end; ++d)
              EstimateFirst(static_cast<std::int32_t>(d), &work);
          },
          kDiscs);
    }
    // Raises the limit step by step. With a high limit at once, discs would join the neighbours with the longest
    // borders, whatever stretch that costs, and more discs would remain.
    const double most = max_stretch_;
    for (double above = tuning_.first_stretch; above < kNearLimit * (most - 1); above *= tuning_.stretch_growth) {
      max_stretch_ = 1 + above;
      Merge(execution);
      failed_.clear();
      for (Disc& disc : discs_) ++disc.version;
    }
    max_stretch_ = most;
    Merge(execution);
    NumberByFirst(discs_.size(), &disc_of_);
  }

  std::vector<float> TakeKept() { return estimate_.TakeKept(); }

 private:
  // Estimates a disc before any is glued to another.
  void EstimateFirst(std::int32_t d, StretchEstimate::Work* work) {
    Disc& disc = discs_[d];
    disc.interior = estimate_.InteriorOf(disc.faces);
    for (const std::int32_t f : disc.faces) disc.sums.area += surface_.area[f];
    disc.sums = estimate_.Whole({disc.interior}, disc.sums.area, work);
    disc.estimated = disc.faces.size();
    estimate_.Keep(*work);
    WalkOutline(d);
  }

  // Glues discs until no joint is left that max_stretch_ allows, or a stop is requested.
  void Merge(const Execution& execution) {
    const auto count = static_cast<std::int32_t>(discs_.size());
    for (std::int32_t d = 0; d < count && !execution.IsCancelledAt(d); ++d) {
      if (!discs_[d].faces.empty()) PushJoints(d, false);
    }
    // Each joint that is glued adds further joints to the queue. Merging ends when the queue is empty.
    std::int64_t looked_at = 0;
    const auto goes_on = [&] { return !execution.IsCancelled() && !execution.IsStopRequested(); };
    while (!queue_.empty() && goes_on()) {
      while (!queue_.empty() && goes_on()) {
        const Joint joint = queue_.top();
        queue_.pop();
        if (++looked_at % kReportStride == 0) {
          const double known = static_cast<double>(looked_at) + static_cast<double>(queue_.size());
          execution.Report(kFirstEstimates + (1 - kFirstEstimates) * static_cast<double>(looked_at) / known);
        }
        if (discs_[joint.disc].version != joint.version || discs_[joint.other].version != joint.other_version) continue;
        if (!gluing_.IsOutline(joint.first)) continue;
        // The discs may have grown since the joint was queued: scores it again, and queues it again if the score has
        // fallen.
        const std::optional<Joint> now = JointAt(joint.first);
        if (!now) continue;
        if (now->score < joint.score || now->edges != joint.edges) {
          queue_.push(*now);
        } else {
          TryJoint(*now);
        }
      }
      // Joints that were refused may be possible now that the disc has grown.
      for (std::int32_t d = 0; d < count && goes_on(); ++d) {
        if (discs_[d].faces.size() <= discs_[d].walked) continue;
        ++discs_[d].version;
        PushJoints(d, true);
      }
    }
  }

  // The length of an edge, weighted less where the surface bends.
  double EdgeWeight(HalfedgeHandle h) const {
    return surface_.length(h) * std::max(tuning_.sharp_weight, surface_.bend_cosine(h));
  }

  // Returns the outline of disc d, and stores its figures.
  std::vector<HalfedgeHandle> WalkOutline(std::int32_t d) {
    Disc& disc = discs_[d];
    const bool is_known = disc.outline.is_valid() && gluing_.IsOutline(disc.outline);
    if (!is_known) disc.outline = FirstOnOutline(gluing_, disc.faces);
    std::vector<HalfedgeHandle> walk = OutlineFrom(gluing_, disc.outline);
    disc.perimeter = 0;
    for (const HalfedgeHandle h : walk) disc.perimeter += surface_.length(h);
    disc.outline_edges = static_cast<std::int32_t>(walk.size());
    return walk;
  }

  // The joint of discs d and `other` along this border on the outline of d; nullopt if too short an outline would be
  // left, or the joined disc would not be compact enough.
  std::optional<Joint> JointAlong(std::span<const HalfedgeHandle> border, std::int32_t d, std::int32_t other) const {
    const auto edges = static_cast<std::int32_t>(border.size());
    const Disc &one = discs_[d], &two = discs_[other];
    if (one.outline_edges + two.outline_edges - 2 * edges < 3) return std::nullopt;
    double weight = 0, length = 0;
    for (const HalfedgeHandle h : border) {
      weight += EdgeWeight(h);
      length += surface_.length(h);
    }
    const double shorter = std::min(one.perimeter, two.perimeter);
    const double area = one.sums.area + two.sums.area;
    const double perimeter = one.perimeter + two.perimeter - 2 * length;
    const double compactness = perimeter > 0 ? 4 * std::numbers::pi * area / (perimeter * perimeter) : 0;
    const Disc& larger = one.sums.area < two.sums.area ? two : one;
    if (compactness < tuning_.compactness && compactness < larger.Compactness()) return std::nullopt;
    const double score = shorter > 0 ? weight / shorter * std::sqrt(std::min(1.0, compactness)) : 1;
    const HalfedgeHandle first = border.front();
    return Joint{
        std::llround(score / kScoreUnit), CornerOf(mesh_, first), first, edges, d, other, one.version, two.version};
  }

  // The joint along the whole border of an outline half-edge; nullopt if there is none. Stores the border in walk_.
  std::optional<Joint> JointAt(HalfedgeHandle h) {
    walk_ = BorderThrough(gluing_, disc_of_, h);
    if (walk_.empty()) return std::nullopt;
    return JointAlong(walk_, disc_of_[mesh_.face_handle(h).idx()], disc_of_[surface_.face_across(h)]);
  }

  // Queues the joints of disc d; unless `all`, only those with discs of higher numbers.
  void PushJoints(std::int32_t d, bool all) {
    walk_ = WalkOutline(d);
    discs_[d].walked = discs_[d].faces.size();
    for (const auto& [border, other] : BordersAlong(gluing_, disc_of_, &walk_)) {
      if (!all && other < d) continue;
      if (const std::optional<Joint> joint = JointAlong(border, d, other)) queue_.push(*joint);
    }
  }

  // Queues the joints next to these faces of a disc.
  void PushJointsNear(const std::vector<std::int32_t>& faces) {
    near_.clear();
    for (const std::int32_t f : faces) {
      for (const HalfedgeHandle h : HalfEdgesOf(mesh_, FaceHandle(f))) {
        if (!gluing_.IsOutline(h) || near_.contains(h.idx())) continue;
        const std::optional<Joint> joint = JointAt(h);
        for (const HalfedgeHandle of_border : walk_) near_.insert(of_border.idx());
        if (joint) queue_.push(*joint);
      }
    }
  }

  // Whether joining these two discs has failed, and they have hardly grown since.
  bool HasFailed(const Joint& joint) const {
    const auto it = failed_.find({std::min(joint.disc, joint.other), std::max(joint.disc, joint.other)});
    const std::size_t faces = discs_[joint.disc].faces.size() + discs_[joint.other].faces.size();
    return it != failed_.end() &&
           static_cast<double>(faces) < (1 + tuning_.estimate_growth) * static_cast<double>(it->second);
  }

  // The vertices of a border that lie inside the disc now that it is glued.
  std::vector<std::int32_t> InteriorOf(const GluedBorder& border) const {
    std::vector<std::int32_t> interior;
    for (const HalfedgeHandle h : border.glued) {
      for (const VertexHandle v : {mesh_.from_vertex_handle(h), mesh_.to_vertex_handle(h)}) {
        if (gluing_.IsInside(v)) interior.push_back(v.idx());
      }
    }
    std::sort(interior.begin(), interior.end());
    interior.erase(std::unique(interior.begin(), interior.end()), interior.end());
    return interior;
  }

  // Whether the discs are so similar in size that their union is estimated as a whole, not by
  // StretchEstimate::Joined().
  bool IsWhole(const Disc& large, const Disc& small) const {
    return large.faces.size() <= static_cast<std::size_t>(tuning_.estimate_reach) * small.faces.size();
  }

  // The stretch of two discs that have just been glued. So that all estimates together take O(F log F), the effect of a
  // small disc on a large one is estimated only near the small one, until the large one has grown.
  StretchEstimate::Sums Estimate(Disc* large, const Disc& small, const std::vector<std::int32_t>& joint) {
    const double area = large->sums.area + small.sums.area;
    if (IsWhole(*large, small)) return estimate_.Whole({large->interior, small.interior, joint}, area, &work_);
    const auto grown = static_cast<double>(large->faces.size());
    if (grown > (1 + tuning_.estimate_growth) * static_cast<double>(large->estimated)) {
      large->sums = estimate_.Whole({large->interior}, large->sums.area, &work_);
      large->estimated = large->faces.size();
      estimate_.Keep(work_);
    }
    const StretchEstimate::Sums before = {area, large->sums.larger + small.sums.larger,
                                          large->sums.smaller + small.sums.smaller};
    return estimate_.Joined(small.faces, before, &work_);
  }

  void TryJoint(const Joint& joint) {
    if (HasFailed(joint)) return;
    const std::optional<GluedBorder> border = GlueBorder(joint.first, joint.edges, tuning_.Widest(), /*zips=*/true, &gluing_);
    if (!border) return;
    std::int32_t to = joint.disc, from = joint.other;
    if (discs_[to].faces.size() < discs_[from].faces.size()) std::swap(to, from);
    Disc &large = discs_[to], &small = discs_[from];
    const std::size_t faces = large.faces.size() + small.faces.size();
    const std::vector<std::int32_t> joint_vertices = InteriorOf(*border);
    const StretchEstimate::Sums sums = Estimate(&large, small, joint_vertices);
    const double area = large.sums.area + small.sums.area;
    const double of_large = large.sums.Stretch(), of_small = small.sums.Stretch();
    const double parts =
        std::sqrt((of_large * of_large * large.sums.area + of_small * of_small * small.sums.area) / area);
    if (!(sums.Stretch() <= std::max(max_stretch_, parts))) {
      failed_[{std::min(to, from), std::max(to, from)}] = faces;
      return border->Undo(&gluing_);
    }
    estimate_.Keep(work_);
    if (IsWhole(large, small)) large.estimated = faces;
    const std::vector<std::int32_t> joined = std::exchange(small.faces, {});
    for (const std::int32_t f : joined) disc_of_[f] = to;
    large.faces.insert(large.faces.end(), joined.begin(), joined.end());
    large.interior.insert(large.interior.end(), small.interior.begin(), small.interior.end());
    large.interior.insert(large.interior.end(), joint_vertices.begin(), joint_vertices.end());
    small.interior = {};
    large.sums = sums;
    large.perimeter += small.perimeter;
    for (const HalfedgeHandle h : border->glued) large.perimeter -= 2 * surface_.length(h);
    large.outline_edges += small.outline_edges - 2 * static_cast<std::int32_t>(border->glued.size());
    for (const HalfedgeHandle e : border->ends) {
      if (gluing_.IsOutline(e)) large.outline = e;
    }
    ++small.version;
    if (static_cast<double>(faces) <= (1 + tuning_.outline_growth) * static_cast<double>(large.walked)) {
      return PushJointsNear(joined);
    }
    ++large.version;
    PushJoints(to, true);
  }

  double max_stretch_;  // the current limit
  const AtlasTuning& tuning_;
  const Surface& surface_;
  const TriMesh& mesh_;
  Gluing& gluing_;
  std::vector<std::int32_t>& disc_of_;
  StretchEstimate estimate_;
  StretchEstimate::Work work_;
  std::vector<Disc> discs_;
  std::priority_queue<Joint> queue_;
  std::vector<HalfedgeHandle> walk_;  // the outline, or border, that was walked last
  std::unordered_set<int> near_;      // half-edges of PushJointsNear() whose joints are queued
  // Pairs of discs, lower number first, whose joint would have had too much stretch: the number of their faces then.
  std::map<std::pair<std::int32_t, std::int32_t>, std::size_t> failed_;
};

}  // namespace

void GluePiece(std::int32_t start, const std::vector<std::int32_t>& piece, std::vector<char>* seen, Gluing* gluing) {
  const Surface& surface = gluing->surface();
  const TriMesh& mesh = *surface.mesh;
  std::vector<std::int32_t> order;
  // Adds a face and the faces that must not be separated from it.
  const auto reach = [&](std::int32_t first) {
    (*seen)[first] = 1;
    order.push_back(first);
    for (std::size_t i = order.size() - 1; i < order.size(); ++i) {
      for (const HalfedgeHandle h : HalfEdgesOf(mesh, FaceHandle(order[i]))) {
        const std::int32_t f = surface.face_across(h);
        if (f < 0 || !surface.is_uncut(h) || (*seen)[f] || piece[f] != piece[first]) continue;
        (*seen)[f] = 1;
        gluing->Glue(h);
        order.push_back(f);
      }
    }
  };
  // A spanning tree of the faces, nearest first, makes them a disc; then its slits are zipped up.
  reach(start);
  for (std::size_t i = 0; i < order.size(); ++i) {
    for (const HalfedgeHandle h : HalfEdgesOf(mesh, FaceHandle(order[i]))) {
      const std::int32_t f = surface.face_across(h);
      if (f < 0 || (*seen)[f] || piece[f] != piece[start]) continue;
      gluing->Glue(h);
      reach(f);
    }
  }
  for (const std::int32_t f : order) {
    for (const HalfedgeHandle h : HalfEdgesOf(mesh, FaceHandle(f))) {
      if (gluing->IsOutline(h)) gluing->Zip(h);
    }
  }
}

void GluePieces(const std::vector<std::int32_t>& piece, Gluing* gluing) {
  std::vector<char> seen(piece.size(), 0);
  for (std::int32_t f = 0; f < gluing->surface().num_faces(); ++f) {
    if (!seen[f] && piece[f] >= 0) GluePiece(f, piece, &seen, gluing);
  }
}

void MergeDiscs(std::int32_t count, double max_stretch, const AtlasTuning& tuning, const Execution& execution,
                Gluing* gluing, std::vector<std::int32_t>* disc, std::vector<float>* kept) {
  Merging merging(count, max_stretch, tuning, gluing, disc, std::move(*kept), execution);
  merging.Run(execution);
  *kept = merging.TakeKept();
}

}  // namespace planish
