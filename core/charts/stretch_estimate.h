// How much a disc would have to be stretched to lie in the plane, without flattening it.
#pragma once

#include <cstdint>
#include <vector>

#include "core/charts/gluing.h"

namespace planish {

// A conformal map of a disc into the plane multiplies lengths by e^u, where u solves the discrete Poisson equation
// L u = -K (L: cotangent Laplacian, K: angle defects of interior vertices; Springborn et al. 2008, Sawhney and Crane
// 2017). Among all of them the one with u = 0 on the outline stretches least (its Dirichlet energy is orthogonal to
// harmonic functions), and ABF with a free boundary comes near it. One linear solve, to a few per cent.
//
// Keeps the u of every corner between estimates, to start the next one from. Not thread-safe.
class StretchEstimate {
 public:
  // `gluing` must outlive this.
  explicit StretchEstimate(const Gluing& gluing);

  // Root mean square stretch (Quality::stretch_l2) of the disc of these faces, at its best scale; at least 1. Infinity
  // if it leaves the range of numbers.
  double operator()(const std::vector<std::int32_t>& first, const std::vector<std::int32_t>& second);

  // Starts the next estimates of the same faces from the u of the last one.
  void Keep();

  // The u of corners in the discs of the last kept estimates.
  const std::vector<float>& log_scale() const { return kept_; }

 private:
  struct Edge {
    std::int32_t from, to;
    double weight;
  };

  void NumberVertices(const std::vector<std::int32_t>& faces);
  void Assemble(const std::vector<std::int32_t>& faces);
  void Solve();

  const Gluing& gluing_;
  std::vector<double> cotangent_;  // per corner
  std::vector<std::int32_t>
      vertex_;               // per corner: number within the disc, interior ones first; -1 outside of an estimate
  std::vector<float> kept_;  // per corner
  // Of the disc at hand. Vertices at the outline are numbered from -2 down.
  std::vector<std::int32_t> faces_;
  std::int32_t num_interior_ = 0;
  std::vector<double> defect_, diagonal_, u_, residual_, direction_, product_;
  std::vector<Edge> edges_;
};

}  // namespace planish
