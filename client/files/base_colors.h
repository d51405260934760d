// The base colours that the materials of a glTF or an OBJ show: images, and the factors that they are multiplied by.
// And the normal maps of a glTF.
#pragma once

#include <array>
#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "absl/status/statusor.h"
#include "client/files/mesh_file.h"
#include "client/texture/texture_baker.h"

namespace planish {

enum class AlphaMode { kOpaque, kMask, kBlend };

// An image, and how a material reads it.
struct ShownImage {
  std::int64_t image = -1;  // of BaseColorReader::Image(); -1: it has no image
  std::string image_name;   // for people
  int texcoord = 0;         // glTF: the set of UV that the image is read with; -1: there is no such set
  // The image is read at u' = transform[0] u + transform[1] v + transform[2], and v' likewise; v downwards.
  std::array<double, 6> transform = {1, 0, 0, 0, 1, 0};
  TextureWrap wrap_u = TextureWrap::kRepeat, wrap_v = TextureWrap::kRepeat;
  bool nearest = false;  // the sampler magnifies without interpolation
};

struct NormalMap : ShownImage {
  double scale = 1;  // of the first two components
};

// The base colour of a material, and its normal map.
struct BaseColor : ShownImage {
  NormalMap normals;
  std::array<double, 4> factor = {1, 1, 1, 1};  // linear
  AlphaMode alpha = AlphaMode::kOpaque;
  double cutoff = 0.5;  // of kMask
};

// Reads the base colours of a file, which must outlive it.
class BaseColorReader {
 public:
  // Reads the material files of an OBJ. Images, and material files, may be outside of the model's folder only if
  // `allow_outside`; material files that cannot be read have no materials.
  BaseColorReader(const MeshFile& file, bool allow_outside);

  // One for each of file.mesh.material_names; none for formats other than glTF, GLB and OBJ.
  const std::vector<BaseColor>& of_material() const { return of_material_; }

  // The bytes of the file of an image. FILE_UNREADABLE, IMAGE_OUTSIDE, FILE_MALFORMED.
  absl::StatusOr<std::string> Image(std::int64_t image) const;

 private:
  void ReadGltf();
  void ReadObj();

  const MeshFile& file_;
  const bool allow_outside_;
  std::vector<BaseColor> of_material_;
  std::vector<std::string> files_;  // OBJ: the images, from the model's folder
};

}  // namespace planish
