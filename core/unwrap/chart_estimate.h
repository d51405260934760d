// Estimates the outline and the stretch of the maps of charts before they are solved for. That is cheap enough to
// decide which charts to cut or to join, so that most charts are solved only once.
#pragma once

#include <algorithm>
#include <cstdint>
#include <memory>
#include <mutex>
#include <span>
#include <utility>
#include <vector>

#include "core/base/execution.h"
#include "core/charts/segmentation.h"
#include "core/charts/stretch_estimate.h"

namespace planish {

struct ChartEstimate {
  std::vector<HalfedgeHandle> outline;  // from FirstOnOutline() on
  std::vector<Vec2> points;             // where each of these half-edges begins in the map
  double stretch = 1;                   // root mean square
  double waste = 0;                     // area between the outline in the map and its convex hull
  // Faces of the mesh at two places where the outline crosses itself, the farthest apart along it; -1: nowhere.
  std::int32_t face = -1, other_face = -1;
};

// Estimates of all charts of a segmentation. Several threads may Replace() and Trace() different charts at the same
// time, after Reserve(). Otherwise not thread-safe.
class ChartEstimates {
 public:
  // `segmentation` must outlive this.
  ChartEstimates(const Segmentation& segmentation, const AtlasTuning& tuning, const Execution& execution = {});

  const ChartEstimate& of(std::int32_t chart) const { return charts_[chart]; }
  // Estimates the chart in its present shape. Takes about a twentieth of the work of a solve.
  void Update(std::int32_t chart);
  // Update() of different charts, with the whole team. Ends early after a cancellation.
  void Update(std::span<const std::int32_t> charts, const Execution& execution);
  // Makes room for all charts of the segmentation.
  void Reserve() { charts_.resize(std::max(charts_.size(), segmentation_.charts().size())); }
  // An earlier or later estimate of a chart, and its u.
  struct Other {
    ChartEstimate estimate;
    StretchEstimate::Kept kept;
  };
  // Like Update() without Trace(), so that only the stretch is known. Returns the previous estimate, for Swap() if the
  // change of the chart is undone.
  Other Replace(std::int32_t chart);
  // Completes the estimate by the outline, its points, and where it crosses itself, unless it is complete.
  void Trace(std::int32_t chart);
  // Exchanges the estimate of the chart and its u with these; the latest Replace() first.
  void Swap(std::int32_t chart, Other* other);
  void Restore(std::int32_t chart, ChartEstimate estimate) { charts_[chart] = std::move(estimate); }
  // Whether there is an estimate of the chart, maybe an old one.
  bool has(std::int32_t chart) const { return chart < std::ssize(charts_) && !charts_[chart].outline.empty(); }
  // Removes the estimates of charts without faces. Call this before Segmentation::DropEmpty(), which renumbers the
  // charts in the same way.
  void DropEmpty();
  // The positions of the vertices of the chart's mesh `disc` (ChartMesh()) in the map whose outline was last estimated.
  // Vertices are placed one after the other from the outline inwards, each by the edge lengths of its triangles whose
  // other two corners have been placed. Good enough to tell on which side of a chord a face lies. O(n).
  std::vector<Vec2> Positions(std::int32_t chart, const FlatMesh& disc) const;

 private:
  // Calls use(work) with memory that no other thread uses.
  template <class Use>
  void WithWork(const Use& use);
  void Solve(std::int32_t chart, StretchEstimate::Work* work);

  const Segmentation& segmentation_;
  const AtlasTuning tuning_;
  StretchEstimate estimate_;
  std::vector<ChartEstimate> charts_;
  std::mutex mutex_;  // of idle_
  std::vector<std::unique_ptr<StretchEstimate::Work>> idle_;
};

}  // namespace planish
