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
//                  twice, turned inside out, or with T-junctions
//   high_genus     a lattice of tubes
//   quantized      a bumpy sphere, decimated and rounded to a coarse grid: needles, faces without area, folds
//   slivers        a plate cut by planes that nearly meet its vertices, as boolean operations leave it
//   skirts         photogrammetry tiles: height fields with vertical skirts
//   pages          sheets that touch along common edges, like a book
//   soup           triangles that share vertices at random
// and those of tests/testing/hard_families.h:
//   far_away       any of these but soup, a million units from the origin, in float or double
//   scaled         the same, 1e-8 to 1e8 times as large, some squeezed along an axis
//   damaged        faces missing, doubled, turned over; vertices joined, pulled together, without a face
//   thin_sheet     a shell that is thinner than its noise
//   one_sided      Moebius strips, Klein bottles and tori that run through each other
//   decimated      edges collapsed at random: folds, needles, edges of many faces
//   levels         terrain in tiles of different resolutions: T-junctions
//   turned         cylinders and cones by fans of needles, some with a tip of almost no size
//   ribbons        bands and wires up to a million times as long as wide
//   crumbs         very many pieces of a few triangles each, of all sizes
//   spikes         a sphere with vertices far out
//   warped         a sphere stretched along the axes, the more the farther out
//   cut_up         isosurfaces and assemblies cut by planes that nearly go through vertices
//   folded         planar sheets folded onto themselves, with needles
//   offset         any of these with a shell at a distance along its normals, that touches it and runs through itself
//   copies         the same mesh up to 40 times in one place: mirrored, inside out, a hair beside
//   cracks         patches whose borders differ by a hair, some gaps filled by slivers
//   uneven         refined towards points up to a billionfold; some with a huge floor
//   winding        ramps that wind up to 30 times round a vertex, pointed cones, fans of spokes of all lengths
//   roman          Steiner's Roman surface and cross-caps
//   depth_image    grids with noise in steps, and long triangles across jumps
//   cards          crossing cards, as of foliage
//   voxels         cubes at random: edges of four faces, pieces that meet in a vertex
//   piles          thousands of faces at one edge, round one vertex, or in one place
//   ear_clipped    polygons with many corners cut up by ears, with a wall between two of them
Mesh MakeFamily(const std::string& family, std::uint64_t seed, int faces);

}  // namespace planish::testing
