// Estimates the outline and the stretch of the maps of charts before they are solved for. That is cheap enough to
// decide which charts to cut or to join, so that most charts are solved only once.
#pragma once

#include <cstdint>
#include <utility>
#include <vector>

#include "core/charts/segmentation.h"
#include "core/charts/stretch_estimate.h"

namespace planish {

struct ChartEstimate {
  std::vector<HalfedgeHandle> outline;  // from FirstOnOutline() on
  std::vector<Vec2> points;             // where each of these half-edges begins in the map
  double stretch = 1;                   // root mean square
  // Faces of the mesh at two places where the outline crosses itself, the farthest apart along it; -1: nowhere.
  std::int32_t face = -1, other_face = -1;
};

// Estimates of all charts of a segmentation. Not thread-safe.
class ChartEstimates {
 public:
  // `segmentation` must outlive this.
  ChartEstimates(const Segmentation& segmentation, const AtlasTuning& tuning);

  const ChartEstimate& of(std::int32_t chart) const { return charts_[chart]; }
  // Estimates the chart in its present shape. Takes about a twentieth of the work of a solve.
  void Update(std::int32_t chart);
  // Like Update(), but returns the previous estimate, for Restore() if the change of the chart is undone.
  struct Before {
    ChartEstimate estimate;
    StretchEstimate::Kept kept;
  };
  Before Replace(std::int32_t chart);
  void Restore(std::int32_t chart, Before before);  // the latest Replace() first
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
  void Look(std::int32_t chart);

  const Segmentation& segmentation_;
  const AtlasTuning tuning_;
  StretchEstimate estimate_;
  std::vector<ChartEstimate> charts_;
};

}  // namespace planish
