// Image files that a model refers to, and those that are written for it. Used inside client/files only.
#pragma once

#include <set>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "client/files/mesh_output.h"
#include "client/texture/image.h"
#include "client/texture/texture_baker.h"

namespace planish {

// The bytes of the image file `name` beside the model at `model`. FILE_UNREADABLE, or IMAGE_OUTSIDE if it does not lie
// in the folder of the model and !allow_outside.
absl::StatusOr<std::string> ReadImageFile(const std::string& model, const std::string& name, bool allow_outside);

// `status` with what to do if an image stands in the way.
absl::Status WithTextureAdvice(const absl::Status& status);

// One image that is to be made.
struct TextureBake {
  std::string name;  // for people
  TextureWrap wrap_u = TextureWrap::kRepeat, wrap_v = TextureWrap::kRepeat;
  bool nearest = false;
  BakeOptions options;
  std::vector<TextureTriangle> triangles;
  std::vector<double> areas;         // of the surface, a triangle
  std::vector<CornerFrames> frames;  // three a triangle, or none
};

// Decodes, resamples and encodes one image, of the same kind and with the same channels. Warns with TEXTURE_SIZE.
// Errors of the image; RESOURCE_EXHAUSTED, TEXTURE_MEMORY; CANCELLED.
absl::StatusOr<std::string> BakeImage(std::string bytes, const TextureBake& bake, const TextureOptions& options,
                                      std::vector<OutputWarning>* warnings);

// Names of new image files of one output: beside it, "OUTPUT_IMAGE.png", each once.
class TextureFileNames {
 public:
  // `taken` are files that must not be overwritten, because the model reads them.
  TextureFileNames(const std::string& output, const std::vector<std::string>& taken);
  // The path of a new file for an image that is called `image`.
  std::string Next(const std::string& image, ImageKind kind);
  // Of a material file, "OUTPUT.mtl".
  std::string NextMaterialFile();

 private:
  std::string Unused(const std::string& name, const std::string& extension);

  std::string output_;
  std::set<std::string> taken_;
};

}  // namespace planish
