#include <algorithm>
#include <utility>
#include <vector>

#include "core/charts/steps.h"

namespace planish {
namespace {

class Smoothing {
 public:
  Smoothing(const AtlasTuning& tuning, Gluing* gluing, std::vector<std::int32_t>* chart)
      : tuning_(tuning), surface_(gluing->surface()), mesh_(*surface_.mesh), gluing_(*gluing), chart_(*chart) {}

  void Run(std::vector<std::int32_t> faces, const Execution& execution) {
    std::vector<std::int32_t> next;
    std::erase_if(faces, [&](std::int32_t f) { return !OnlyGlued(f).is_valid(); });
    std::vector<char> queued(surface_.num_faces(), 0);
    for (int sweep = 0; sweep < tuning_.smoothing_sweeps && !faces.empty() && !execution.IsCancelled(); ++sweep) {
      next.clear();
      for (const std::int32_t f : faces) {
        if (!Move(f)) continue;
        for (const HalfedgeHandle h : HalfEdgesOf(mesh_, FaceHandle(f))) {
          const std::int32_t g = surface_.face_across(h);
          if (g < 0 || queued[g]) continue;
          queued[g] = 1;
          next.push_back(g);
        }
      }
      for (const std::int32_t f : next) queued[f] = 0;
      std::sort(next.begin(), next.end());
      faces.swap(next);
    }
  }

 private:
  double Cost(HalfedgeHandle h) const {
    return surface_.length(h) *
           (1 - (1 - tuning_.smoothing_sharp_cost) * std::clamp(1 - surface_.bend_cosine(h), 0.0, 1.0));
  }

  // The one half-edge of a face that is glued; invalid if there are more, or none.
  HalfedgeHandle OnlyGlued(std::int32_t f) const {
    HalfedgeHandle only;
    for (const HalfedgeHandle h : HalfEdgesOf(mesh_, FaceHandle(f))) {
      if (gluing_.IsOutline(h)) continue;
      if (only.is_valid()) return HalfedgeHandle();
      only = h;
    }
    return only;
  }

  bool Move(std::int32_t f) {
    constexpr double kGain = 1e-6;
    const HalfedgeHandle glued = OnlyGlued(f);
    if (!glued.is_valid() || surface_.is_uncut(glued)) return false;
    // Along the outline: `first`, then `second`; on the other side `after` follows `before`.
    const HalfedgeHandle first = gluing_.Next(glued), second = gluing_.Prev(glued);
    const HalfedgeHandle before = mesh_.opposite_halfedge_handle(second), after = mesh_.opposite_halfedge_handle(first);
    const std::int32_t to = surface_.face_across(second);
    if (to < 0 || mesh_.is_boundary(after) || chart_[to] < 0 || gluing_.After(before) != after) return false;
    if (to == f || surface_.face_across(first) == f) return false;
    const HalfedgeHandle next = gluing_.After(after), previous = gluing_.Before(before);
    if (next == previous) return false;  // would leave an outline of two edges
    const double cost = Cost(first) + Cost(second);
    if (!(Cost(glued) < (1 - kGain) * cost)) return false;
    const std::int32_t neighbour = surface_.face_across(glued);
    gluing_.Unglue(glued);
    gluing_.Glue(first);
    gluing_.Glue(second);
    if (gluing_.OutlineAngle(glued) > tuning_.widest || gluing_.OutlineAngle(gluing_.Before(glued)) > tuning_.widest) {
      gluing_.Unglue(first);
      gluing_.Unglue(second);
      gluing_.Glue(glued);
      return false;
    }
    chart_[f] = chart_[to];
    // Next to the end of a slit its sides may have come together.
    if (chart_[neighbour] == chart_[f]) {
      gluing_.Zip(glued);
      if (gluing_.IsOutline(previous)) gluing_.Zip(previous);
    }
    return true;
  }

  const AtlasTuning& tuning_;
  const Surface& surface_;
  const TriMesh& mesh_;
  Gluing& gluing_;
  std::vector<std::int32_t>& chart_;
};

}  // namespace

void SmoothOutlines(const AtlasTuning& tuning, const Execution& execution, std::vector<std::int32_t> faces,
                    Gluing* gluing, std::vector<std::int32_t>* chart) {
  Smoothing(tuning, gluing, chart).Run(std::move(faces), execution);
}

}  // namespace planish
