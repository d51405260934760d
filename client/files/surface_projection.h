// Bakes the colours and normals of one file's surface into images of another file's surface that lies close to it, such
// as a scan and its decimated copy.
#pragma once

#include <atomic>
#include <cstdint>

#include "absl/status/statusor.h"
#include "client/files/mesh_file.h"
#include "client/files/mesh_output.h"

namespace planish {

struct SurfaceProjectionOptions {
  double cage = 0.01;  // largest distance from `to`, to either side, at which `from` is found; in diagonals of `to`
  int size = 2048;     // texels per side of the images
};

struct ProjectedMesh {
  WrittenMesh written;
  std::int64_t texels = 0, missed = 0;  // texels inside charts; how many of them found nothing of `from`
  bool has_colors = false;              // false: `from` has none, and only normals were drawn
};

// Writes `to` as a glTF (options.format: kGlb or kGltf) with one material, whose images show the base colours of `from`
// and, as a normal map, its normals. Base colours are the texture, vertex colours and factors of a glTF, map_Kd and
// vertex colours of an OBJ, and vertex colours of a PLY. The normals of `to` are the file's own, or smooth ones if it
// has none. Images are PNG, embedded. options.textures has the limits. INVALID_ARGUMENT: OUTPUT_UNSUPPORTED for other
// formats, UV_MISSING if `to` has no UV, SURFACE_EMPTY, and errors of images. RESOURCE_EXHAUSTED: TEXTURE_MEMORY.
// CANCELLED.
absl::StatusOr<ProjectedMesh> ProjectSurface(const MeshFile& from, const MeshFile& to, const OutputOptions& options,
                                             const SurfaceProjectionOptions& projection);

}  // namespace planish
