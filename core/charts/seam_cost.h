// What seams cost: the objective of gluing and of moving seams with SeamPreference::kSeams.
//
//   E = (sum over seams of length * visibility * crease + turning) / root of the area
//       + stretch_price * (L2^2 - 1) + chart_price * charts
//
// L2 is the root mean square stretch over all charts, each at its own scale; no chart may exceed the limit that the
// caller sets. `visibility` grows with the open share of the hemisphere (core/mesh/visibility.h), `crease` falls where
// the surface bends, most in a valley. Turning is priced where a seam leaves the direction that it has.
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

  // Of the edge of a half-edge that has faces on both sides: a part of E.
  double OfEdge(HalfedgeHandle h) const { return static_cast<double>(cost_[h.idx() / 2]); }
  // Where a seam goes on from half-edge h to `next`, which starts where h ends.
  double OfTurn(HalfedgeHandle h, HalfedgeHandle next) const;
  // Of half-edges that follow each other, turns included.
  double OfPath(std::span<const HalfedgeHandle> path) const;
  // Of a chart, beside its outline.
  double OfChart(double stretch, double area) const {
    return tuning_.stretch_price * (stretch * stretch - 1) * area / area_ + tuning_.chart_price;
  }

 private:
  const Surface& surface_;
  const AtlasTuning& tuning_;
  double area_ = 0, side_ = 1;  // of the surface, and its root
  std::vector<float> cost_;     // per edge
};

}  // namespace planish
