#include "core/mesh/spatial_order.h"

#include <algorithm>
#include <array>
#include <bit>

#include "Eigen/Geometry"
#include "core/base/radix_sort.h"

namespace planish {
namespace {

constexpr int kCellBits = 21;

// A Hilbert curve visits the eight octants of a cube one after the other, and each of them in the same way up to a
// symmetry of the cube, the state. The order of the octants and their states follow Hamilton's construction ("Compact
// Hilbert Indices", 2006): `entry` is the corner where the curve enters and `axis` the direction in which it leaves.
struct Step {
  std::uint8_t when;   // position of the octant along the curve, 0 to 7
  std::uint8_t state;  // within the octant
};
using Steps = std::array<std::array<Step, 8>, 24>;  // by state and octant; bit i of the octant is the half along axis i

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

// The position of the cell along the curve.
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
  // Coordinates are halved, so that their differences cannot overflow.
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

std::vector<std::int32_t> FacesByFirstVertex(const std::vector<Face>& faces, const std::vector<std::int32_t>& rank) {
  std::vector<std::int32_t> first;
  first.reserve(faces.size());
  for (const Face& face : faces) first.push_back(std::min({rank[face[0]], rank[face[1]], rank[face[2]]}));
  return GroupByKey(static_cast<std::int32_t>(faces.size()), std::ssize(rank) + 1,
                    [&](std::int32_t f) { return first[f]; })
      .item;
}

}  // namespace planish
