#include "core/abf/layout.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstdint>
#include <limits>
#include <memory>

#include "core/base/portable_math.h"
#include "core/mesh/half_edges.h"

namespace planish {
namespace {

// A vector in the plane as a complex number: products rotate and scale. Plain arithmetic; std::complex also handles
// infinities, which takes time.
struct Complex {
  double re, im;

  double SquaredNorm() const { return re * re + im * im; }
};
Complex operator*(const Complex& a, const Complex& b) {
  return {a.re * b.re - a.im * b.im, a.re * b.im + a.im * b.re};
}
// -a / b
Complex MinusQuotient(const Complex& a, const Complex& b) {
  const double inverse = -1 / b.SquaredNorm();
  return {(a.re * b.re + a.im * b.im) * inverse, (a.im * b.re - a.re * b.im) * inverse};
}

// The edge vector of each half-edge c = 3 f + k. An array, because a std::vector would be zeroed by one thread; this
// memory is first touched by the loop that fills it, on many threads.
using Edges = std::unique_ptr<Complex[]>;

// The half-edges of every face on its own: half-edge 0 along the real axis, in units of the circumcircle's diameter.
Edges FaceShapes(const Eigen::VectorXd& angles, const Execution& execution) {
  Edges edges = std::make_unique_for_overwrite<Complex[]>(angles.size());
  execution.ForEach(angles.size() / 3, [&](std::int64_t f) {
    const auto [sin0, cos0] = portable::SinCosInTriangle(angles[3 * f]);
    const double sin1 = portable::SinCosInTriangle(angles[3 * f + 1]).sine;
    const auto [sin2, cos2] = portable::SinCosInTriangle(angles[3 * f + 2]);
    // The length of half-edge k is the sine of the angle it faces. It ends at v_{k+2}; turning by the exterior angle
    // there gives the direction of half-edge k + 1.
    const Complex turn1 = {-cos2, sin2}, turn2 = turn1 * Complex{-cos0, sin0};
    edges[3 * f] = {sin0, 0};
    edges[3 * f + 1] = {sin1 * turn1.re, sin1 * turn1.im};
    edges[3 * f + 2] = {sin2 * turn2.re, sin2 * turn2.im};
  });
  return edges;
}

// Rotates and scales each face so that its edges agree with those of its neighbours, from face 0 on.
void JoinFaces(const Topology& topology, const Execution& execution, const Edges& edges) {
  std::vector<char> placed(topology.num_faces(), 0);
  std::vector<std::int32_t> queue;
  queue.reserve(topology.num_faces());
  placed[0] = 1;
  queue.push_back(0);
  for (std::size_t head = 0; head < queue.size(); ++head) {
    if (execution.IsCancelledAt(static_cast<std::int64_t>(head))) return;
    for (int k = 0; k < 3; ++k) {
      const std::int32_t c = 3 * queue[head] + k, o = topology.opposite[c];
      if (o < 0 || placed[o / 3]) continue;
      const std::int32_t g = o / 3;
      placed[g] = 1;
      queue.push_back(g);
      const Complex edge = edges[c], scale = MinusQuotient(edge, edges[o]);
      for (std::int32_t e = 3 * g; e < 3 * g + 3; ++e) edges[e] = scale * edges[e];
      edges[o] = {-edge.re, -edge.im};
    }
  }
}

struct Range {
  double low = std::numeric_limits<double>::infinity(), high = 0;

  void Add(const Range& other) {
    low = std::min(low, other.low);
    high = std::max(high, other.high);
  }
};

// A queue of half-edges by length classes, first in first out within a class. A class spans a factor of about 2^(1/4):
// four of them double the length.
class ShortestFirst {
 public:
  explicit ShortestFirst(double shortest_squared) : shortest_(Class(shortest_squared)), queues_(1), first_(0) {}

  void Push(std::int32_t half_edge, double squared_length) {
    const std::uint64_t shifted = Class(squared_length);
    const std::size_t index = shifted > shortest_ ? shifted - shortest_ : 0;
    if (index >= queues_.size()) queues_.resize(index + 1);
    queues_[index].half_edges.push_back(half_edge);
    first_ = std::min(first_, index);
  }

  // The half-edge that Pop() will probably return after a few more calls; -1 if unknown. For prefetching.
  std::int32_t Foresee() const {
    constexpr std::size_t kAhead = 12;
    if (first_ >= queues_.size()) return -1;
    const Queue& queue = queues_[first_];
    return queue.head + kAhead < queue.half_edges.size() ? queue.half_edges[queue.head + kAhead] : -1;
  }

  // Removes the next half-edge and returns it; -1 if the queue is empty.
  std::int32_t Pop() {
    for (; first_ < queues_.size(); ++first_) {
      Queue& queue = queues_[first_];
      if (queue.head < queue.half_edges.size()) return queue.half_edges[queue.head++];
      queue.half_edges.clear();
      queue.head = 0;
    }
    return -1;
  }

 private:
  struct Queue {
    std::vector<std::int32_t> half_edges;
    std::size_t head = 0;
  };

  // The exponent and the first bit of the mantissa as one number below 4096, which grows with the logarithm.
  static std::uint64_t Class(double squared_length) { return std::bit_cast<std::uint64_t>(squared_length) << 1 >> 52; }

