// Families of meshes such as users send: random members by seed, for tests of promises that must hold on any mesh.
// Deterministic for a seed on one platform.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "core/mesh/mesh.h"

namespace planish::testing {

// Names of the families below.
std::vector<std::string> Families();

// A member of about `faces` triangles (at least some dozen, at most a few times as many):
//   surface_nets, sparse_nets, dual_contouring, marching_cubes   isosurfaces of random fields, some with noise
//   assembly       bevelled boxes, tubes, gears and plates with holes: welded, touching, intersecting; some parts
//   twice,
//                  turned inside out, or with T-junctions
//   high_genus     a lattice of tubes
//   quantized      a bumpy sphere, decimated and rounded to a coarse grid: needles, faces without area, folds
//   slivers        a plate cut by planes that nearly meet its vertices, as boolean operations leave it
//   skirts         photogrammetry tiles: height fields with vertical skirts
//   pages          sheets that touch along common edges, like a book
//   soup           triangles that share vertices at random
Mesh MakeFamily(const std::string& family, std::uint64_t seed, int faces);

}  // namespace planish::testing
