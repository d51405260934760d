// Families of meshes that are damaged, far away or out of all proportion. Part of tests/testing/families.h, which tells
// what they are.
#pragma once

#include <cstdint>
#include <functional>
#include <numbers>
#include <string>
#include <vector>

#include "core/mesh/mesh.h"
#include "tests/testing/dice.h"

namespace planish::testing {

inline constexpr double kTurn = 2 * std::numbers::pi;

std::vector<std::string> HardFamilies();

// Empty for the name of another family.
Mesh MakeHardFamily(const std::string& family, std::uint64_t seed, int faces);

struct NamedMaker {
  const char* name;
  Mesh (*make)(Dice& dice, std::uint64_t seed, int faces);
};

template <Mesh (*kMake)(Dice&, int)>
Mesh WithoutSeed(Dice& dice, std::uint64_t, int faces) {
  return kMake(dice, faces);
}

// Those of wild_families.cc, which are among HardFamilies().
std::vector<NamedMaker> WildMakers();

// A member of a family that is not one of these.
Mesh Ordinary(Dice& dice, std::uint64_t seed, int faces);

// A grid of vertices p(u, v), u and v in [0, 1], as triangles.
Mesh Grid(int columns, int rows, const std::function<Vec3(double, double)>& place);

void RoundToFloats(Mesh* mesh);
void TurnOver(Face* face);

// Cuts every face that the plane through `point` crosses in up to three.
void CutByPlane(const Vec3& point, const Vec3& normal, Mesh* mesh);

// Vertices of equal positions become one.
Mesh Weld(const Mesh& mesh);

// Adds a part; nothing is welded.
void Append(const Mesh& part, Mesh* mesh);

}  // namespace planish::testing
