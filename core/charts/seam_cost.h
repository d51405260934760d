// The cost of seams: the objective of gluing and of moving seams with SeamPreference::kSeams.
//
//   E = (sum over seams of length * visibility * crease + turning) / root of the area
//       + stretch_price * (L2^2 - 1) + chart_price * charts + waste_price * waste
//
// L2 is the root mean square stretch over all charts, each at its own scale; no chart may exceed the caller's limit.
// `waste`, over the area of the surface: the area between the maps of charts and their convex hulls, which is hard to
// fill. `visibility` grows with the visible share of the hemisphere (core/mesh/visibility.h). `crease` is smaller where
// the surface bends, smallest in valleys. `turning` counts where a seam changes its direction.
#pragma once

#include <span>
#include <vector>

#include "core/base/execution.h"
#include "core/charts/gluing.h"
#include "core/charts/surface.h"
#include "core/charts/tuning.h"

namespace planish {

class SeamCost {
 public:
  // `visibility`: per face (FaceVisibility()). Both `surface` and `tuning` must outlive this.
  SeamCost(const Surface& surface, const std::vector<float>& visibility, const AtlasTuning& tuning,
           const Execution& execution);

  // The cost of the edge of a half-edge with faces on both sides: a part of E.
  double OfEdge(HalfedgeHandle h) const { return static_cast<double>(cost_[h.idx() / 2]); }
  // The cost of a turn of a seam from half-edge h to `next`, which starts where h ends.
  double OfTurn(HalfedgeHandle h, HalfedgeHandle next) const;
  // The cost of consecutive half-edges, including turns.
  double OfPath(std::span<const HalfedgeHandle> path) const;
  // The cost of a chart without the cost of its outline. `waste`: the area between its map and the convex hull.
  double OfChart(double stretch, double area, double waste) const {
    return (tuning_.stretch_price * (stretch * stretch - 1) * area + tuning_.waste_price * waste) / area_ +
           tuning_.chart_price;
  }

 private:
  const Surface& surface_;
  const AtlasTuning& tuning_;
  double area_ = 0, side_ = 1;  // of the surface, and its square root
  std::vector<float> cost_;     // per edge
};

}  // namespace planish
