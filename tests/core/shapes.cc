#include "tests/core/shapes.h"

#include <cmath>
#include <fstream>
#include <map>
#include <numbers>
#include <random>
#include <sstream>
#include <stdexcept>

namespace planish::testing {
namespace {

constexpr double kPi = std::numbers::pi;

// Two triangles per cell of a (columns x rows) grid of vertex ids.
std::vector<Face> GridFaces(int columns, int rows, const std::function<int(int, int)>& id) {
  std::vector<Face> faces;
  for (int i = 0; i < columns; ++i) {
    for (int j = 0; j < rows; ++j) {
      const int a = id(i, j), b = id(i + 1, j), c = id(i + 1, j + 1), d = id(i, j + 1);
      if ((i + j) % 2 == 0) {
        faces.insert(faces.end(), {{a, b, c}, {a, c, d}});
      } else {
        faces.insert(faces.end(), {{a, b, d}, {b, c, d}});
      }
    }
  }
  return faces;
}

}  // namespace

Mesh Patch(int columns, int rows, const std::function<Vec3(double, double)>& f, double jitter) {
  Mesh mesh;
  std::mt19937 random(1);
  const auto shift = [&] { return jitter * (2.0 * static_cast<double>(random()) / 4294967295.0 - 1); };
  for (int i = 0; i <= columns; ++i) {
    for (int j = 0; j <= rows; ++j) {
      const bool inside = i > 0 && i < columns && j > 0 && j < rows;
      const double s = (i + (inside ? shift() : 0)) / columns, t = (j + (inside ? shift() : 0)) / rows;
      mesh.positions.push_back(f(s, t));
    }
  }
  mesh.faces = GridFaces(columns, rows, [&](int i, int j) { return i * (rows + 1) + j; });
  return mesh;
}

Mesh Plane(int columns, int rows, double jitter) {
  return Patch(
      columns, rows, [](double s, double t) { return Vec3(s, t, 0); }, jitter);
}

Mesh LShape(int size) {
  Mesh mesh = Plane(2 * size, 2 * size);
  std::erase_if(mesh.faces, [&](const Face& face) {
    const Vec3 middle = (mesh.positions[face[0]] + mesh.positions[face[1]] + mesh.positions[face[2]]) / 3;
    return middle.x() > 0.5 && middle.y() > 0.5;
  });
  return mesh;
}

Mesh Star(int rings) {
  Mesh mesh = PuncturedSphere(rings, 1.0);
  for (Vec3& p : mesh.positions) {
    const double polar = std::acos(p.z()), azimuth = std::atan2(p.y(), p.x());
    const double radius = polar * (1 + 0.3 * std::cos(3 * azimuth));
    p = {radius * std::cos(azimuth), radius * std::sin(azimuth), 0};
  }
  return mesh;
}

Mesh HalfCylinder(int columns, int rows, double jitter) {
  return Patch(
      columns, rows, [](double s, double t) { return Vec3(std::cos(kPi * s), 2 * t, std::sin(kPi * s)); }, jitter);
}

Mesh Hills(int columns, int rows, double height, double jitter) {
  return Patch(
      columns, rows,
      [height](double s, double t) {
        const double x = 2 * s - 1, y = 2 * t - 1;
        return Vec3(x, y, height * (0.4 * std::sin(3 * x) * std::cos(2.5 * y) + 0.3 * std::exp(-5 * (x * x + y * y))));
      },
      jitter);
}

Mesh PuncturedSphere(int rings, double hole) {
  Mesh mesh;
  mesh.positions.push_back({0, 0, 1});
  const int segments = 12;
  for (int r = 1; r <= rings; ++r) {
    const double polar = (kPi - hole) * r / rings;
    for (int s = 0; s < segments; ++s) {
      const double azimuth = 2 * kPi * (s + 0.5 * (r % 2)) / segments;
      mesh.positions.push_back(
          {std::sin(polar) * std::cos(azimuth), std::sin(polar) * std::sin(azimuth), std::cos(polar)});
    }
  }
  const auto id = [&](int ring, int s) { return 1 + (ring - 1) * segments + (s % segments); };
  for (int s = 0; s < segments; ++s) mesh.faces.push_back({0, id(1, s), id(1, s + 1)});
  for (int r = 1; r < rings; ++r) {
    for (int s = 0; s < segments; ++s) {
      const int a = id(r, s), b = id(r, s + 1), c = id(r + 1, s), d = id(r + 1, s + 1);
      if (r % 2 == 1) {
        mesh.faces.insert(mesh.faces.end(), {{a, c, d}, {a, d, b}});
      } else {
        mesh.faces.insert(mesh.faces.end(), {{a, c, b}, {b, c, d}});
      }
    }
  }
  return mesh;
}

Mesh Cone(int valence, double height) {
  Mesh mesh;
  mesh.positions.push_back({0, 0, height});
  for (int i = 0; i < valence; ++i) {
    const double angle = 2 * kPi * i / valence;
    mesh.positions.push_back({std::cos(angle), std::sin(angle), 0});
    mesh.faces.push_back({0, 1 + i, 1 + (i + 1) % valence});
  }
  return mesh;
}

Mesh Tetrahedron() {
  return {{{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {0, 0, 1}}, {{0, 2, 1}, {0, 1, 3}, {1, 2, 3}, {2, 0, 3}}};
}

Mesh Torus(int columns, int rows) {
  Mesh mesh;
  for (int i = 0; i < columns; ++i) {
    for (int j = 0; j < rows; ++j) {
      const double a = 2 * kPi * i / columns, b = 2 * kPi * j / rows, r = 2 + std::cos(b);
      mesh.positions.push_back({r * std::cos(a), r * std::sin(a), std::sin(b)});
    }
  }
  mesh.faces = GridFaces(columns, rows, [&](int i, int j) { return (i % columns) * rows + j % rows; });
  return mesh;
}

Mesh Cylinder(int columns, int rows) {
  Mesh mesh;
  for (int i = 0; i < columns; ++i) {
    for (int j = 0; j <= rows; ++j) {
      const double a = 2 * kPi * i / columns;
      mesh.positions.push_back({std::cos(a), std::sin(a), 1.0 * j});
    }
  }
  mesh.faces = GridFaces(columns, rows, [&](int i, int j) { return (i % columns) * (rows + 1) + j; });
  return mesh;
}

Mesh MoebiusStrip(int cells) {
  Mesh mesh;
  for (int i = 0; i < cells; ++i) {
    const double a = 2 * kPi * i / cells;
    for (const double w : {-0.3, 0.3}) {
      const double r = 1 + w * std::cos(a / 2);
      mesh.positions.push_back({r * std::cos(a), r * std::sin(a), w * std::sin(a / 2)});
    }
  }
  mesh.faces = GridFaces(cells, 1, [&](int i, int j) { return i < cells ? 2 * i + j : 1 - j; });
  return mesh;
}

Mesh ReadTriangleObj(const std::string& path) {
  std::ifstream file(path);
  if (!file) throw std::runtime_error("cannot read " + path);
  Mesh mesh;
  for (std::string line; std::getline(file, line);) {
    std::istringstream words(line);
    std::string kind;
    words >> kind;
    if (kind == "v") {
      std::string x, y, z;
      words >> x >> y >> z;
      mesh.positions.push_back({std::stod(x), std::stod(y), std::stod(z)});  // takes "nan" and "inf" too
    } else if (kind == "f") {
      Face face;
      for (auto& v : face) {
        std::string token;
        words >> token;
        v = std::stoi(token) - 1;
      }
      mesh.faces.push_back(face);
    }
  }
  return mesh;
}

}  // namespace planish::testing
