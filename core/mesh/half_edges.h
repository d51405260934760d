// Half-edges: their numbers in flat arrays, which of them share an edge, and how to walk between them: round a vertex,
// along the boundary, from face to face.
//
// Core has no other such walks. These accept any `links`: FlatLinks below for flat arrays, Gluing
// (core/charts/gluing.h) for the charts of a surface. Next() and Prev() go round a face. Across() leads to the
// neighbouring face's half-edge on the same edge, or to an invalid half-edge on the boundary.
#pragma once

#include <cstdint>
#include <vector>

#include "core/base/execution.h"
#include "core/base/radix_sort.h"
#include "core/mesh/mesh.h"

namespace planish {

// Half-edge c = 3 f + k runs from v_{k+1} to v_{k+2}: corner k of face f faces it.
inline std::int32_t Origin(const std::vector<Face>& faces, std::int32_t c) {
  return faces[c / 3][Next(c % 3)];
}
inline std::int32_t Target(const std::vector<Face>& faces, std::int32_t c) {
  return faces[c / 3][Prev(c % 3)];
}

// Half-edges by number. `opposite` has the half-edge on the other side of the edge, -1 on the boundary.
struct FlatLinks {
  using HalfEdge = std::int32_t;
  const std::vector<std::int32_t>& opposite;

  static std::int32_t Next(std::int32_t c) { return c % 3 == 2 ? c - 2 : c + 1; }
  static std::int32_t Prev(std::int32_t c) { return c % 3 == 0 ? c + 2 : c - 1; }
  std::int32_t Across(std::int32_t c) const { return opposite[c]; }
  static bool IsValid(std::int32_t c) { return c >= 0; }
};

// A manifold mesh in flat arrays: faces, and the opposite of each half-edge, -1 on the boundary.
struct FlatMesh {
  std::vector<Face> faces;
  std::vector<std::int32_t> opposite;
  std::vector<Vec3> positions;
};

// Calls visit(h) for every half-edge h that faces the same vertex as `start`, in the fan of faces round that vertex:
// counter-clockwise from `start` and, if that ends at the boundary, then clockwise from `start`. Returns whether the
// fan is closed.
template <typename Links, typename Visit>
bool ForEachInFan(const Links& links, typename Links::HalfEdge start, const Visit& visit) {
  auto h = start;
  do {
    visit(h);
    auto across = links.Across(links.Next(h));
    if (!Links::IsValid(across)) {
      for (h = start; Links::IsValid(across = links.Across(links.Prev(h)));) {
        h = links.Prev(across);
        visit(h);
      }
      return false;
    }
    h = links.Next(across);
  } while (h != start);
  return true;
}

// The faces of half-edges that are joined by `opposite`. Every fan of corners becomes a vertex. Vertices are numbered
// in the order of their lowest corners; calls visit(c) for the lowest corner c of each, in that order.
template <typename Visit>
std::vector<Face> FacesOfFans(const std::vector<std::int32_t>& opposite, const Visit& visit) {
  std::vector<Face> faces(opposite.size() / 3, {-1, -1, -1});
  std::int32_t count = 0;
  for (std::int32_t c = 0; c < static_cast<std::int32_t>(opposite.size()); ++c) {
    if (faces[c / 3][c % 3] >= 0) continue;
    ForEachInFan(FlatLinks{opposite}, c, [&](std::int32_t d) { faces[d / 3][d % 3] = count; });
    ++count;
    visit(c);
  }
  return faces;
}

// The boundary half-edge that starts where boundary half-edge h ends, and the one that ends where h starts. All of
// these belong to a face.
template <typename Links>
typename Links::HalfEdge NextOnBoundary(const Links& links, typename Links::HalfEdge h) {
  h = links.Next(h);
  for (auto across = links.Across(h); Links::IsValid(across); across = links.Across(h)) h = links.Next(across);
  return h;
}
template <typename Links>
typename Links::HalfEdge PreviousOnBoundary(const Links& links, typename Links::HalfEdge h) {
  h = links.Prev(h);
  for (auto across = links.Across(h); Links::IsValid(across); across = links.Across(h)) h = links.Prev(across);
  return h;
}

// Calls visit(h) for every half-edge h of the boundary loop of `start`, beginning there.
template <typename Links, typename Visit>
void ForEachOnLoop(const Links& links, typename Links::HalfEdge start, const Visit& visit) {
  auto h = start;
  do {
    visit(h);
    h = NextOnBoundary(links, h);
  } while (h != start);
}

// Boundary half-edges, counter-clockwise round the faces, one group for each loop.
using Loops = Groups;

// All loops, in the order of their first half-edges.
inline Loops BoundaryLoops(const std::vector<std::int32_t>& opposite) {
  Loops loops;
  std::vector<char> seen(opposite.size(), 0);
  for (std::int32_t start = 0; start < static_cast<std::int32_t>(opposite.size()); ++start) {
    if (opposite[start] >= 0 || seen[start]) continue;
    ForEachOnLoop(FlatLinks{opposite}, start, [&](std::int32_t c) {
      seen[c] = 1;
      loops.item.push_back(c);
    });
    loops.begin.push_back(static_cast<std::int32_t>(loops.item.size()));
  }
  return loops;
}

// Disjoint sets of [0, size). The representative of a set is its smallest member.
class UnionFind {
 public:
  explicit UnionFind(std::size_t size) : parent_(Indices(size)) {}

