// Where a PLY file has its geometry and its UV: shared by the reader and the writer.
#pragma once

#include <array>
#include <optional>
#include <string>
#include <string_view>

#include "absl/status/statusor.h"
#include "core/io/ply_header.h"

namespace planish {

// Indices of elements in the header, and of properties in their element.
struct PlyLayout {
  std::size_t vertex = 0;
  std::size_t face = 0;
  std::array<std::size_t, 3> xyz = {};
  std::size_t indices = 0;  // the list of a face's vertices
  // UV of the vertices: s and t, u and v, texture_u and texture_v, or texture_s and texture_t.
  std::optional<std::array<std::size_t, 2>> vertex_uv;
  // UV of a face's corners, u v u v ...: the list texcoord (MeshLab and its kin).
  std::optional<std::size_t> face_uv;
};

// FILE_MALFORMED: no vertices or faces, or one of their necessary properties is missing or of the wrong type.
absl::StatusOr<PlyLayout> FindPlyLayout(const std::string& path, const PlyHeader& header);

}  // namespace planish
