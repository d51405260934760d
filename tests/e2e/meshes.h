// Small meshes as files.
#pragma once

#include <string>

namespace planish::testing {

// A wavy square of 2 n^2 triangles; `phase` makes different ones.
std::string GridObj(int n, double phase = 0);
std::string GridOff(int n);
std::string GridPly(int n);
std::string GridStl(int n);

// A tetrahedron: closed.
extern const char kClosedObj[];
// Three triangles on one edge; the third is on line 8.
extern const char kFanObj[];

}  // namespace planish::testing
