// Meshes by formula that several suites use.
#pragma once

#include <functional>

#include "core/mesh/mesh.h"

namespace planish {

// n x n squares of two triangles each at f(s, t), with s and t from 0 to 1: a disc.
Mesh Grid(int n, const std::function<Vec3(double, double)>& f);

// A bump over a grid of n x n squares: a disc that is not flat.
Mesh Bump(int n);

// Closed.
Mesh Tetrahedron();

}  // namespace planish
