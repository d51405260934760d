// Families of meshes that are damaged, far away or out of all proportion. Part of tests/testing/families.h, which tells
// what they are.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "core/mesh/mesh.h"

namespace planish::testing {

std::vector<std::string> HardFamilies();

// Empty for the name of another family.
Mesh MakeHardFamily(const std::string& family, std::uint64_t seed, int faces);

// Cuts every face that the plane through `point` crosses in up to three.
void CutByPlane(const Vec3& point, const Vec3& normal, Mesh* mesh);

// Vertices of equal positions become one.
Mesh Weld(const Mesh& mesh);

// Adds a part; nothing is welded.
void Append(const Mesh& part, Mesh* mesh);

}  // namespace planish::testing