  std::int32_t Find(std::int32_t i) {
    while (parent_[i] != i) i = parent_[i] = parent_[parent_[i]];
    return i;
  }
  // Joins the sets of i and j. Returns whether they were different sets.
  bool Join(std::int32_t i, std::int32_t j) {
    i = Find(i), j = Find(j);
    parent_[i < j ? j : i] = i < j ? i : j;
    return i != j;
  }

 private:
  std::vector<std::int32_t> parent_;
};

// Per face: the number of its connected piece, ascending with the pieces' lowest faces; -1 where takes_part(f) is
// false. neighbour(f, k) is the face across the edge that corner k faces, or -1. Sets `count` to the number of pieces.
template <typename TakesPart, typename Neighbour>
std::vector<std::int32_t> ConnectedPieces(std::int32_t num_faces, std::int32_t* count, const TakesPart& takes_part,
                                          const Neighbour& neighbour) {
  std::vector<std::int32_t> piece(num_faces, -1), stack;
  *count = 0;
  for (std::int32_t start = 0; start < num_faces; ++start) {
    if (piece[start] >= 0 || !takes_part(start)) continue;
    piece[start] = (*count)++;
    stack.push_back(start);
    while (!stack.empty()) {
      const std::int32_t f = stack.back();
      stack.pop_back();
      for (int k = 0; k < 3; ++k) {
        const std::int32_t g = neighbour(f, k);
        if (g < 0 || piece[g] >= 0) continue;
        piece[g] = piece[f];
        stack.push_back(g);
      }
    }
  }
  return piece;
}

// ConnectedPieces() of all faces.
template <typename Neighbour>
std::vector<std::int32_t> ConnectedPieces(std::int32_t num_faces, std::int32_t* count, const Neighbour& neighbour) {
  const auto all = [](std::int32_t) { return true; };
  return ConnectedPieces(num_faces, count, all, neighbour);
}

// Renumbers labels in [0, num_labels) to 0, 1, 2, ... in the order of their first appearance; -1 stays. Returns the
// number of different labels.
inline std::int32_t NumberByFirst(std::size_t num_labels, std::vector<std::int32_t>* labels) {
  std::vector<std::int32_t> number(num_labels, -1);
  std::int32_t count = 0;
  for (std::int32_t& label : *labels) {
    if (label < 0) continue;
    if (number[label] < 0) number[label] = count++;
    label = number[label];
  }
  return count;
}

// The half-edges of each undirected edge, ascending. Edges ascend by their lower, then by their higher vertex.
using EdgeGroups = Groups;

// Groups the half-edges of these faces by edge. O(F) for bounded valence. Vertices must be in [0, num_vertices). Faces
// whose `takes_part` is 0 are left out (empty: all take part). Half-edges from a vertex to itself form a group, too. No
// groups after a cancellation.
EdgeGroups GroupHalfEdges(const std::vector<Face>& faces, std::int64_t num_vertices, const Execution& execution = {},
                          const std::vector<char>& takes_part = {});

}  // namespace planish
