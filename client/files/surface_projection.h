// Bakes the look of one file's surface (colours, normals, height, occlusion) into images of another that lies close,
// such as a scan and its decimated copy.
#pragma once

#include <algorithm>
#include <atomic>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "client/files/mesh_file.h"
#include "client/files/mesh_output.h"

namespace planish {

struct SurfaceProjectionOptions {
  double cage = 0.01;  // largest distance from `to`, to either side, at which `from` is found; in diagonals of `to`
  int size = 2048;     // texels per side of the images
  bool colors = true;  // if `from` has any
  bool normals = true, height = false, occlusion = false;
  double occlusion_reach = 1;  // how far `from` can hide the sky from itself, in diagonals of `from`
};

// Grey of 16 bits: `from` lies low + (high - low) * value / 65535 above `to`, along its normals.
struct HeightImage {
  std::string path;
  double low = 0, high = 0;
};

struct ProjectedMesh {
  WrittenMesh written;
  std::int64_t texels = 0, missed = 0;  // inside charts; of these, where nothing of `from` was found
  std::vector<std::string> baked;       // "normals", "colors", "occlusion", "height"
  std::optional<HeightImage> height;

  bool Has(const char* image) const { return std::find(baked.begin(), baked.end(), image) != baked.end(); }
};

// `to` as a glTF (options.format: kGlb or kGltf) with one material: the base colours that `from` shows (texture of
// colours, vertex colours and factors of a glTF, map_Kd and vertex colours of an OBJ, vertex colours of a PLY), its
// normals, bent by the normal maps of a glTF, as a normal map, and the occlusion of `from` by itself (Project()).
// Normals of `to` are the file's own, or smooth. Images are PNG, embedded; heights are a file beside the output.
// options.textures has the limits.
// INVALID_ARGUMENT: OUTPUT_UNSUPPORTED for other formats, and for heights beside stdout, UV_MISSING, SURFACE_EMPTY, and
// errors of images. RESOURCE_EXHAUSTED: TEXTURE_MEMORY. CANCELLED.
absl::StatusOr<ProjectedMesh> ProjectSurface(const MeshFile& from, const MeshFile& to, const OutputOptions& options,
                                             const SurfaceProjectionOptions& projection);

}  // namespace planish
