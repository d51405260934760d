#include "core/abf/unfolding.h"

#include <algorithm>
#include <cmath>
#include <cstdint>

namespace planish {

std::vector<std::complex<double>> UnfoldRows(const Topology& topology, const Eigen::VectorXd& cot) {
  using Complex = std::complex<double>;
  const auto multiply = [](Complex a, Complex b) {
    return Complex(a.real() * b.real() - a.imag() * b.imag(), a.real() * b.imag() + a.imag() * b.real());
  };
  // Edge vectors go from triangle to triangle and are added up to positions, never the other way: taking them from the
  // positions of both ends would multiply errors.
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
    // The other edges, as the triangles across them see them.
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
