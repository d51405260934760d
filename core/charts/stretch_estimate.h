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
// L and K of a vertex are the same in every disc that has the vertex inside, so they are computed once. The u of every
// vertex is kept, and the next estimate starts from it.
//
// Several threads may estimate different discs at the same time, each with a Work of its own: an estimate accesses only
// data of the vertices inside its own disc.
class StretchEstimate {
 public:
  // Data of an estimate. May be used again for the next one.
  class Work {
   public:
    // The most vertices that it has been used for.
    std::int32_t capacity() const { return capacity_; }

   private:
    friend class StretchEstimate;
    std::vector<std::int32_t> faces_;  // the faces that Joined() looks at
    std::vector<std::int32_t> free_;   // the vertices that are solved for
    PoissonSolver solver_;
    std::int32_t capacity_ = 0;
  };

  // `gluing` and `tuning` must outlive this. `kept`: TakeKept() of another StretchEstimate of the same surface; empty:
  // u starts from 0.
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

  // The sums of the disc with these interior vertices, all of which are solved for.
  Sums Whole(Parts interior, double area, Work* work);

  // The sums of a large disc to which a disc with the faces `small` has just been glued. Solves only for vertices
  // inside `small` and the faces of the large disc next to it, at most AtlasTuning::estimate_reach for each face of
  // `small`. All other vertices have their kept u. `before`: the sum of both discs' sums with the kept u; neither disc
  // may have been cut since. O(n log n) in the faces of `small`. Not while other threads estimate.
  Sums Joined(std::span<const std::int32_t> small, const Sums& before, Work* work);

  // Starts the next estimates of the same vertices from the u of the last one.
  void Keep(const Work& work);
  // Like Keep(), but returns the kept u that these vertices had before, for Swap().
  struct Kept {
    std::vector<std::int32_t> vertices;
    std::vector<float> u;
  };
  Kept Replace(const Work& work);
  // Exchanges these u with the kept u of their vertices.
  void Swap(Kept* kept);

  // The outline of the map that the kept u of a disc stand for: the position where each half-edge of `outline` begins.
  // `outline` is that of the disc. Edges keep their lengths, except for small corrections that close the polygon.
  std::vector<Vec2> Outline(std::span<const HalfedgeHandle> outline) const;

  // The kept u of a vertex; meaningless for vertices on outlines.
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
  std::vector<std::int32_t> number_;  // per vertex: its index in Work::free_ during a solve, otherwise -1
  std::vector<float> kept_;           // per vertex
  std::vector<char> is_marked_;       // per face: whether it is in Work::faces_; all 0 outside of Joined()
};

}  // namespace planish
