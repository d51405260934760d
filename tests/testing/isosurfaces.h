// Isosurfaces of random fields, such as generative models deliver. Deterministic.
#pragma once

#include <array>
#include <cstdint>
#include <functional>

#include "core/mesh/mesh.h"

namespace planish::testing {

// A smooth function of space; the surface is where it is 0, the solid where it is below 0.
using Field = std::function<double(const Vec3&)>;

// How an isosurface becomes triangles on a grid of cells.
enum class Contouring {
  kSurfaceNets,  // a vertex a cell with a change of sign; a quad round each grid edge with one (Gibson 1998)
  kSparseNets,   // the same, and a quad wherever the four cells round a grid edge have a vertex, as generative models
                 // decode sparse voxels: sheets meet at edges of three and four faces
  kDualContouring,  // surface nets with vertices where tangent planes meet (Ju et al. 2002)
  kMarchingCubes,   // triangles within each cell; ambiguous sides are split the same way from both cells
};

// The isosurface of `field` in [-1, 1]^3 on n^3 cells. Quads are split along their shorter diagonal.
Mesh Isosurface(const Field& field, int n, Contouring contouring);

// A random smooth field: sums of waves, blobs or a gyroid, with thin sheets and floaters.
Field RandomField(std::uint64_t seed);

// Triangles for four corners in their order, split along the shorter diagonal.
void AddQuad(const std::array<std::int32_t, 4>& quad, Mesh* mesh);

}  // namespace planish::testing
