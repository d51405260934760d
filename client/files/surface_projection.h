// The looks of one file's surface as images of another file, whose surface lies close: a scan and its decimated copy.
#pragma once

#include <atomic>
#include <cstdint>

#include "absl/status/statusor.h"
#include "client/files/mesh_file.h"
#include "client/files/mesh_output.h"

namespace planish {

struct SurfaceProjectionOptions {
  double cage = 0.01;  // how far from `to` the surface of `from` is looked for, to either side, in diagonals of `to`
  int size = 2048;     // texels per side of the images
};

struct ProjectedMesh {
  WrittenMesh written;
  std::int64_t texels = 0, missed = 0;  // inside charts; of these, where nothing of `from` was found
  bool has_colors = false;              // false: `from` has none, and only normals were drawn
};

// `to` as a glTF (options.format: kGlb or kGltf) with one material: the base colours that `from` shows (texture of
// colours, vertex colours and factors of a glTF, map_Kd and vertex colours of an OBJ, vertex colours of a PLY), and its normals as a
// normal map. Normals of `to` are the file's own, or smooth. Images are PNG, embedded. options.textures has the limits.
// INVALID_ARGUMENT: OUTPUT_UNSUPPORTED for other formats, UV_MISSING, SURFACE_EMPTY, and errors of images.
// RESOURCE_EXHAUSTED: TEXTURE_MEMORY. CANCELLED.
absl::StatusOr<ProjectedMesh> ProjectSurface(const MeshFile& from, const MeshFile& to, const OutputOptions& options,
                                             const SurfaceProjectionOptions& projection);

}  // namespace planish
