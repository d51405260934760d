// Bakes the colours and normals of one surface into images of another one that lies close to it, such as a scan and its
// decimated copy.
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

// The surface that colours and normals are taken from. `mesh` and the images must outlive it.
struct ProjectionSource {
  const Mesh* mesh = nullptr;
  std::vector<std::array<float, 3>> normals;  // three a face, of any length
  // Red, green and blue, linear, in [0, 1]; three a face. Empty: white.
  std::vector<std::array<float, 3>> colors;
  // Images that multiply the colours: per face the number of an image, or -1, and three UV, v downwards. Empty: no
  // images.
  std::vector<TextureSource> images;
  std::vector<std::int32_t> face_image;
  std::vector<std::array<Vec2, 3>> uv;

  bool has_colors() const { return !colors.empty() || !images.empty(); }
};

// The surface that gets the images, per triangle; UV in [0, 1], v downwards.
struct ProjectionTarget {
  std::vector<std::array<Vec3, 3>> positions;
  std::vector<std::array<Vec2, 3>> uv;
  std::vector<std::array<std::array<float, 3>, 3>> normals;
  std::vector<std::array<std::array<float, 4>, 3>> tangents;  // as in CornerFrames
};

struct ProjectionOptions {
  double reach = 0;  // length of the rays on either side of the target
  int size = 2048;   // texels per side
  const std::atomic<bool>* stop = nullptr;
};

struct Projection {
  TextureImage color;                   // sRGB, RGB of 8 bits; empty if the source has no colours
  TextureImage normal;                  // in the tangent frames of the target, RGB of 8 bits
  std::int64_t texels = 0, missed = 0;  // texels inside charts; those of them whose rays met nothing
};

// Casts rays from 2 x 2 points of each texel along the target's interpolated normal, to both sides. The texel shows the
// nearest hit on faces that face the same way. Texels without a hit are filled like gaps. CANCELLED; INVALID_ARGUMENT
// SURFACE_EMPTY if the source has no extent or positions that are not finite.
absl::StatusOr<Projection> Project(const ProjectionSource& source, const ProjectionTarget& target,
                                   const ProjectionOptions& options, ThreadTeam* team);

}  // namespace planish
