// A caller's mesh made ready for the wire.
#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "client/src/errors.h"
#include "planish/v1/planish.pb.h"
#include "planish/types.h"

namespace planish::inline abi0 {

struct PackedMesh {
  // Leaves out vertices without a triangle and encodes the rest. Throws planish::Error: MESH_EMPTY,
  // MESH_INDEX_OUT_OF_RANGE ("faces"), MESH_POSITION_INVALID; OPTIONS_INVALID for seams that are no edges ("edges"),
  // corners that do not exist ("corner"), or polygons, atlases or weights that are not as many as triangles.
  static PackedMesh Of(const MeshView& mesh);

  std::string draco;
  std::string sha256;  // of draco
  // Seams, polygons, atlases and weights: triangles travel in the caller's order.
  v1::MeshElements elements;
  std::int64_t triangles = 0;
  // Caller's vertex id per vertex sent; empty if all were sent and ids agree.
  std::vector<std::int32_t> source_vertex;

  // The bytes of the mesh and its elements, as the server counts them against its limit.
  std::int64_t bytes() const;

  // From ids as sent to the caller's.
  ids::Renumbering ToCaller() const;
};

// Throws MESH_INDEX_OUT_OF_RANGE ("faces") for an id that is not below `vertex_count`.
void CheckIndices(std::span<const std::uint32_t> triangles, std::size_t vertex_count);

}  // namespace planish::inline abi0
