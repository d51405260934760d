// Families of polygon meshes such as files hold: random members by seed. Deterministic for a seed on one platform.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "core/mesh/mesh.h"

namespace planish::testing {

struct Polygons {
  std::vector<Vec3> positions;
  std::vector<std::vector<std::int32_t>> polygons;  // three vertices or more
};

// Names of the families below.
std::vector<std::string> PolygonFamilies();

// A member of about `size` polygons (a few times as many at most):
//   quads          a bumpy grid of quads, none of them plane
//   mixed          the same, with triangles and n-gons among them
//   concave        plates of concave polygons, stars and letters, and walls along them
//   bow_ties       quads, some of them with two corners swapped
//   mirrored       a sheet and its mirror image, folded onto each other: quads with three vertices in common
//   repeated       polygons that name vertices twice: next to each other, across, and along bridges to holes
//   merged         a triangle mesh whose faces were merged to n-gons at random: bent, and with holes
//   flaps          quads with triangles and quads on their diagonals, and on edges that have two faces already
//   voxels         cubes of quads: edges of four faces
//   soup           polygons on few vertices at random
//   doubled        polygons twice: turned over, begun at another corner, triangulated
//   thin           polygons with corners in line, needles, corners in one place, without area
//   spirals        polygons that wind round a corner in space, and unfold onto themselves
//   caps           cylinders with caps of many corners
Polygons MakePolygons(const std::string& family, std::uint64_t seed, int size);

// As an OBJ file, to the last digit.
std::string ObjText(const Polygons& mesh);

}  // namespace planish::testing
