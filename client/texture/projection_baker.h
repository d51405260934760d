// Bakes one surface into images of another one that lies close to it, such as a scan and its decimated copy: colours,
// normals, heights and occlusion.
#pragma once

#include <array>
#include <atomic>
#include <cstdint>
#include <vector>

#include "absl/status/statusor.h"
#include "client/texture/image.h"
#include "client/texture/texture_baker.h"
#include "core/base/thread_team.h"
#include "core/mesh/mesh.h"

namespace planish {

// Images on the faces of a surface: per face the number of an image, or -1, and three UV, v downwards.
struct FaceImages {
  std::vector<TextureSource> images;
  std::vector<std::int32_t> of_face;
  std::vector<std::array<Vec2, 3>> uv;
};

// The surface that is baked. `mesh` and the images must outlive it.
struct ProjectionSource {
  const Mesh* mesh = nullptr;
  std::vector<std::array<float, 3>> normals;  // three a face, of any length
  // Red, green and blue, linear, in [0, 1]; three a face. Empty: white.
  std::vector<std::array<float, 3>> colors;
  FaceImages color_maps;  // multiply the colours
  FaceImages normal_maps;
  std::vector<double> normal_scales;           // of each normal map: x and y are multiplied by it
  std::vector<std::array<float, 4>> tangents;  // three a face, of its normal map, as in CornerFrames

  bool has_colors() const { return !colors.empty() || !color_maps.images.empty(); }
};

// The surface that gets the images, per triangle; UV in [0, 1], v downwards.
struct ProjectionTarget {
  std::vector<std::array<Vec3, 3>> positions;
  std::vector<std::array<Vec2, 3>> uv;
  std::vector<std::array<std::array<float, 3>, 3>> normals;
  std::vector<std::array<std::array<float, 4>, 3>> tangents;  // as in CornerFrames
};

inline constexpr int kSkyRays = 16;

struct ProjectionOptions {
  double reach = 0;  // length of the rays on either side of the target
  int size = 2048;   // texels per side
  bool height = false, occlusion = false;
  double occlusion_reach = 1;  // length of the rays towards the sky, in diagonals of the source
  const std::atomic<bool>* stop = nullptr;
};

struct Projection {
  TextureImage color;   // sRGB, RGB of 8 bits; empty if the source has no colours
  TextureImage normal;  // in the tangent frames of the target, RGB of 8 bits
  // Signed distance of the source along the target's normal: low + (high - low) * value / 65535. Grey of 16 bits.
  TextureImage height;
  double low = 0, high = 0;
  TextureImage occlusion;               // 255: the source hides nothing of the sky above it. Grey of 8 bits
  std::int64_t texels = 0, missed = 0;  // inside charts; of these, whose rays met nothing
};

// Casts rays from 2 x 2 points of each texel along the target's interpolated normal, to both sides. The texel shows the
// nearest hit on faces that face the same way. Texels without a hit are filled like gaps.
//
// Occlusion: from each hit, kSkyRays rays over the hemisphere of the hit face, weighted by the cosine; the share that
// meets the source within occlusion_reach is hidden. The directions are a fixed set, turned by an angle that depends on
// the texel.
//
// CANCELLED; INVALID_ARGUMENT SURFACE_EMPTY if the source has no extent or positions that are not finite.
absl::StatusOr<Projection> Project(const ProjectionSource& source, const ProjectionTarget& target,
                                   const ProjectionOptions& options, ThreadTeam* team);

}  // namespace planish
