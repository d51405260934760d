#include "core/abf/topology.h"

#include <utility>

#include "core/base/radix_sort.h"
#include "core/mesh/spatial_order.h"

namespace planish {

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

  // Sorts faces by their lowest row; faces without a constrained vertex come last.
  const auto num_rows = static_cast<std::int32_t>(rows.size());
  std::vector<std::int32_t> row(topology.num_vertices, num_rows), place(num_faces);
  for (std::int32_t i = 0; i < num_rows; ++i) row[rows[i]] = i;
  *face_order = FacesByFirstVertex(faces, row);
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
