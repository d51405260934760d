#pragma once

#include "core/mesh/mesh.h"

namespace planish {

// A bump over a grid of n x n squares, 2 n^2 triangles: a disc that is not flat.
Mesh Bump(int n);

}  // namespace planish
