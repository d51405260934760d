// planish_cgal_lscm MESH.obj MAP.obj: CGAL's Least Squares Conformal Maps with its default border (two pinned vertices)
// and default solver; prints wall-clock and CPU seconds of the parameterization alone and writes the UV.
//
// Built only where CGAL is found; CGAL's Surface_mesh_parameterization is under the GPL, and nothing else links it.
#include <chrono>
#include <cstdio>
#include <ctime>
#include <vector>

#include "CGAL/Simple_cartesian.h"
#include "CGAL/Surface_mesh.h"
#include "CGAL/Surface_mesh_parameterization/LSCM_parameterizer_3.h"
#include "CGAL/Surface_mesh_parameterization/parameterize.h"
#include "CGAL/boost/graph/helpers.h"
#include "client/files/mesh_file.h"

namespace {

namespace parameterization = CGAL::Surface_mesh_parameterization;
using Kernel = CGAL::Simple_cartesian<double>;
using SurfaceMesh = CGAL::Surface_mesh<Kernel::Point_3>;
using Vertex = SurfaceMesh::Vertex_index;

int Fail(const char* message) {
  std::fprintf(stderr, "planish_cgal_lscm: %s\n", message);
  return 1;
}

}  // namespace

int main(int argc, char** argv) {
  if (argc != 3) return Fail("usage: planish_cgal_lscm MESH.obj MAP.obj");
  const auto file = planish::ReadMeshFile(argv[1]);
  if (!file.ok()) return Fail("cannot read the mesh");
  const planish::Mesh mesh = planish::Triangulate(file->mesh).mesh;

  SurfaceMesh surface;
  for (const planish::Vec3& p : mesh.positions) surface.add_vertex({p.x(), p.y(), p.z()});
  for (const planish::Face& f : mesh.faces) surface.add_face(Vertex(f[0]), Vertex(f[1]), Vertex(f[2]));
  auto uv = surface.add_property_map<Vertex, Kernel::Point_2>("uv").first;

  const std::clock_t cpu_start = std::clock();
  const auto start = std::chrono::steady_clock::now();
  SurfaceMesh::Halfedge_index border;
  for (const auto h : surface.halfedges()) {
    if (surface.is_border(h)) {
      border = h;
      break;
    }
  }
  parameterization::LSCM_parameterizer_3<SurfaceMesh> parameterizer;
  const auto error = parameterization::parameterize(surface, parameterizer, border, uv);
  const double seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
  const double cpu_seconds = static_cast<double>(std::clock() - cpu_start) / CLOCKS_PER_SEC;
  if (error != parameterization::OK) return Fail(parameterization::get_error_message(error));

  std::FILE* out = std::fopen(argv[2], "w");
  if (out == nullptr) return Fail("cannot write the map");
  for (const Vertex v : surface.vertices()) std::fprintf(out, "vt %.17g %.17g\n", uv[v].x(), uv[v].y());
  for (const planish::Face& f : mesh.faces) {
    std::fprintf(out, "f %d/%d %d/%d %d/%d\n", f[0] + 1, f[0] + 1, f[1] + 1, f[1] + 1, f[2] + 1, f[2] + 1);
  }
  if (std::fclose(out) != 0) return Fail("cannot write the map");
  std::printf("RESULT \"map_seconds\":%.6f,\"map_cpu_seconds\":%.6f\n", seconds, cpu_seconds);
  return 0;
}
