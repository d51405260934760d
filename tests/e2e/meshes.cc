#include "tests/e2e/meshes.h"

#include <cmath>
#include <sstream>
#include <vector>

#include "tests/testing/meshes.h"

namespace planish::testing {
namespace {

Mesh WavySquare(int n, double phase = 0) {
  return Grid(n, [=](double x, double y) { return Vec3(x, y, 0.3 * std::sin(5 * x + phase) * std::cos(4 * y)); });
}

template <typename Element>
void WriteRows(std::ostream& out, const std::string& prefix, const std::vector<Element>& rows, int offset = 0) {
  for (const Element& row : rows) {
    out << prefix << row[0] + offset << " " << row[1] + offset << " " << row[2] + offset << "\n";
  }
}

}  // namespace

std::string GridObj(int n, double phase) {
  const Mesh grid = WavySquare(n, phase);
  std::ostringstream out;
  WriteRows(out, "v ", grid.positions);
  WriteRows(out, "f ", grid.faces, 1);
  return out.str();
}

std::string GridOff(int n) {
  const Mesh grid = WavySquare(n);
  std::ostringstream out;
  out << "OFF\n" << grid.positions.size() << " " << grid.faces.size() << " 0\n";
  WriteRows(out, "", grid.positions);
  WriteRows(out, "3 ", grid.faces);
  return out.str();
}

std::string GridPly(int n) {
  const Mesh grid = WavySquare(n);
  std::ostringstream out;
  out << "ply\nformat ascii 1.0\nelement vertex " << grid.positions.size()
      << "\nproperty float x\nproperty float y\nproperty float z\nelement face " << grid.faces.size()
      << "\nproperty list uchar int vertex_indices\nend_header\n";
  WriteRows(out, "", grid.positions);
  WriteRows(out, "3 ", grid.faces);
  return out.str();
}

std::string GridStl(int n) {
  const Mesh grid = WavySquare(n);
  std::ostringstream out;
  out << "solid grid\n";
  for (const auto& face : grid.faces) {
    out << "facet normal 0 0 1\nouter loop\n";
    for (const int v : face) {
      const auto& p = grid.positions[static_cast<std::size_t>(v)];
      out << "vertex " << p[0] << " " << p[1] << " " << p[2] << "\n";
    }
    out << "endloop\nendfacet\n";
  }
  out << "endsolid grid\n";
  return out.str();
}

const char kClosedObj[] = "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 3 2\nf 1 2 4\nf 2 3 4\nf 3 1 4\n";
const char kFanObj[] = "v 0 0 0\nv 0 0 1\nv 1 0 0\nv 0 1 0\nv -1 0 0\nf 1 2 3\nf 1 2 4\nf 1 2 5\n";

}  // namespace planish::testing
