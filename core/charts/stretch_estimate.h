// How much a disc would have to be stretched to lie in the plane, without flattening it.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "core/charts/gluing.h"
#include "core/charts/tuning.h"

namespace planish {

// A conformal map of a disc into the plane multiplies lengths by e^u, where u solves the discrete Poisson equation
// L u = -K (L: cotangent Laplacian, K: angle defects of interior vertices; Springborn et al. 2008, Sawhney and Crane
// 2017). Among all of them the one with u = 0 on the outline stretches least (its Dirichlet energy is orthogonal to
// harmonic functions), and ABF with a free boundary comes near it. One linear solve, to a few per cent.
//
// Keeps the u of every corner between estimates, to start the next one from. Not thread-safe.
class StretchEstimate {
 public:
  // Both must outlive this.
  StretchEstimate(const Gluing& gluing, const AtlasTuning& tuning);

  // Over the faces of a disc: area, and the integrals of e^2u and e^-2u.
  struct Sums {
    double area = 0, larger = 0, smaller = 0;

    // Root mean square stretch (Quality::stretch_l2) at the best scale; at least 1. Infinity if it leaves the range of
    // numbers.
    double Stretch() const;
  };

  // Of the disc of these faces, solved for as a whole.
  Sums Whole(std::span<const std::int32_t> first, std::span<const std::int32_t> second = {});

  // Of a disc that `small` has just been glued to: solved for on `small` and the faces of the disc nearest to it, at
  // most estimate_reach times as many, from the kept u and as if those farther away stayed as they are. `before`: the
  // sums of both parts as kept. O(n log n) in the faces of `small`.
  Sums Joined(std::span<const std::int32_t> small, const Sums& before);

  // The map of the last estimate, which was of a whole disc: where each of these half-edges begins, which are the
  // outline of the disc. Edges of the outline keep their lengths, up to what closes it.
  std::vector<Vec2> Outline(std::span<const HalfedgeHandle> outline) const;
  // Such a map inside, of the disc of these faces, between these points of its outline: of each corner, in the order of
  // the faces.
  std::vector<Vec2> Inside(std::span<const std::int32_t> faces, std::span<const HalfedgeHandle> outline,
                           std::span<const Vec2> points);

  // Starts the next estimates of the same faces from the u of the last one.
  void Keep();

 private:
  struct Edge {
    std::int32_t from, to;
    double weight;
  };

  void Mark(std::span<const std::int32_t> faces);
  void NumberVertices();
  void Assemble();
  void Solve();
  double KeptAt(std::int32_t half_edge) const { return static_cast<double>(kept_[half_edge]); }
  double SolvedAt(std::int32_t half_edge) const;
  template <typename Scale>
  Sums SumUp(const Scale& scale_at) const;
  Sums SumUpSolved();

  const Gluing& gluing_;
  const AtlasTuning& tuning_;
  // Per half-edge, of the corner that it faces: cotangent, number of the vertex among those solved for, kept u.
  std::vector<double> cotangent_;
  std::vector<std::int32_t> vertex_;
  std::vector<float> kept_;
  std::vector<Vec2> place_;      // empty until Inside() is called
  std::vector<char> is_marked_;  // per face: one of faces_
  std::vector<HalfedgeHandle> fan_;
  // Of the estimate at hand.
  std::vector<std::int32_t> faces_;
  std::int32_t num_free_ = 0;
  std::vector<double> load_, diagonal_, u_, residual_, direction_, product_, scale_;
  std::vector<Edge> edges_;
};

}  // namespace planish
