#include "core/unwrap/partition.h"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <utility>

#include "core/mesh/box_tree.h"
#include "core/mesh/half_edges.h"
#include "core/mesh/predicates.h"
#include "core/pack/necks.h"

namespace planish {
namespace {

constexpr double kLeastGain = 0.1;  // in convex hulls, of the mean area of charts, that is worth a cut
constexpr double kWidth = 0.01;     // of a cut, times the side of the square that all charts would fill

// The outline of the map, counter-clockwise.
std::vector<Vec2> OutlineOf(const Chart& chart, const ChartMap& map) {
  const std::vector<std::int32_t>& opposite = chart.topology.opposite;
  std::vector<Vec2> outline;
  const auto start = static_cast<std::int32_t>(std::find(opposite.begin(), opposite.end(), -1) - opposite.begin());
  std::int32_t c = start;
  do {
    outline.push_back(map.positions[Origin(chart.topology.faces, c)]);
    c = NextOnOutline(opposite, c);
  } while (c != start);
  return outline;
}

// Per face: the middle of all faces that it must not be parted from, itself included.
std::vector<Vec2> Middles(const Surface& surface, const Chart& chart, const ChartMap& map) {
  const Topology& topology = chart.topology;
  std::vector<Vec2> middle(topology.num_faces());
  for (std::int32_t f = 0; f < topology.num_faces(); ++f) {
    const auto& [a, b, c] = topology.faces[f];
    middle[f] = (map.positions[a] + map.positions[b] + map.positions[c]) / 3;
  }
  if (surface.uncut.empty()) return middle;
  std::vector<char> done(topology.num_faces(), 0);
  std::vector<std::int32_t> group;
  for (std::int32_t start = 0; start < topology.num_faces(); ++start) {
    if (done[start]) continue;
    done[start] = 1;
    group = {start};
    Vec2 sum = Vec2::Zero();
    for (std::size_t i = 0; i < group.size(); ++i) {
      const std::int32_t f = group[i];
      sum += middle[f];
      for (std::int32_t k = 0; k < 3; ++k) {
        const std::int32_t o = topology.opposite[3 * f + k];
        if (o < 0 || done[o / 3] || !surface.is_uncut(3 * chart.faces[f] + k)) continue;
        done[o / 3] = 1;
        group.push_back(o / 3);
      }
    }
    for (const std::int32_t f : group) middle[f] = sum / static_cast<double>(group.size());
  }
  return middle;
}

// Pieces of faces between which no step from middle to middle crosses a chord, numbered by their lowest faces.
std::vector<std::int32_t> Pieces(const Topology& topology, const std::vector<Vec2>& middle,
                                 const std::vector<std::pair<Vec2, Vec2>>& chords, std::int32_t* count) {
  std::vector<char> crossed(topology.num_corners(), 0);
  for (const auto& [a, b] : chords) {
    Box box;
    box.Add(a);
    box.Add(b);
    for (std::int32_t c = 0; c < topology.num_corners(); ++c) {
      const std::int32_t o = topology.opposite[c];
      if (o < c) continue;
      const Vec2 &p = middle[c / 3], &q = middle[o / 3];
      Box step;
      step.Add(p);
      step.Add(q);
      if (p != q && step.Meets(box) && SegmentsMeet(a, b, p, q)) crossed[c] = crossed[o] = 1;
    }
  }
  std::vector<std::int32_t> piece(topology.num_faces(), -1), stack;
  *count = 0;
  for (std::int32_t start = 0; start < topology.num_faces(); ++start) {
    if (piece[start] >= 0) continue;
    piece[start] = (*count)++;
    stack = {start};
    while (!stack.empty()) {
      const std::int32_t f = stack.back();
      stack.pop_back();
      for (std::int32_t c = 3 * f; c < 3 * f + 3; ++c) {
        const std::int32_t o = topology.opposite[c];
        if (o < 0 || crossed[c] || piece[o / 3] >= 0) continue;
        piece[o / 3] = piece[f];
        stack.push_back(o / 3);
      }
    }
  }
  return piece;
}

double DoubleArea(const ChartMap& map, const Face& face) {
  const auto& [a, b, c] = face;
  const Vec2 u = map.positions[b] - map.positions[a], v = map.positions[c] - map.positions[a];
  return std::abs(u.x() * v.y() - u.y() * v.x());
}

// All but the largest `most` pieces go to a neighbour, the one with the longest common border, smallest pieces first.
void MergeCrumbs(const Chart& chart, const ChartMap& map, std::size_t most, std::int32_t count,
                 std::vector<std::int32_t>* piece) {
  const Topology& topology = chart.topology;
  std::vector<double> area(count, 0);
  for (std::int32_t f = 0; f < topology.num_faces(); ++f) area[(*piece)[f]] += DoubleArea(map, topology.faces[f]);
  std::vector<std::int32_t> order(count);
  std::iota(order.begin(), order.end(), 0);
  std::stable_sort(order.begin(), order.end(), [&](std::int32_t a, std::int32_t b) { return area[a] < area[b]; });
  for (std::size_t i = 0; i + most < order.size(); ++i) {
    std::vector<double> border(count, 0);
    for (std::int32_t c = 0; c < topology.num_corners(); ++c) {
      const std::int32_t o = topology.opposite[c];
      if ((*piece)[c / 3] != order[i] || o < 0 || (*piece)[o / 3] == order[i]) continue;
      border[(*piece)[o / 3]] +=
          (map.positions[Target(topology.faces, c)] - map.positions[Origin(topology.faces, c)]).norm();
    }
    const auto to = static_cast<std::int32_t>(std::max_element(border.begin(), border.end()) - border.begin());
    std::replace(piece->begin(), piece->end(), order[i], to);
  }
}

}  // namespace

std::vector<std::int32_t> PartAtNecks(const Surface& surface, const Chart& chart, const ChartMap& map,
                                      double total_area, int num_charts) {
  const std::vector<Vec2> outline = OutlineOf(chart, map);
  std::vector<std::pair<Vec2, Vec2>> chords;
  for (const auto& [i, j] :
       FindNecks(outline, {kLeastGain * total_area / num_charts, kWidth * std::sqrt(total_area)})) {
    chords.emplace_back(outline[i], outline[j]);
  }
  if (chords.empty()) return {};
  std::int32_t count = 0;
  std::vector<std::int32_t> piece = Pieces(chart.topology, Middles(surface, chart, map), chords, &count);
  MergeCrumbs(chart, map, chords.size() + 1, count, &piece);
  std::vector<std::int32_t> number(count, -1);
  std::int32_t parts = 0;
  for (std::int32_t& p : piece) {
    if (number[p] < 0) number[p] = parts++;
    p = number[p];
  }
  if (parts < 2) return {};
  return piece;
}

}  // namespace planish
