#include "core/abf/topology.h"

#include <algorithm>
#include <array>
#include <bit>
#include <utility>

#include "Eigen/Geometry"
#include "core/base/radix_sort.h"

namespace planish {
namespace {

constexpr int kCellBits = 21;

// A Hilbert curve passes the eight parts of a cube one after the other, and each of them in the same way up to a
// symmetry of the cube: a state. Which part comes when, and the state in it, is Hamilton's construction ("Compact
// Hilbert Indices", 2006): `entry` is the corner where the curve enters and `axis` the one along which it leaves.
struct Step {
  std::uint8_t when;   // the part is passed, 0 to 7
  std::uint8_t state;  // in it
};
using Steps = std::array<std::array<Step, 8>, 24>;  // by state and part, bit i of which is the half along axis i

constexpr unsigned RotateLeft(unsigned x, unsigned by) {
  return (x << by % 3 | x >> (3 - by % 3)) & 7;
}
constexpr unsigned GrayCode(unsigned i) {
  return i ^ i >> 1;
}

constexpr Steps MakeSteps() {
  Steps steps = {};
  for (unsigned entry = 0; entry < 8; ++entry) {
    for (unsigned axis = 0; axis < 3; ++axis) {
      for (unsigned when = 0; when < 8; ++when) {
        const unsigned part = RotateLeft(GrayCode(when), axis + 1) ^ entry;
        const unsigned sub_entry = when == 0 ? 0 : GrayCode((when - 1) / 2 * 2);
        const unsigned sub_axis =
            when == 0 ? 0 : static_cast<unsigned>(std::countr_one(when % 2 == 0 ? when - 1 : when)) % 3;
        const unsigned next_entry = entry ^ RotateLeft(sub_entry, axis + 1), next_axis = (axis + sub_axis + 1) % 3;
        steps[3 * entry + axis][part] = {static_cast<std::uint8_t>(when),
                                         static_cast<std::uint8_t>(3 * next_entry + next_axis)};
      }
    }
  }
  return steps;
}

// How far along the curve the cell lies.
std::uint64_t HilbertIndex(const std::array<std::uint32_t, 3>& cell) {
  static constexpr Steps kSteps = MakeSteps();
  std::uint64_t index = 0;
  unsigned state = 0;
  for (int bit = kCellBits - 1; bit >= 0; --bit) {
    const Step step = kSteps[state][(cell[0] >> bit & 1) | (cell[1] >> bit & 1) << 1 | (cell[2] >> bit & 1) << 2];
    index = index << 3 | step.when;
    state = step.state;
  }
  return index;
}

}  // namespace

std::vector<std::int32_t> InSpatialOrder(const std::vector<Vec3>& positions, const std::vector<std::int32_t>& vertices,
                                         const Execution& execution) {
  Eigen::AlignedBox3d box;
  for (const std::int32_t v : vertices) box.extend(positions[v]);
  // In halves, which cannot overflow.
  const double extent = (box.max() / 2 - box.min() / 2).maxCoeff();
  constexpr double kLastCell = (1 << kCellBits) - 1;
  std::vector<KeyedIndex> entries(vertices.size());
  execution.ForEach(static_cast<std::int64_t>(vertices.size()), [&](std::int64_t j) {
    const std::int32_t v = vertices[j];
    std::array<std::uint32_t, 3> cell = {};
    for (int i = 0; extent > 0 && i < 3; ++i) {
      cell[i] = static_cast<std::uint32_t>((positions[v][i] / 2 - box.min()[i] / 2) / extent * kLastCell);
    }
    entries[j] = {HilbertIndex(cell), v};
  });
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

  topology->corner_row.resize(topology->num_corners());
  for (std::int32_t c = 0; c < topology->num_corners(); ++c) {
    topology->corner_row[c] = topology->vertex_row[topology->faces[c / 3][c % 3]];
  }
  Groups corners =
      GroupByKey(topology->num_corners(), topology->num_rows, [&](std::int32_t c) { return topology->corner_row[c]; });
  topology->row_corner_begin = std::move(corners.begin);
  topology->row_corner = std::move(corners.item);
}

std::vector<std::int32_t> RowVertices(const Topology& topology) {
  std::vector<std::int32_t> vertices(topology.num_rows);
  for (std::int32_t v = 0; v < topology.num_vertices; ++v) {
    if (topology.vertex_row[v] >= 0) vertices[topology.vertex_row[v]] = v;
  }
  return vertices;
}

Topology MakeTopology(const FlatMesh& disc, std::vector<std::int32_t>* face_order, const Execution& execution) {
  const std::vector<Face>& faces = disc.faces;
  const auto num_faces = static_cast<std::int32_t>(faces.size());
  Topology topology;
  topology.num_vertices = static_cast<std::int32_t>(disc.positions.size());
  std::vector<char> is_boundary(topology.num_vertices, 0);
  for (std::int32_t c = 0; c < 3 * num_faces; ++c) {
    if (disc.opposite[c] < 0) is_boundary[Origin(faces, c)] = is_boundary[Target(faces, c)] = 1;
  }
  std::vector<std::int32_t> rows;
  for (std::int32_t v = 0; v < topology.num_vertices; ++v) {
    if (!is_boundary[v]) rows.push_back(v);
  }
  topology.num_interior = static_cast<std::int32_t>(rows.size());
  rows = InSpatialOrder(disc.positions, rows, execution);

  // By the lowest row of each; those without a vertex under constraints come last.
  const auto num_rows = static_cast<std::int32_t>(rows.size());
  std::vector<std::int32_t> row(topology.num_vertices, num_rows), place(num_faces);
  for (std::int32_t i = 0; i < num_rows; ++i) row[rows[i]] = i;
  for (std::int32_t f = 0; f < num_faces; ++f)
    place[f] = std::min({row[faces[f][0]], row[faces[f][1]], row[faces[f][2]]});
  *face_order = GroupByKey(num_faces, num_rows + 1, [&](std::int32_t f) { return place[f]; }).item;
  for (std::int32_t i = 0; i < num_faces; ++i) place[(*face_order)[i]] = i;

  topology.faces.resize(num_faces);
  topology.opposite.resize(3 * static_cast<std::size_t>(num_faces));
  for (std::int32_t i = 0; i < num_faces; ++i) {
    const std::int32_t f = (*face_order)[i];
    topology.faces[i] = faces[f];
    for (int k = 0; k < 3; ++k) {
      const std::int32_t o = disc.opposite[3 * f + k];
      topology.opposite[3 * i + k] = o < 0 ? -1 : 3 * place[o / 3] + o % 3;
    }
  }
  AssignRows(rows, &topology);
  return topology;
}

}  // namespace planish
