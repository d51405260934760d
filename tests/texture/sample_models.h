// Textured models for tests and benches, and what becomes of their looks when they get a new map.
#pragma once

#include <functional>
#include <string>
#include <vector>

#include "client/files/mesh_file.h"
#include "client/files/mesh_output.h"
#include "tests/texture/sample_textures.h"

namespace planish {

// A rectangle that is bent into a surface. Its UV are (u0, v0) + (x, y) * (du, dv), v downwards, of the image of its
// material.
struct SamplePatch {
  std::function<Vec3(double, double)> place;  // of (x, y) in [0, 1]^2
  int columns = 1, rows = 1;                  // of squares
  int material = 0;
  double u0 = 0, v0 = 0, du = 1, dv = 1;
};

// A material with a texture of colours, or of normals.
struct SampleMaterial {
  TextureImage image;
  bool is_normal = false;
  bool is_mirrored = false;  // the sampler repeats by mirroring
};

struct SampleModel {
  std::string name;
  bool is_smooth = true;  // the content is below an eighth of a cycle a texel
  std::vector<SamplePatch> patches;
  std::vector<SampleMaterial> materials;

  // One mesh with a primitive for each patch, with smooth normals, as a GLB file.
  std::string Glb() const;
};

// Ten models with colours, some with several materials, tiling and mirrored textures, noise, letters and JPEG; and one
// with normals, which is the last. `detail`: squares a side of a patch; `texels`: of a side of the images.
std::vector<SampleModel> SampleModels(int detail, int texels);

MeshFile Opened(const std::string& glb);
// `file` with a map of planish's own, with default options, and its images moved to it.
MeshFile WithNewMap(const MeshFile& file, const TextureOptions& textures = {});

// A knobbly ball as a scan, cut finely, with vertex colours; and as a decimated copy with UV of its own (a sphere's, in
// six squares): PLY files. The copy's vertices lie on the scan's surface.
std::string ScanPly(int detail);
std::string DecimatedGlb(int detail);
struct ProjectionDifference {
  double normal_mean_degrees = 0, color_mean = 0;  // at points of the copy, against the scan's formula
};
ProjectionDifference CompareWithScan(const MeshFile& projected, int points);

struct ModelDifference {
  Difference color;
  double normal_mean_degrees = 0;
  std::int64_t points = 0;
};
// What both files show at random points of the surface, evenly by area. `after` has the triangles of `before` in the
// same order.
ModelDifference CompareModels(const MeshFile& before, const MeshFile& after, int points);

// `after` with its images drawn by another resampler: in each texel the mean, in linear light, of 8 x 8 points of
// `before`, as a renderer shows them; encoded like those of `after`. Colours of three channels of 8 bits.
Difference ReferenceDifference(const MeshFile& before, const MeshFile& after, int points);

}  // namespace planish
