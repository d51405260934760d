// Small meshes for the tests, all made by formula.
#pragma once

#include <cmath>
#include <functional>
#include <string>

#include "Eigen/Geometry"
#include "core/mesh/mesh.h"

namespace planish::testing {

// (columns x rows) cells, two triangles each, at f(s, t) with s, t in [0, 1]; interior points are moved by up to
// `jitter` of a cell (deterministic).
Mesh Patch(int columns, int rows, const std::function<Vec3(double, double)>& f, double jitter = 0);

Mesh Plane(int columns, int rows, double jitter = 0);
// The plane without its quarter s, t > 1/2: an L of 2 size cells a side, with vertices that belong to no face.
Mesh LShape(int size);
// A flat star with three points and 12 boundary vertices.
Mesh Star(int rings);
// Half a cylinder, developable.
Mesh HalfCylinder(int columns, int rows, double jitter = 0);
// A height surface with bumps and saddles.
Mesh Hills(int columns, int rows, double height = 1, double jitter = 0.2);
// A sphere without the faces within `hole` radians of the south pole: rings x 6 rings faces, a fan at the north pole.
Mesh PuncturedSphere(int rings, double hole);
// `valence` triangles round one interior vertex at height `height`.
Mesh Cone(int valence, double height);

// The angle at `o` between the rays to `a` and `b`, in [0, pi].
inline double AngleAt(const Vec3& o, const Vec3& a, const Vec3& b) {
  return std::atan2((a - o).cross(b - o).norm(), (a - o).dot(b - o));
}
inline double AngleAt(const Vec2& o, const Vec2& a, const Vec2& b) {
  return AngleAt(Vec3(o.x(), o.y(), 0), Vec3(a.x(), a.y(), 0), Vec3(b.x(), b.y(), 0));
}

Mesh Tetrahedron();
Mesh Torus(int columns, int rows);
Mesh Cylinder(int columns, int rows);  // two boundary loops
Mesh MoebiusStrip(int cells);

Mesh ReadTriangleObj(const std::string& path);  // v and f lines of triangles; enough for the tests' own data

}  // namespace planish::testing