  const std::uint64_t shortest_;
  std::vector<Queue> queues_;
  std::size_t first_;  // all queues before it are empty
};

std::vector<Vec2> SumEdges(const Topology& topology, const Edges& edges, const Range& squared,
                           const Execution& execution) {
  std::vector<Vec2> positions(topology.num_vertices, Vec2::Zero());
  std::vector<char> placed(topology.num_vertices, 0);
  ShortestFirst waiting(squared.low);
  const auto place = [&](std::int32_t v, std::int32_t corner) {
    placed[v] = 1;
    const auto wait = [&](std::int32_t c, std::int32_t neighbour) {
      if (!placed[neighbour]) waiting.Push(c, edges[c].SquaredNorm());
    };
    ForEachInFan(FlatLinks{topology.opposite}, corner, [&](std::int32_t c) {
      const std::int32_t f = c / 3, k = c % 3;
      wait(3 * f + Prev(k), topology.faces[f][Next(k)]);
      // The last edge counter-clockwise has no other face.
      if (topology.opposite[3 * f + Next(k)] < 0) wait(3 * f + Next(k), topology.faces[f][Prev(k)]);
    });
  };
  // Starts at the shortest edge, so that coordinates are small where they must be precise.
  std::int32_t shortest = 0;
  while (shortest + 1 < topology.num_corners() && edges[shortest].SquaredNorm() > squared.low) ++shortest;
  place(Origin(topology.faces, shortest), 3 * (shortest / 3) + Next(shortest % 3));
  std::int64_t steps = 0;
  for (std::int32_t c; (c = waiting.Pop()) >= 0;) {
    if (execution.IsCancelledAt(++steps)) return {};
    if (const std::int32_t soon = waiting.Foresee(); soon >= 0) {
      __builtin_prefetch(&topology.faces[soon / 3]);
      __builtin_prefetch(&topology.opposite[soon]);
      __builtin_prefetch(&edges[soon]);
    }
    const std::int32_t f = c / 3, k = c % 3, from = topology.faces[f][Next(k)], to = topology.faces[f][Prev(k)];
    const Vec2 edge(edges[c].re, edges[c].im);
    if (!placed[to]) {
      positions[to] = positions[from] + edge;
      place(to, 3 * f + Prev(k));
    } else if (!placed[from]) {
      positions[from] = positions[to] - edge;
      place(from, 3 * f + Next(k));
    }
  }
  return positions;
}

}  // namespace

std::vector<Vec2> LayOut(const Topology& topology, const Eigen::VectorXd& angles, const Execution& execution) {
  const Edges edges = FaceShapes(angles, execution);
  if (execution.IsCancelled()) return {};
  JoinFaces(topology, execution, edges);
  const Range squared = execution.SumUp<Range>(topology.num_corners(), [&](std::int64_t c, Range* range) {
    const double squared_length = edges[c].SquaredNorm();
    range->Add({squared_length, squared_length});
  });
  if (execution.IsCancelled()) return {};
  std::vector<Vec2> positions = SumEdges(topology, edges, squared, execution);
  const double unit = 1 / std::sqrt(squared.high);
  execution.ForEach(std::ssize(positions), [&](std::int64_t v) { positions[v] *= unit; });
  if (execution.IsCancelled()) return {};
  return positions;
}

std::vector<std::complex<double>> UnfoldRows(const Topology& topology, const Eigen::VectorXd& cot) {
  using Complex = std::complex<double>;
  const auto multiply = [](Complex a, Complex b) {
    return Complex(a.real() * b.real() - a.imag() * b.imag(), a.real() * b.imag() + a.imag() * b.real());
  };
  // Edge vectors are passed from triangle to triangle and summed up to positions. Computing edges as differences of
  // positions would multiply errors.
  struct Entry {
    std::int32_t corner;  // opposite the edge through which its triangle was reached
    Complex edge;         // that edge, from the vertex after the corner to the one before it
  };
  std::vector<Complex> position(topology.num_vertices);
  std::vector<char> placed(topology.num_vertices, 0), seen(topology.num_faces(), 0);
  std::vector<Entry> queue = {{2, Complex(1)}};
  queue.reserve(topology.num_faces());
  position[topology.faces[0][1]] = 1;
  placed[topology.faces[0][0]] = placed[topology.faces[0][1]] = 1;
  seen[0] = 1;
  for (std::size_t head = 0; head < queue.size(); ++head) {
    const auto [c, edge] = queue[head];
    const std::int32_t f = c / 3, k = c % 3;
    const double cot_from = cot[3 * f + Next(k)], cot_to = cot[3 * f + Prev(k)];
    const Complex side = multiply(edge, Complex(cot_from / (cot_from + cot_to), 1 / (cot_from + cot_to)));
    const std::int32_t apex = topology.faces[f][k];
    if (!placed[apex]) {
      placed[apex] = 1;
      position[apex] = position[topology.faces[f][Next(k)]] + side;
    }
    // Queues the triangle across the edge that `corner` faces, unless it was seen. `vector`: that edge, in the
    // direction in which the next triangle has it.
    const auto cross = [&](std::int32_t corner, Complex vector) {
      const std::int32_t o = topology.opposite[corner];
      if (o < 0 || seen[o / 3]) return;
      seen[o / 3] = 1;
      queue.push_back({o, vector});
    };
    cross(3 * f + Next(k), edge - side);
    cross(3 * f + Prev(k), side);
    if (head == 0) cross(c, -edge);
  }
  std::vector<Complex> rows(topology.num_rows);
  for (std::int32_t v = 0; v < topology.num_vertices; ++v) {
    if (topology.vertex_row[v] >= 0) rows[topology.vertex_row[v]] = position[v];
  }
  const bool finite = std::all_of(rows.begin(), rows.end(),
                                  [](Complex z) { return std::isfinite(z.real()) && std::isfinite(z.imag()); });
  if (!finite) std::fill(rows.begin(), rows.end(), Complex(0));
  return rows;
}

}  // namespace planish
