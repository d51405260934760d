// Tangents of a surface as MikkTSpace defines them (http://www.mikktspace.com), which glTF asks for.
#pragma once

#include <array>
#include <span>
#include <vector>

#include "core/mesh/mesh.h"

namespace planish {

// Triangles without shared vertices: each list has three elements per triangle. UV have v upwards.
struct TangentCorners {
  std::vector<std::array<float, 3>> positions, normals;
  std::vector<std::array<float, 2>> uv;
};

// Per corner x, y, z of the tangent, of length 1, and the sign of the bitangent. Corners with the same position, normal
// and UV have the same tangent if their triangles are connected and turn the same way in the map. Values that are not
// finite count as 0.
std::vector<std::array<float, 4>> ComputeTangents(const TangentCorners& corners);

}  // namespace planish
