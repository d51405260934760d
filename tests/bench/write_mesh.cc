// planish_write_mesh MESH OUT.obj: a mesh as the measuring programs name it (bench_meshes.h), for programs of others: v
// and f lines only. Prints its label.
#include <cstdio>

#include "tests/bench/bench_meshes.h"

int main(int argc, char** argv) {
  if (argc != 3) {
    std::fprintf(stderr, "usage: planish_write_mesh NAME:TRIANGLES|FAMILY:TRIANGLES:SEED|PATH|PATH@LEVELS OUT.obj\n");
    return 2;
  }
  const auto mesh = planish::bench::LoadMesh(argv[1]);
  if (!mesh.ok()) {
    std::fprintf(stderr, "%s\n", std::string(mesh.status().message()).c_str());
    return 2;
  }
  std::FILE* file = std::fopen(argv[2], "w");
  if (file == nullptr) {
    std::perror(argv[2]);
    return 2;
  }
  // In float, as tools compute: a triangle that has no area in one has none in all, nor for the judge.
  for (const planish::Vec3& point : mesh->positions) {
    const planish::Vec3 p = point.cast<float>().cast<double>();
    std::fprintf(file, "v %.17g %.17g %.17g\n", p.x(), p.y(), p.z());
  }
  for (const planish::Face& f : mesh->faces) std::fprintf(file, "f %d %d %d\n", f[0] + 1, f[1] + 1, f[2] + 1);
  std::printf("%s\n", planish::bench::LabelOf(argv[1]).c_str());
  return std::fclose(file) == 0 ? 0 : 2;
}
