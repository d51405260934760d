#include "core/mesh/rows.h"

#include <array>
#include <limits>
#include <numeric>

#include "core/base/radix_sort.h"

namespace planish {
namespace {

constexpr int kCellBits = 21;

// How far along the Hilbert curve the cell lies (J. Skilling, "Programming the Hilbert curve", 2004).
std::uint64_t HilbertIndex(std::array<std::uint32_t, 3> x) {
  for (std::uint32_t q = 1u << (kCellBits - 1); q > 1; q >>= 1) {
    const std::uint32_t below = q - 1;
    for (std::uint32_t& xi : x) {
      if ((xi & q) != 0) {
        x[0] ^= below;
      } else {
        const std::uint32_t t = (x[0] ^ xi) & below;
        x[0] ^= t;
        xi ^= t;
      }
    }
  }
  x[1] ^= x[0];
  x[2] ^= x[1];
  std::uint32_t t = 0;
  for (std::uint32_t q = 1u << (kCellBits - 1); q > 1; q >>= 1) {
    if ((x[2] & q) != 0) t ^= q - 1;
  }
  std::uint64_t index = 0;
  for (int bit = kCellBits - 1; bit >= 0; --bit) {
    for (const std::uint32_t xi : x) index = index << 1 | ((xi ^ t) >> bit & 1);
  }
  return index;
}

}  // namespace

std::vector<std::int32_t> InSpatialOrder(const std::vector<Vec3>& positions,
                                         const std::vector<std::int32_t>& vertices) {
  Vec3 low = Vec3::Constant(std::numeric_limits<double>::infinity()), high = -low;
  for (const std::int32_t v : vertices) {
    low = low.cwiseMin(positions[v]);
    high = high.cwiseMax(positions[v]);
  }
  // In halves, which cannot overflow.
  const double extent = (high / 2 - low / 2).maxCoeff();
  constexpr double kLastCell = (1 << kCellBits) - 1;
  std::vector<KeyedIndex> entries;
  entries.reserve(vertices.size());
  for (const std::int32_t v : vertices) {
    std::array<std::uint32_t, 3> cell = {};
    for (int i = 0; extent > 0 && i < 3; ++i) {
      cell[i] = static_cast<std::uint32_t>((positions[v][i] / 2 - low[i] / 2) / extent * kLastCell);
    }
    entries.push_back({HilbertIndex(cell), v});
  }
  SortByKey(&entries);
  std::vector<std::int32_t> order;
  order.reserve(entries.size());
  for (const KeyedIndex& entry : entries) order.push_back(entry.index);
  return order;
}

void AssignRows(const std::vector<std::int32_t>& vertices, Topology* topology) {
  topology->num_rows = static_cast<std::int32_t>(vertices.size());
  topology->vertex_row.assign(topology->num_vertices, -1);
  for (std::int32_t row = 0; row < topology->num_rows; ++row) topology->vertex_row[vertices[row]] = row;

  std::vector<std::int32_t>& begin = topology->row_corner_begin;
  begin.assign(topology->num_rows + 1, 0);
  topology->corner_row.resize(topology->num_corners());
  for (std::int32_t c = 0; c < topology->num_corners(); ++c) {
    const std::int32_t row = topology->vertex_row[topology->faces[c / 3][c % 3]];
    topology->corner_row[c] = row;
    if (row >= 0) ++begin[row + 1];
  }
  std::partial_sum(begin.begin(), begin.end(), begin.begin());

  topology->row_corner.resize(begin.back());
  std::vector<std::int32_t> end(begin.begin(), begin.end() - 1);
  for (std::int32_t c = 0; c < topology->num_corners(); ++c) {
    if (const std::int32_t row = topology->corner_row[c]; row >= 0) topology->row_corner[end[row]++] = c;
  }
}

std::vector<std::int32_t> RowVertices(const Topology& topology) {
  std::vector<std::int32_t> vertices(topology.num_rows);
  for (std::int32_t v = 0; v < topology.num_vertices; ++v) {
    if (topology.vertex_row[v] >= 0) vertices[topology.vertex_row[v]] = v;
  }
  return vertices;
}

}  // namespace planish
