#include "core/abf/layout.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <numeric>
#include <utility>

#include "core/mesh/half_edges.h"

namespace planish {
namespace {

// A half-edge c = 3 f + k as a vector: log of its length and its direction, an angle.
struct PolarEdges {
  std::vector<double> log_length;
  std::vector<double> direction;
};

PolarEdges PropagateEdges(const Topology& topology, const Eigen::VectorXd& angles) {
  const std::int32_t num_corners = topology.num_corners();
  PolarEdges edges = {std::vector<double>(num_corners), std::vector<double>(num_corners)};
  std::vector<char> placed(topology.num_faces(), 0);
  std::vector<std::int32_t> queue;
  queue.reserve(topology.num_faces());
  // Places the face of half-edge c from the length and direction of c.
  const auto place = [&](std::int32_t c, double log_length, double direction) {
    const std::int32_t f = c / 3;
    const double log_scale = log_length - std::log(std::sin(angles[c]));
    double turned = direction;
    for (int k = c % 3, i = 0; i < 3; ++i, k = Next(k)) {
      const std::int32_t e = 3 * f + k;
      edges.log_length[e] = i == 0 ? log_length : log_scale + std::log(std::sin(angles[e]));
      edges.direction[e] = turned;
      // Half-edge k ends at v_{k+2}, where the exterior angle leads on to half-edge k + 1.
      turned += std::numbers::pi - angles[3 * f + Prev(k)];
    }
    placed[f] = 1;
    queue.push_back(f);
  };
  place(0, 0, 0);
  for (std::size_t head = 0; head < queue.size(); ++head) {
    for (int k = 0; k < 3; ++k) {
      const std::int32_t c = 3 * queue[head] + k, o = topology.opposite[c];
      if (o < 0 || placed[o / 3]) continue;
      place(o, edges.log_length[c], std::remainder(edges.direction[c] + std::numbers::pi, 2 * std::numbers::pi));
    }
  }
  return edges;
}

class DisjointSets {
 public:
  explicit DisjointSets(std::int32_t n) : parent_(n) { std::iota(parent_.begin(), parent_.end(), 0); }
  // Whether a and b were apart.
  bool Unite(std::int32_t a, std::int32_t b) {
    a = Find(a);
    b = Find(b);
    parent_[a] = b;
    return a != b;
  }

 private:
  std::int32_t Find(std::int32_t a) {
    while (parent_[a] != a) a = parent_[a] = parent_[parent_[a]];
    return a;
  }
  std::vector<std::int32_t> parent_;
};

// Half-edges of the minimum spanning tree of the vertices by length (Kruskal), shortest first.
std::vector<std::int32_t> ShortestTree(const Topology& topology, const std::vector<double>& log_length) {
  std::vector<std::pair<double, std::int32_t>> sorted;
  sorted.reserve(topology.num_corners());
  for (std::int32_t c = 0; c < topology.num_corners(); ++c) {
    if (topology.opposite[c] < c) sorted.emplace_back(log_length[c], c);
  }
  std::sort(sorted.begin(), sorted.end());
  DisjointSets sets(topology.num_vertices);
  std::vector<std::int32_t> tree;
  tree.reserve(topology.num_vertices);
  for (const auto& [length, c] : sorted) {
    if (sets.Unite(Origin(topology.faces, c), Target(topology.faces, c))) tree.push_back(c);
  }
  return tree;
}

}  // namespace

Layout LayOut(const Topology& topology, const Eigen::VectorXd& angles) {
  PolarEdges edges = PropagateEdges(topology, angles);
  const auto [shortest, longest] = std::minmax_element(edges.log_length.begin(), edges.log_length.end());
  Layout layout;
  layout.scale_range = std::exp(*longest - *shortest);
  const double unit = *longest;
  const auto vector = [&](std::int32_t c) -> Vec2 {
    const double length = std::exp(edges.log_length[c] - unit);
    return {length * std::cos(edges.direction[c]), length * std::sin(edges.direction[c])};
  };

  // Neighbours in the tree, in compressed rows.
  const std::vector<std::int32_t> tree = ShortestTree(topology, edges.log_length);
  std::vector<std::int32_t> begin(topology.num_vertices + 1, 0), row(2 * tree.size());
  for (const std::int32_t c : tree) {
    ++begin[Origin(topology.faces, c) + 1];
    ++begin[Target(topology.faces, c) + 1];
  }
  std::partial_sum(begin.begin(), begin.end(), begin.begin());
  std::vector<std::int32_t> cursor(begin.begin(), begin.end() - 1);
  for (const std::int32_t c : tree) {
    row[cursor[Origin(topology.faces, c)]++] = c;
    row[cursor[Target(topology.faces, c)]++] = c;
  }

  // From the shortest edge, so that where coordinates must be fine they are small.
  layout.positions.assign(topology.num_vertices, Vec2::Zero());
  std::vector<char> placed(topology.num_vertices, 0);
  std::vector<std::int32_t> queue = {Origin(topology.faces, tree.front())};
  placed[queue.front()] = 1;
  for (std::size_t head = 0; head < queue.size(); ++head) {
    const std::int32_t v = queue[head];
    for (std::int32_t i = begin[v]; i < begin[v + 1]; ++i) {
      const std::int32_t c = row[i], from = Origin(topology.faces, c), to = Target(topology.faces, c);
      const std::int32_t next = from == v ? to : from;
      if (placed[next]) continue;
      placed[next] = 1;
      const Vec2 step = vector(c);
      layout.positions[next] = from == v ? Vec2(layout.positions[v] + step) : Vec2(layout.positions[v] - step);
      queue.push_back(next);
    }
  }

  for (std::int32_t c = 0; c < topology.num_corners(); ++c) {
    const Vec2 wanted = vector(c);
    const Vec2 got = layout.positions[Target(topology.faces, c)] - layout.positions[Origin(topology.faces, c)];
    layout.largest_gap = std::max(layout.largest_gap, (got - wanted).norm() / wanted.norm());
  }
  return layout;
}

}  // namespace planish
