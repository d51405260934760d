#include "core/mesh/face_order.h"

#include "core/mesh/rows.h"

namespace planish {

Eigen::VectorXd SortedTopology::ToSorted(const Eigen::VectorXd& corners) const {
  Eigen::VectorXd sorted(corners.size());
  for (std::size_t f = 0; f < face.size(); ++f) sorted.segment<3>(3 * f) = corners.segment<3>(3 * face[f]);
  return sorted;
}

Eigen::VectorXd SortedTopology::ToOriginal(const Eigen::VectorXd& corners) const {
  Eigen::VectorXd original(corners.size());
  for (std::size_t f = 0; f < face.size(); ++f) original.segment<3>(3 * face[f]) = corners.segment<3>(3 * f);
  return original;
}

SortedTopology SortFaces(const Topology& topology) {
  const std::int32_t num_faces = topology.num_faces();
  SortedTopology sorted;
  std::vector<std::int32_t> place(num_faces, -1);
  sorted.face.reserve(num_faces);
  const auto append = [&](std::int32_t f) {
    if (place[f] >= 0) return;
    place[f] = static_cast<std::int32_t>(sorted.face.size());
    sorted.face.push_back(f);
  };
  for (const std::int32_t c : topology.row_corner) append(c / 3);
  for (std::int32_t f = 0; f < num_faces; ++f) append(f);  // those without a vertex under constraints

  Topology& to = sorted.topology;
  to.num_vertices = topology.num_vertices;
  to.num_interior = topology.num_interior;
  to.faces.reserve(num_faces);
  to.opposite.reserve(topology.num_corners());
  for (const std::int32_t f : sorted.face) {
    to.faces.push_back(topology.faces[f]);
    for (std::int32_t c = 3 * f; c < 3 * f + 3; ++c) {
      const std::int32_t o = topology.opposite[c];
      to.opposite.push_back(o < 0 ? -1 : 3 * place[o / 3] + o % 3);
    }
  }
  AssignRows(RowVertices(topology), &to);
  return sorted;
}

}  // namespace planish
