// A caller's mesh, encoded for sending.
#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "client/src/errors.h"
#include "planish/types.h"
#include "planish/v1/planish.pb.h"

namespace planish::inline abi0 {

struct PackedMesh {
  // Encodes `mesh` without the vertices that have no triangle. Throws planish::Error: MESH_EMPTY,
  // MESH_INDEX_OUT_OF_RANGE ("faces"), MESH_POSITION_INVALID; OPTIONS_INVALID for seams that are not edges ("edges"),
  // corners that do not exist ("corner"), and a wrong number of polygons, atlases or weights.
  static PackedMesh Of(const MeshView& mesh);

  std::string draco;
  std::string sha256;  // of draco
  // Seams, polygons, atlases and weights; triangles are sent in the caller's order.
  v1::MeshElements elements;
  std::int64_t triangles = 0;
  // Per vertex sent, the caller's vertex id; empty if all vertices were sent, so that ids are equal.
  std::vector<std::int32_t> source_vertex;

  // The bytes of the mesh and its elements, as the server counts them for its limit.
  std::int64_t bytes() const;

  // Maps ids as sent to the caller's.
  ids::Renumbering ToCaller() const;
};

// Throws MESH_INDEX_OUT_OF_RANGE ("faces") for an id that is not below `vertex_count`.
void CheckIndices(std::span<const std::uint32_t> triangles, std::size_t vertex_count);

}  // namespace planish::inline abi0
