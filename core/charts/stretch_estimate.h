// Estimates how much a disc must be stretched to lie in the plane, without flattening it.
#pragma once

#include <cstdint>
#include <initializer_list>
#include <span>
#include <utility>
#include <vector>

#include "core/base/execution.h"
#include "core/charts/gluing.h"
#include "core/charts/poisson_solver.h"
#include "core/charts/tuning.h"

namespace planish {

// A conformal map of a disc into the plane multiplies lengths by e^u, where u solves the discrete Poisson equation
// L u = -K (L: cotangent Laplacian, K: angle defects of interior vertices; Springborn et al. 2008, Sawhney and Crane
// 2017). Among all conformal maps the one with u = 0 on the outline stretches least (this u is orthogonal to harmonic
// functions in the Dirichlet energy), and ABF with a free boundary comes near it. An estimate takes one linear solve
// and is right to a few per cent.
//
// L and K of a vertex are the same in every disc that it lies inside of, so they are computed once. Keeps the u of
// every vertex between estimates, to start the next one from.
//
// Several threads may estimate different discs at the same time, each with a Work of its own: they read and write what
// belongs to the vertices inside of their own disc.
class StretchEstimate {
 public:
  // The estimate at hand, and its memory.
  class Work {
   public:
    std::int32_t capacity() const { return capacity_; }  // vertices that it has memory for

   private:
    friend class StretchEstimate;
    std::vector<std::int32_t> faces_;  // of Joined()
    std::vector<std::int32_t> free_;   // the vertices that are solved for
    PoissonSolver solver_;
    std::int32_t capacity_ = 0;
  };

  // Both must outlive this. `kept`: per vertex, what another one kept of the same surface; empty: 0 everywhere.
  StretchEstimate(const Gluing& gluing, const AtlasTuning& tuning, std::vector<float> kept = {},
                  const Execution& execution = {});

  // Over the faces of a disc: area, and the integrals of e^2u and e^-2u.
  struct Sums {
    double area = 0, larger = 0, smaller = 0;

    // Root mean square stretch (Quality::stretch_l2) at the best scale; at least 1. Infinity if the sums overflow.
    double Stretch() const;
  };

  // Lists of vertices that are used as one.
  using Parts = std::initializer_list<std::span<const std::int32_t>>;

  // The vertices inside of the disc of these faces. O(n).
  std::vector<std::int32_t> InteriorOf(std::span<const std::int32_t> faces);

  // Of the disc with these vertices inside, solved for as a whole.
  Sums Whole(Parts interior, double area, Work* work);

  // Of a disc that `small`, the faces of another one, has just been glued to: solved for at vertices inside of `small`
  // and the faces of the disc nearest to it, at most estimate_reach times as many, from the kept u and as if those
  // farther away stayed as they are. `before`: the sums of both parts as kept, neither of which has been cut since. O(n
  // log n) in the faces of `small`. Not while other threads estimate.
  Sums Joined(std::span<const std::int32_t> small, const Sums& before, Work* work);

  // Starts the next estimates of the same vertices from the u of the last one.
  void Keep(const Work& work);
  // The same, and returns what was kept of these vertices before, for Swap().
  struct Kept {
    std::vector<std::int32_t> vertices;
    std::vector<float> u;
  };
  Kept Replace(const Work& work);
  // Exchanges the u of these vertices with those that are kept.
  void Swap(Kept* kept);

  // The map of a disc with the u that are kept: where each of these half-edges begins, which are its outline. Edges of
  // the outline keep their lengths, up to what closes it.
  std::vector<Vec2> Outline(std::span<const HalfedgeHandle> outline) const;

  // The u that is kept of a vertex; of no use outside of discs.
  double KeptAt(std::int32_t v) const { return static_cast<double>(kept_[v]); }
  // The kept u of all vertices. Nothing may be estimated afterwards.
  std::vector<float> TakeKept() { return std::move(kept_); }

 private:
  struct Vertex {
    double load = 0, diagonal = 0, area = 0;  // -K, the diagonal entry of L, a third of the area of its faces
    std::int32_t begin = 0;                   // where its neighbours begin in neighbours_
  };
  struct Neighbour {
    std::int32_t vertex, edge;
  };

  std::span<const Neighbour> NeighboursOf(std::int32_t v) const {
    return {neighbours_.data() + vertices_[v].begin, neighbours_.data() + vertices_[v + 1].begin};
  }
  void Take(Parts vertices, Work* work);
  Sums SolveFor(Sums sums, bool from_kept, Work* work);

  const Gluing& gluing_;
  const AtlasTuning& tuning_;
  std::vector<double> weight_;    // per edge: minus the entry of L for its two vertices
  std::vector<Vertex> vertices_;  // and one more, for `begin`
  std::vector<Neighbour> neighbours_;
  std::vector<std::int32_t> number_;  // per vertex: among those being solved for, -1 for all others
  std::vector<float> kept_;           // per vertex
  std::vector<char> is_marked_;       // per face: one of Work::faces_, while Joined() looks at them
};

}  // namespace planish
